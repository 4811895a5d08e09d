"""Material laws: small-strain linear elasticity."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastcontact.argument_types import typed
from fastcontact.errors import ModelError, unknown

KINEMATICS = ("axisymmetric", "plane_strain", "plane_stress", "3d")
# What elements make of the dilatation.
VOLUMETRIC = ("auto", "plain", "mean_dilatation")
# Poisson's ratio from which on a material has a mean dilatation by itself.
NEARLY_INCOMPRESSIBLE = 0.49


@typed(ModelError)
@dataclass(frozen=True)
class LinearElastic:
    """Isotropic linear elasticity.

    ModelError if a constant is outside its range.

    Parameters
    ----------
    E : float
        Young's modulus [pressure], positive.
    nu : float
        Poisson's ratio, -1 < nu < 0.5.
    volumetric : str
        How elements take the dilatation, the change of volume: ``"plain"`` as it is; ``"mean_dilatation"`` its mean in
        each quadrangle, hexahedron, wedge and pyramid (in quadratic ones a linear function), so that they do not lock
        where the material is nearly incompressible. ``"auto"``: the latter from nu = 0.49 on. Nothing changes in
        triangles and tetrahedra, and in plane stress.
    """

    E: float
    nu: float
    volumetric: str = "auto"

    def __post_init__(self) -> None:
        if not (math.isfinite(self.E) and self.E > 0):
            raise ModelError(f"Young's modulus E = {self.E} must be a positive number")
        if not -1.0 < self.nu < 0.5:
            raise ModelError(
                f"Poisson's ratio nu = {self.nu} must lie between -1 and 0.5, both excluded "
                "(for an incompressible material take nu = 0.4999, in quadrangles or hexahedra: they have a mean dilatation "
                "then and do not lock)"
            )
        if self.volumetric not in VOLUMETRIC:
            raise ModelError(unknown("volumetric", self.volumetric, VOLUMETRIC))

    @property
    def averaged(self) -> bool:
        """Whether elements have a mean dilatation, where they can and kinematics are not plane stress."""
        return self.volumetric == "mean_dilatation" or (self.volumetric == "auto" and self.nu >= NEARLY_INCOMPRESSIBLE)

    @property
    def shear_modulus(self) -> float:
        """Shear modulus [pressure]."""
        return self.E / (2 * (1 + self.nu))

    def moduli(self, kinematics: str) -> NDArray[np.float64]:
        """Return the matrix (4, 4), in 3D (6, 6) [pressure] from strains (xx, yy, zz, 2xy, in 3D 2yz, 2xz) to stresses.

        Plane stress has no stress zz (Timoshenko and Goodier, 1970, section 16).
        """
        E, nu, G = self.E, self.nu, self.shear_modulus
        if kinematics not in KINEMATICS:
            raise ModelError(unknown("kinematics", kinematics, KINEMATICS))
        if kinematics == "plane_stress":
            D = np.zeros((4, 4))
            D[:2, :2] = E / (1 - nu * nu) * np.array([[1.0, nu], [nu, 1.0]])
            D[3, 3] = G
            return D
        size = 6 if kinematics == "3d" else 4
        D = np.zeros((size, size))
        D[:3, :3] = E * nu / ((1 + nu) * (1 - 2 * nu))
        D[range(3), range(3)] += 2 * G
        D[range(3, size), range(3, size)] = G
        return D
