"""Material laws: small-strain linear elasticity. What all have in common, and the isotropic one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.elasticity.loads import LARGEST
from fastcontact.elasticity.material_axes import PAIRS, Axes, frames, rotations
from fastcontact.errors import ModelError, unknown
from fastcontact.mesh.argument_types import typed

Array = NDArray[np.float64]

KINEMATICS = ("axisymmetric", "plane_strain", "plane_stress", "3d")
# What elements make of the dilatation.
VOLUMETRIC = ("auto", "plain", "mean_dilatation")
# Poisson's ratio from which on a material has a mean dilatation by itself.
NEARLY_INCOMPRESSIBLE = 0.49
# Couplings of plane strains with others, relative to the largest modulus, that are round-off of a rotation.
ROUND_OFF = 1e-12


class Material:
    """A linear elastic material: its moduli in axes of its own, and what loads and temperature need to know of it.

    Attributes
    ----------
    density : float or None
        Mass per volume [mass / length^3].
    expansion : float, tuple or None
        Coefficients of thermal expansion [1 / temperature].
    axes : sequence, callable or None
        Unit vectors in rows (3, 3) [-], or a function, see `Orthotropic`; None: those of the mesh.
    averaged : bool
        Whether elements have a mean dilatation, where they can and kinematics are not plane stress.
    incompatible_modes : bool
        Whether linear quadrangles and hexahedra have incompatible modes, where kinematics are not axisymmetric.
    """

    density: float | None
    expansion: Any
    axes: Axes = None
    averaged: bool = False
    incompatible_modes: bool = False

    @property
    def young(self) -> tuple[float, float]:
        """The smallest and the largest Young's modulus along the material's axes [pressure]."""
        diagonal = 1.0 / np.diag(self.local_compliance)[:3]
        return float(diagonal.min()), float(diagonal.max())

    @property
    def contact_modulus(self) -> float:
        """The least plane-strain modulus E / (1 - nu^2) along the axes, by which contact is scaled [pressure]."""
        D = np.linalg.inv(self.local_compliance)
        free = [D[i, i] - D[i, j] * D[j, i] / D[j, j] for i, j in ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))]
        return float(min(free))

    @property
    def local_compliance(self) -> Array:
        """Compliance (6, 6) [1 / pressure] in the material's axes: strains 11, 22, 33, 2*12, 2*23, 2*13 of stresses."""
        raise NotImplementedError

    @property
    def described(self) -> str:
        """The material's constants, for messages."""
        raise NotImplementedError

    @property
    def varies(self) -> bool:
        """Whether the axes, and with them the moduli, depend on the position."""
        return callable(self.axes)

    def moduli(self, kinematics: str) -> Array:
        """Return the matrix (4, 4), in 3D (6, 6) [pressure] from strains (xx, yy, zz, 2xy, in 3D 2yz, 2xz) to stresses.

        In axisymmetry x, y, z are the radius, the axis and the circumference. Plane stress has no stress zz. ModelError if
        the axes depend on the position.
        """
        if self.varies:
            raise ModelError("the axes of the material depend on the position: ask for moduli_at(points, kinematics)")
        return np.asarray(self.moduli_at(np.zeros((1, 3 if kinematics == "3d" else 2)), kinematics)[0])

    def moduli_at(self, points: Array, kinematics: str) -> Array:
        """Return the moduli (n, 4, 4), in 3D (n, 6, 6) [pressure] at `points` (n, dim) [length]; see `moduli`."""
        compliance = self._compliance6(points, kinematics)
        if kinematics == "3d":
            return np.asarray(np.linalg.inv(compliance))
        if kinematics != "plane_stress":
            return np.asarray(np.linalg.inv(compliance)[:, :4, :4])
        inner = np.ix_(range(len(compliance)), (0, 1, 3), (0, 1, 3))
        D = np.zeros((len(compliance), 4, 4))
        D[inner] = np.linalg.inv(compliance[inner])
        return D

    def compliance_at(self, points: Array, kinematics: str) -> Array:
        """Return the compliance (n, 4, 4), in 3D (n, 6, 6) [1 / pressure] at `points` (n, dim) [length].

        Stress : strain is that of the whole stress in any kinematics, since stresses yz and xz are zero in the plane.
        """
        size = 6 if kinematics == "3d" else 4
        return np.asarray(self._compliance6(points, kinematics)[:, :size, :size])

    def expansion_at(self, points: Array, kinematics: str) -> Array:
        """Return the strains (n, 4), in 3D (n, 6) [1 / temperature] of a degree at `points` (n, dim) [length].

        NaN without expansion. ModelError if it is a shear out of the plane, in kinematics that have none.
        """
        size = 6 if kinematics == "3d" else 4
        if self.expansion is None:
            return np.full((len(points), size), np.nan)
        along = np.broadcast_to(np.asarray(self.expansion, float), (3,))
        axes = frames(self.axes, points, kinematics)
        tensor = np.einsum("nai,a,naj->nij", axes, along, axes)
        strain = np.stack([tensor[:, i, j] * (1.0 if i == j else 2.0) for i, j in PAIRS], axis=1)
        if np.abs(strain[:, size:]).max(initial=0.0) > ROUND_OFF * np.abs(along).max():
            raise ModelError(
                f"the expansion of the material with {self.described} shears it out of the plane: turn one axis along z, or "
                "use a mesh in 3D"
            )
        return np.asarray(strain[:, :size])

    def _compliance6(self, points: Array, kinematics: str) -> Array:
        """Return the compliance (n, 6, 6) in the mesh's axes; ModelError where kinematics of the plane do not hold."""
        if kinematics not in KINEMATICS:
            raise ModelError(unknown("kinematics", kinematics, KINEMATICS))
        of_stress = rotations(frames(self.axes, points, kinematics))
        # Strains turn by the inverse of the transpose, which for stresses in another frame is the rotation back.
        back = np.linalg.inv(of_stress)
        compliance = np.asarray(back.transpose(0, 2, 1) @ self.local_compliance @ back)
        across = np.abs(compliance[:, :4, 4:]).max(initial=0.0)
        if kinematics != "3d" and across > ROUND_OFF * np.abs(compliance).max():
            raise ModelError(
                f"the material with {self.described} couples strains in the plane with shear out of it, by its constants or "
                f"by its axes: {kinematics} has no such shear; turn one axis along z, or use a mesh in 3D"
            )
        compliance[:, :4, 4:] = 0.0 if kinematics != "3d" else compliance[:, :4, 4:]
        compliance[:, 4:, :4] = 0.0 if kinematics != "3d" else compliance[:, 4:, :4]
        return compliance


def check_positive(name: str, value: Any, what: str = "a positive number") -> None:
    """Raise ModelError if a constant of a material, `name` in the message, is not a positive number."""
    number: Any = value if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    if not 0.0 < number < math.inf:
        raise ModelError(f"{name} = {value} must be {what}")
    if not 1.0 / LARGEST <= number <= LARGEST:
        raise ModelError(f"{name} is out of range: it must lie between {1.0 / LARGEST:g} and {LARGEST:g}, in any unit")


def check_density(value: Any) -> None:
    """Raise ModelError if a density is given and is no number from zero on."""
    if value is not None and (
        not isinstance(value, Real) or isinstance(value, bool) or not 0.0 <= float(value) < math.inf
    ):
        raise ModelError(f"the density = {value} must be a number, zero or more")


def check_expansion(value: Any, most: int) -> None:
    """Raise ModelError if an expansion is given and is neither a finite number nor `most` of them along the axes."""
    numbers = [value] if not isinstance(value, (Sequence, np.ndarray)) else list(value)
    fit = all(isinstance(v, Real) and not isinstance(v, bool) and math.isfinite(v) for v in numbers)
    if value is not None and not (fit and len(numbers) in (1, most)):
        wanted = "a number" if most == 1 else "a number, or three along the material's axes"
        raise ModelError(f"the coefficient of thermal expansion = {value} must be {wanted}")


@typed(ModelError)
@dataclass(frozen=True)
class LinearElastic(Material):
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
    density : float, optional
        Mass per volume [mass / length^3], for gravity and centrifugal loads; zero or more.
    expansion : float, optional
        Coefficient of thermal expansion [1 / temperature].
    incompatible_modes : bool
        Linear quadrangles and hexahedra get incompatible modes, so that thin parts of them bend without locking in shear;
        nothing changes in other elements and in axisymmetry. Excludes a mean dilatation.
    """

    E: float
    nu: float
    volumetric: str = "auto"
    density: float | None = None
    expansion: float | None = None
    incompatible_modes: bool = False

    def __post_init__(self) -> None:
        check_positive("Young's modulus E", self.E)
        if not -1.0 < self.nu < 0.5:
            raise ModelError(
                f"Poisson's ratio nu = {self.nu} must lie between -1 and 0.5, both excluded "
                "(for an incompressible material take nu = 0.4999, in quadrangles or hexahedra: they have a mean dilatation "
                "then and do not lock)"
            )
        if self.volumetric not in VOLUMETRIC:
            raise ModelError(unknown("volumetric", self.volumetric, VOLUMETRIC))
        if self.incompatible_modes and self.volumetric == "mean_dilatation":
            raise ModelError("a material has either incompatible modes or a mean dilatation, not both")
        check_density(self.density)
        check_expansion(self.expansion, 1)

    @property
    def described(self) -> str:
        """E and nu, for messages."""
        return f"E = {self.E:g}, nu = {self.nu:g}"

    @property
    def young(self) -> tuple[float, float]:
        """Young's modulus, twice."""
        return self.E, self.E

    @property
    def contact_modulus(self) -> float:
        """E / (1 - nu^2) [pressure]."""
        return self.E / (1 - self.nu**2)

    @property
    def local_compliance(self) -> Array:
        """Compliance (6, 6) [1 / pressure]."""
        S = np.diag([*[(1 + self.nu) / self.E] * 3, *[1 / self.shear_modulus] * 3])
        S[:3, :3] -= self.nu / self.E
        return S

    @property
    def averaged(self) -> bool:  # type: ignore[override]
        """Whether elements have a mean dilatation, where they can and kinematics are not plane stress."""
        if self.incompatible_modes:  # which do not lock in volume either
            return False
        return self.volumetric == "mean_dilatation" or (self.volumetric == "auto" and self.nu >= NEARLY_INCOMPRESSIBLE)

    @property
    def shear_modulus(self) -> float:
        """Shear modulus [pressure]."""
        return self.E / (2 * (1 + self.nu))

    def moduli(self, kinematics: str) -> Array:
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
