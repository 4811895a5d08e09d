"""Orthotropic and general anisotropic linear elastic materials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import check_type
from fastcontact.arrays import Array
from fastcontact.elasticity.loads import LARGEST
from fastcontact.elasticity.material_axes import Axes, checked_axes, frames
from fastcontact.elasticity.materials import Constant, Material, check_positive
from fastcontact.elasticity.varying_constants import CellAxes, Varying, wrap_varying
from fastcontact.errors import ModelError
from fastcontact.round_off import ROUND_OFF

# Pairs of material axes to which Poisson's ratios and shear moduli belong.
AXIS_PAIRS = ("12", "13", "23")
# Largest difference between symmetric entries of the matrix of moduli, relative to its largest entry.
SYMMETRY_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Orthotropic(Material):
    """Orthotropic linear elasticity, for example of wood, rolled sheet, laminates and composites.

    Parameters
    ----------
    E : (float, float, float)
        Young's moduli E1, E2, E3 along the material axes [pressure]. Each of the constants in E, nu and G may be a number, a
        function or an array, as described for E in `LinearElastic`.
    nu : (float, float, float)
        Poisson's ratios nu12, nu13, nu23 [-]. Under a uniaxial stress along axis 1, nu12 is minus the ratio of the strain
        along axis 2 to the strain along axis 1. The reciprocal ratio is nu21 = nu12 E2 / E1.
    G : (float, float, float)
        Shear moduli G12, G13, G23 [pressure].
    axes : sequence or callable, optional
        Material axes; by default the axes of the mesh, which in axisymmetry are the radial, axial and circumferential
        directions. They are given as two or three orthogonal vectors (x, y, z) of any length. In 2D, the first vector (x, y)
        suffices. Axes that vary are given as a function from positions (n, dim) [length] to unit vectors in rows (n, 3, 3),
        such as `CylindricalAxes`, which is evaluated at the quadrature points, or as an array (n_cells, 3, 3) for the cells
        of the material or of the mesh.
    density : float, callable or ndarray (n,), optional
        Mass per unit volume [mass / length^3].
    expansion : float, callable, ndarray (n,) or three of them, optional
        Coefficient of thermal expansion, or one coefficient along each axis [1 / temperature].
    incompatible_modes : bool
        Whether linear quadrangles and hexahedra have incompatible modes, as described for `LinearElastic`.
    conductivity : float, callable, ndarray (n,) or three of them, optional
        Thermal conductivity, or one conductivity along each axis [power / (length temperature)].

    Raises
    ------
    ModelError
        If the elastic energy is not positive for every strain; the message states the violated condition.

    Notes
    -----
    The conditions for a positive energy are those of Lempriere, AIAA J. 6, 1968. The definition of the compliance is that of
    Lekhnitskii, Theory of elasticity of an anisotropic body, 1963.

    Examples
    --------
    >>> import fastcontact as fc
    >>> spruce = fc.Orthotropic(E=(10_800, 700, 430), nu=(0.45, 0.51, 0.54), G=(620, 580, 26))
    >>> spruce.moduli("3d").shape
    (6, 6)
    """

    E: Sequence[Any]
    nu: Sequence[Any]
    G: Sequence[Any]
    axes: Axes = None
    density: Constant | None = None
    expansion: Constant | Sequence[Constant] | None = None
    incompatible_modes: bool = False
    conductivity: Constant | Sequence[Constant] | None = None

    def __post_init__(self) -> None:
        for name in ("E", "nu", "G", "axes", "density", "expansion", "conductivity"):
            check_type(f"{name} of Orthotropic", getattr(self, name), Any, ModelError)
        for name in ("E", "nu", "G"):
            object.__setattr__(self, name, _three_constants(name, getattr(self, name)))
        names = [f"Young's modulus E{axis}" for axis in "123"] + [f"the shear modulus G{pair}" for pair in AXIS_PAIRS]
        for name, modulus in zip(names, (*self.E, *self.G), strict=True):
            if not isinstance(modulus, Varying):
                check_positive(name, modulus)
        if not self.graded:  # Constants that vary are checked when the cells are known.
            _check_ratios(self.E, self.nu)
        _set_other_properties(self)

    @classmethod
    def transversely_isotropic(
        cls,
        E_along: float,
        E_across: float,
        nu_along: float,
        nu_across: float,
        G_along: float,
        *,
        axes: Axes = None,
        density: Constant | None = None,
        expansion: Constant | Sequence[Constant] | None = None,
    ) -> Orthotropic:
        """Return a transversely isotropic material, for example with fibres along its first axis.

        Parameters
        ----------
        E_along, E_across : float
            Young's moduli along the first axis and normal to it [pressure].
        nu_along : float
            Poisson's ratio under a uniaxial stress along the first axis: minus the ratio of the strain normal to the axis to
            the strain along it [-].
        nu_across : float
            Poisson's ratio in the plane of isotropy [-]. The shear modulus in this plane is
            E_across / (2 (1 + nu_across)).
        G_along : float
            Shear modulus in planes that contain the first axis [pressure].
        axes : sequence or callable, optional
            Material axes: unit vectors in rows (3, 3) [-], or a function, as described for `Orthotropic`.
        density : float, callable or ndarray (n,), optional
            Mass per unit volume [mass / length^3].
        expansion : float, callable, ndarray (n,) or three of them, optional
            Coefficient of thermal expansion, or one coefficient along each axis [1 / temperature].

        Returns
        -------
        Orthotropic

        Raises
        ------
        ModelError
            If the elastic energy is not positive for every strain.
        """
        check_type("nu_across of a transversely isotropic material", nu_across, float, ModelError)
        check_type("E_across of a transversely isotropic material", E_across, float | Array, ModelError)
        if not nu_across > -1.0:
            raise ModelError(f"Poisson's ratio nu_across = {nu_across} must be above -1")
        G_across = E_across / (2.0 * (1.0 + nu_across))
        E, nu, G = (E_along, E_across, E_across), (nu_along, nu_along, nu_across), (G_along, G_along, G_across)
        return cls(E, nu, G, axes, density, expansion)

    @property
    def described(self) -> str:
        """Text with the constants, for messages."""
        return ", ".join(f"{name} = ({', '.join(f'{v:g}' for v in getattr(self, name))})" for name in ("E", "nu", "G"))

    def compliances(self, constants: Any) -> Array:
        """Return the compliances (n, 6, 6) [1 / pressure] in material axes; the constants may be arrays (n,)."""
        values = np.broadcast_arrays(*map(np.atleast_1d, (*constants.E, *constants.nu, *constants.G)))
        E1, E2, E3, nu12, nu13, nu23, G12, G13, G23 = values
        S = np.zeros((len(E1), 6, 6))
        for row, modulus in enumerate((E1, E2, E3, G12, G23, G13)):
            S[:, row, row] = 1 / modulus
        S[:, 0, 1] = S[:, 1, 0] = -nu12 / E1
        S[:, 0, 2] = S[:, 2, 0] = -nu13 / E1
        S[:, 1, 2] = S[:, 2, 1] = -nu23 / E2
        return S

    def admissible(self, constants: Any) -> Any:
        """Return, for each set of constants (n,), whether the strain energy is positive definite."""
        constant_groups = constants.E, constants.nu, constants.G
        E, nu, G = (np.broadcast_arrays(*map(np.atleast_1d, values)) for values in constant_groups)
        in_range = np.all([(v >= 1.0 / LARGEST) & (v <= LARGEST) for v in np.broadcast_arrays(*E, *G)], axis=0)
        with np.errstate(all="ignore"):  # inadmissible moduli are detected above
            nu21, nu31, nu32 = nu[0] * E[1] / E[0], nu[1] * E[2] / E[0], nu[2] * E[2] / E[1]
            minors_positive = (nu[0] * nu21 < 1.0) & (nu[1] * nu31 < 1.0) & (nu[2] * nu32 < 1.0)
            return in_range & minors_positive & (_determinant(nu, (nu21, nu31, nu32)) > ROUND_OFF)


@dataclass(frozen=True)
class Anisotropic(Material):
    """General anisotropic linear elasticity.

    Parameters
    ----------
    D : array_like (6, 6)
        Matrix of moduli in material axes, which maps strains 11, 22, 33, 2*12, 2*23, 2*13 to stresses 11, 22, 33, 12, 23, 13
        [pressure].
    axes : sequence or callable, optional
        Material axes: unit vectors in rows (3, 3) [-], or a function, as described for `Orthotropic`.
    density : float, callable or ndarray (n,), optional
        Mass per unit volume [mass / length^3].
    expansion : float, callable, ndarray (n,) or three of them, optional
        Coefficient of thermal expansion, or one coefficient along each axis [1 / temperature].
    incompatible_modes : bool
        Whether linear quadrangles and hexahedra have incompatible modes, as described for `LinearElastic`.
    conductivity : float, callable, ndarray (n,) or three of them, optional
        Thermal conductivity, or one conductivity along each axis [power / (length temperature)].

    Raises
    ------
    ModelError
        If the matrix is not symmetric and positive definite.

    Examples
    --------
    >>> import numpy as np
    >>> import fastcontact as fc
    >>> D = np.diag([3.0, 3.0, 3.0, 1.0, 1.0, 1.0])
    >>> D[:3, :3] += 1.0
    >>> material = fc.Anisotropic(D, axes=fc.CylindricalAxes())
    """

    D: Any
    axes: Axes = None
    density: Constant | None = None
    expansion: Constant | Sequence[Constant] | None = None
    incompatible_modes: bool = False
    conductivity: Constant | Sequence[Constant] | None = None

    def __post_init__(self) -> None:
        for name in ("D", "axes", "density", "expansion", "conductivity"):
            check_type(f"{name} of Anisotropic", getattr(self, name), Any, ModelError)
        try:
            D = np.empty(0) if np.iscomplexobj(self.D) else np.asarray(self.D, float)
        except (TypeError, ValueError):
            D = np.empty(0)
        if D.shape != (6, 6) or not np.isfinite(D).all():
            raise ModelError(
                f"the moduli D must be a matrix of 6 x 6 finite numbers, not of shape {np.shape(np.asarray(self.D, object))}"
            )
        asymmetry = np.abs(D - D.T)
        if asymmetry.max() > SYMMETRY_TOLERANCE * np.abs(D).max():
            i, j = np.unravel_index(asymmetry.argmax(), D.shape)
            raise ModelError(f"the moduli D are not symmetric: D[{i}, {j}] = {D[i, j]:g} and D[{j}, {i}] = {D[j, i]:g}")
        D = (D + D.T) / 2.0
        smallest = float(np.linalg.eigvalsh(D)[0])
        if not smallest > 1e-14 * np.abs(D).max():
            raise ModelError(
                f"the moduli D are not positive definite: their smallest eigenvalue is {smallest:.6g}, so that the elastic "
                "energy is not positive for every strain; check the order of the components, 11, 22, 33, 12, 23, 13"
            )
        object.__setattr__(self, "D", tuple(tuple(row) for row in D.tolist()))
        _set_other_properties(self)

    @property
    def described(self) -> str:
        """Text with the diagonal of the moduli, for messages."""
        return f"D with the diagonal ({', '.join(f'{self.D[i][i]:g}' for i in range(6))})"

    def compliances(self, constants: Any) -> Array:
        """Return the constant compliance (1, 6, 6) [1 / pressure]."""
        return np.asarray(np.linalg.inv(np.array(self.D)[None]))

    def admissible(self, constants: Any) -> Any:
        """Return True, because the moduli are constant and were checked when the material was created."""
        return True


def _set_other_properties(material: Orthotropic | Anisotropic) -> None:
    """Check and normalise the axes and the properties that do not determine the moduli."""
    object.__setattr__(material, "density", wrap_varying(material.density))
    for name in ("expansion", "conductivity"):
        value = getattr(material, name)
        if isinstance(value, np.ndarray) and value.shape == (3,):  # one constant along each axis
            value = tuple(value.tolist())
        object.__setattr__(material, name, wrap_varying(value, vector=True))
    object.__setattr__(material, "axes", _axes(material.axes))
    material.check_thermal_and_density(3)
    for name in ("expansion", "conductivity"):
        if isinstance(coefficients := getattr(material, name), tuple):
            coefficients = tuple(v if isinstance(v, Varying) else float(v) for v in coefficients)
            object.__setattr__(material, name, coefficients)


def _axes(axes: Any) -> Any:
    """Return the normalised axes of a material; raise ModelError if they are not orthogonal vectors."""
    if isinstance(axes, CellAxes):
        return axes
    if not isinstance(axes, np.ndarray) or axes.ndim != 3:
        return checked_axes(axes)
    return CellAxes(frames(lambda points: axes, np.zeros((len(axes), 3)), "3d"))


def _three_constants(name: str, values: Any) -> tuple[Any, Any, Any]:
    """Return the three constants E, nu or G of an orthotropic material; raise ModelError unless they are valid."""
    try:
        a, b, c = (v if isinstance(v, Varying) else _real(v) for v in map(wrap_varying, values))
    except (TypeError, ValueError):
        order = "1, 2 and 3" if name == "E" else "12, 13 and 23"
        raise ModelError(f"{name} = {values!r} of an orthotropic material must be three numbers, for {order}") from None
    return a, b, c


def _real(value: Any) -> float:
    """Return a real number as a float; raise TypeError for other values, such as text and complex numbers."""
    if not isinstance(value, Real) or isinstance(value, bool):
        raise TypeError(value)
    return float(value)


def _determinant(nu: Sequence[Any], reciprocal: Sequence[Any]) -> Any:
    """Return the determinant of Lempriere's condition, which is positive if the strain energy is positive definite [-].

    `nu` contains nu12, nu13, nu23, and `reciprocal` contains nu21, nu31, nu32.
    """
    (nu12, nu13, nu23), (nu21, nu31, nu32) = nu, reciprocal
    return 1.0 - nu12 * nu21 - nu23 * nu32 - nu13 * nu31 - 2.0 * nu21 * nu32 * nu13


def _check_ratios(E: Sequence[float], nu: Sequence[float]) -> None:
    """Raise ModelError if the strain energy is not positive definite for these Poisson's ratios."""
    for value, pair, (i, j) in zip(nu, AXIS_PAIRS, ((0, 1), (0, 2), (1, 2)), strict=True):
        limit = math.sqrt(E[i] / E[j])
        if not abs(value) < limit:
            raise ModelError(
                f"Poisson's ratio nu{pair} = {value:g} must be less than sqrt(E{i + 1} / E{j + 1}) = {limit:.6g} in "
                f"magnitude: is it nu{pair[::-1]} = nu{pair} E{j + 1} / E{i + 1}?"
            )
    nu12, nu13, nu23 = nu
    nu21, nu31, nu32 = nu12 * E[1] / E[0], nu13 * E[2] / E[0], nu23 * E[2] / E[1]
    determinant = _determinant(nu, (nu21, nu31, nu32))
    if not determinant > ROUND_OFF:
        raise ModelError(
            f"Poisson's ratios nu12, nu13, nu23 = {nu12:g}, {nu13:g}, {nu23:g} are too large together: 1 - nu12 nu21 - nu23 "
            f"nu32 - nu13 nu31 - 2 nu21 nu32 nu13 = {determinant:.6g} must be positive"
        )
