"""Linear elastic material laws: base class and isotropic elasticity."""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array, Indices
from fastcontact.elasticity.loads import LARGEST, Value
from fastcontact.elasticity.material_axes import PAIRS, Axes, frames, rotations
from fastcontact.elasticity.varying_constants import Cells, Varying, mapped, varying, wrapped
from fastcontact.errors import ModelError, check_known
from fastcontact.round_off import ROUND_OFF

AnyMaterial = TypeVar("AnyMaterial", bound="Material")

KINEMATICS = ("axisymmetric", "plane_strain", "plane_stress", "3d")
# Treatments of the dilatation.
VOLUMETRIC = ("auto", "plain", "mean_dilatation")
# Poisson's ratio above which a material has a mean dilatation by default.
NEARLY_INCOMPRESSIBLE = 0.49
# Constants that may vary, those of the moduli first.
MODULI = ("E", "nu", "G")
CONSTANTS = (*MODULI, "density", "expansion", "conductivity")


@typed(ModelError)
class Material:
    """A linear elastic material: moduli in material axes, density, and thermal properties.

    Attributes
    ----------
    density : float, Varying or None
        Mass per volume [mass / length^3].
    expansion : float, Varying, tuple or None
        Coefficients of thermal expansion [1 / temperature].
    conductivity : float, Varying, tuple or None
        Thermal conductivity, one or three along the axes [power / (length temperature)].
    axes : sequence, callable or None
        Unit vectors in rows (3, 3) [-], or a function, see `Orthotropic`; None: those of the mesh.
    averaged : bool
        Whether elements that support it have a mean dilatation, except in plane stress.
    incompatible_modes : bool
        Whether linear quadrangles and hexahedra have incompatible modes instead of a mean dilatation, except in axisymmetry.
    """

    density: Any
    expansion: Any
    conductivity: Any = None
    axes: Axes = None
    averaged: bool = False
    incompatible_modes: bool = False

    @property
    def young(self) -> tuple[float, float]:
        """The smallest and the largest Young's modulus along the material's axes [pressure]."""
        diagonal = 1.0 / np.diagonal(self._all_compliances(), axis1=1, axis2=2)[:, :3]
        return float(diagonal.min()), float(diagonal.max())

    @property
    def contact_modulus(self) -> float:
        """Smallest plane-strain modulus E / (1 - nu^2) along the axes, the scale of contact stiffness [pressure]."""
        D = np.moveaxis(np.linalg.inv(self._all_compliances()), 0, -1)
        free = [D[i, i] - D[i, j] * D[j, i] / D[j, j] for i, j in ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))]
        return float(np.min(free))

    def _all_compliances(self) -> Array:
        """Return compliances (n, 6, 6) [1 / pressure] in material axes, at all samples if constants vary."""
        if not self.graded:
            return self.local_compliance[None]
        return np.concatenate([self.compliances(self.constants_at(*sample)) for sample in self._cells().samples()])

    @property
    def local_compliance(self) -> Array:
        """Compliance (6, 6) [1 / pressure] in the material's axes: strains 11, 22, 33, 2*12, 2*23, 2*13 of stresses."""
        return np.asarray(self.compliances(self)[0])

    @property
    def described(self) -> str:
        """The material's constants, for messages."""
        raise NotImplementedError

    @property
    def varies(self) -> bool:
        """Whether axes, moduli or expansion depend on position."""
        return callable(self.axes) or self.graded or bool(varying(self.expansion) or varying(self.axes))

    @property
    def graded(self) -> bool:
        """Whether constants of the moduli depend on position."""
        return any(varying(getattr(self, name, None)) for name in MODULI)

    @property
    def varies_inside(self) -> bool:
        """Whether axes, moduli or expansion vary inside cells: as functions, or as numbers at points.

        Cells with a mean dilatation use the constants at their middle.
        """
        varying_constants = [v for name in (*MODULI, "expansion") for v in varying(getattr(self, name, None))]
        return (callable(self.axes) or any(v.inside for v in varying_constants)) and not self.averaged

    def check_thermal_and_density(self, most: int) -> None:
        """Raise ModelError unless the density is at least 0, and thermal constants are one number or `most` along the axes.

        Varying constants are checked with their cells.
        """
        density = self.density
        if not isinstance(density, Varying) and density is not None and not 0.0 <= _real(density) < math.inf:
            raise ModelError(f"the density = {density} must be a number, zero or more")
        check_expansion(self.expansion, most)
        check_conductivity(self.conductivity, most)

    def bound(self: AnyMaterial, cells: Cells) -> AnyMaterial:
        """Return the material with its cells, for varying constants; ModelError where these are not admissible."""
        names = [name for name in (*CONSTANTS, "axes") if varying(getattr(self, name, None))]
        if not names:
            return self

        def known(name: str) -> Any:
            label = f"the constant {name} of the material"
            return mapped(
                getattr(self, name), lambda v: type(v)(v.given, cells, label) if isinstance(v, Varying) else v
            )

        bound_material = copy.copy(self)
        for name in names:
            object.__setattr__(bound_material, name, known(name))
        for sample in cells.samples():
            bound_material._check_at([name for name in names if name != "axes"], *sample)
        return bound_material

    def constants_at(self, name: str, rows: Indices, N: Array) -> SimpleNamespace:
        """Return the constants in cells of an element, varying ones as arrays (n_rows * n,) [unit of the constant].

        `rows` (n_rows,) of int are the numbers of the cells, `N` (n, n_nodes) [-] shape functions at the points.
        """

        def at(value: Any) -> Any:
            return mapped(value, lambda v: v.at(name, rows, N) if isinstance(v, Varying) else v)

        return SimpleNamespace(**{key: at(getattr(self, key, None)) for key in (*CONSTANTS, "axes")})

    def compliances(self, constants: Any) -> Array:
        """Return compliances (n, 6, 6) [1 / pressure] in the material's axes, of constants that may be arrays (n,)."""
        raise NotImplementedError

    def admissible(self, constants: Any) -> Any:
        """Return for which constants (n,) the material is admissible."""
        raise NotImplementedError

    def _cells(self) -> Cells:
        """Return the cells of the material; ModelError if they are not known."""
        varying_constants = [v for name in CONSTANTS for v in varying(getattr(self, name, None))]
        if not varying_constants or varying_constants[0].cells is None:
            raise ModelError(
                "constants of the material depend on the position: take the material from the `materials` of a model"
            )
        return varying_constants[0].cells

    def _check_at(self, names: Sequence[str], element: str, rows: Indices, N: Array) -> None:
        """Raise ModelError, with the position, where the constants `names` are not admissible."""
        constants, count = self.constants_at(element, rows, N), len(rows) * len(N)
        wrong = np.array(np.broadcast_to(~np.asarray(self.admissible(constants), bool), count))
        if constants.density is not None:
            wrong |= np.asarray(constants.density) < 0.0
        for k in constants.conductivity if isinstance(constants.conductivity, tuple) else (constants.conductivity,):
            wrong |= k is not None and ~(np.asarray(k, float) > 0.0)
        if not wrong.any():
            return
        row = int(wrong.argmax())
        one = {
            name: mapped(getattr(constants, name), lambda v: float(np.broadcast_to(np.asarray(v), count)[row]))
            for name in names
        }
        mesh, cell = self._cells().mesh, int(rows[row // len(N)])
        where = f"in cell {cell} of {element} near {mesh.points[mesh.cells[element][cell]].mean(axis=0)}"
        try:
            dataclasses.replace(self, **one)  # type: ignore[type-var]
        except ModelError as error:
            raise ModelError(f"{where}: {error}") from None

    def moduli(self, kinematics: str) -> Array:
        """Return the matrix (4, 4), in 3D (6, 6) [pressure] from strains (xx, yy, zz, 2xy, in 3D 2yz, 2xz) to stresses.

        In axisymmetry x, y, z are the radius, the axis and the circumference. Plane stress has no stress zz. ModelError if
        the axes depend on the position.
        """
        if self.varies:
            raise ModelError("the axes of the material depend on the position: ask for moduli_at(points, kinematics)")
        return np.asarray(self.moduli_at(np.zeros((1, 3 if kinematics == "3d" else 2)), kinematics)[0])

    def moduli_at(self, points: Array, kinematics: str, constants: Any = None) -> Array:
        """Return the moduli (n, 4, 4), in 3D (n, 6, 6) [pressure] at `points` (n, dim) [length]; see `moduli`.

        `constants` are those of `constants_at` there, if they vary.
        """
        compliance = self._compliance6(points, kinematics, constants)
        if kinematics == "3d":
            return np.asarray(np.linalg.inv(compliance))
        if kinematics != "plane_stress":
            return np.asarray(np.linalg.inv(compliance)[:, :4, :4])
        inner = np.ix_(range(len(compliance)), (0, 1, 3), (0, 1, 3))
        D = np.zeros((len(compliance), 4, 4))
        D[inner] = np.linalg.inv(compliance[inner])
        return D

    def compliance_at(self, points: Array, kinematics: str, constants: Any = None) -> Array:
        """Return the compliance (n, 4, 4), in 3D (n, 6, 6) [1 / pressure] at `points` (n, dim) [length].

        In the plane it includes zz, so that stress : compliance : stress is complete; stresses yz and xz are zero
        there.
        """
        size = 6 if kinematics == "3d" else 4
        return np.asarray(self._compliance6(points, kinematics, constants)[:, :size, :size])

    def expansion_at(self, points: Array, kinematics: str, constants: Any = None) -> Array:
        """Return the thermal strain (n, 4), in 3D (n, 6) [1 / temperature] per degree at `points` (n, dim) [length].

        NaN without expansion. ModelError if it has an out-of-plane shear that the kinematics exclude.
        """
        size = 6 if kinematics == "3d" else 4
        if self.expansion is None:
            return np.full((len(points), size), np.nan)
        expansion = (self if constants is None else constants).expansion
        along, tensor = self._along_axes(expansion, points, kinematics, constants)
        strain = np.stack([tensor[:, i, j] * (1.0 if i == j else 2.0) for i, j in PAIRS], axis=1)
        if np.abs(strain[:, size:]).max(initial=0.0) > ROUND_OFF * np.abs(along).max(initial=0.0):
            raise ModelError(
                f"the expansion of the material with {self.described} shears it out of the plane: turn one axis along z, or "
                "use a mesh in 3D"
            )
        return np.asarray(strain[:, :size])

    def conductivity_at(self, points: Array, kinematics: str, constants: Any) -> Array:
        """Return the conductivity (n, dim, dim) [power / (length temperature)] at `points` (n, dim) [length].

        `constants` are those of `constants_at` there. ModelError if inclined axes conduct heat out of the plane.
        """
        conductivity, dim = constants.conductivity, points.shape[1]
        if not isinstance(conductivity, tuple):
            return np.broadcast_to(conductivity, len(points))[:, None, None] * np.eye(dim)
        along, tensor = self._along_axes(conductivity, points, kinematics, constants)
        if np.abs(tensor[:, :dim, dim:]).max(initial=0.0) > ROUND_OFF * along.max(initial=0.0):
            raise ModelError(
                f"the conductivity of the material with {self.described} turns heat out of the plane: turn one axis along z, "
                "or use a mesh in 3D"
            )
        return np.asarray(tensor[:, :dim, :dim])

    def _along_axes(self, values: Any, points: Array, kinematics: str, constants: Any) -> tuple[Array, Array]:
        """Return constants (n, 3) along the material's axes, from one or three `values`, and the tensors (n, 3, 3)."""
        along, axes = np.empty((len(points), 3)), self._frames(points, kinematics, constants)
        for axis in range(3):
            along[:, axis] = values[axis] if isinstance(values, tuple) else values
        return along, np.einsum("nai,na,naj->nij", axes, along, axes)

    def _frames(self, points: Array, kinematics: str, constants: Any) -> Array:
        """Return the axes (n, 3, 3) at `points` (n, dim), those of cells from `constants` [-]."""
        axes = constants.axes if constants and varying(self.axes) else self.axes
        if varying(axes):
            raise ModelError("axes by cell need to know the cells: give the `constants_at` of the material of a model")
        return frames(axes, points, kinematics)

    def _compliance6(self, points: Array, kinematics: str, constants: Any) -> Array:
        """Return the compliance (n, 6, 6) in the mesh's axes; ModelError where plane kinematics are not possible."""
        check_known("kinematics", kinematics, KINEMATICS, ModelError)
        of_stress = rotations(self._frames(points, kinematics, constants))
        # Engineering strains transform by the inverse transpose of the matrix of stresses.
        back = np.linalg.inv(of_stress)
        local = self.local_compliance if constants is None or not self.graded else self.compliances(constants)
        compliance = np.asarray(back.transpose(0, 2, 1) @ local @ back)
        across = np.abs(compliance[:, :4, 4:]).max(initial=0.0)
        if kinematics != "3d" and across > ROUND_OFF * np.abs(compliance).max(initial=0.0):
            raise ModelError(
                f"the material with {self.described} couples strains in the plane with shear out of it, by its constants or "
                f"by its axes: {kinematics} has no such shear; turn one axis along z, or use a mesh in 3D"
            )
        if kinematics != "3d":
            compliance[:, :4, 4:] = compliance[:, 4:, :4] = 0.0
        return compliance


def _real(value: Any) -> float:
    """Return a real number, infinite if it is too large; NaN if it is not a number."""
    try:
        return float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    except OverflowError:
        return math.inf


def check_positive(name: str, value: Any, caption: str = "a positive number") -> None:
    """Raise ModelError if a constant of a material, `name` in the message, is not a positive number."""
    number = _real(value)
    if not 0.0 < number < math.inf:
        raise ModelError(f"{name} = {value!r} must be {caption}")
    if not 1.0 / LARGEST <= number <= LARGEST:
        raise ModelError(f"{name} is out of range: it must lie between {1.0 / LARGEST:g} and {LARGEST:g}, in any unit")


def check_expansion(value: Any, most: int) -> None:
    """Raise ModelError if an expansion is given and is neither a finite number nor `most` of them along the axes."""
    numbers = [value] if not isinstance(value, (Sequence, np.ndarray)) else list(value)
    fit = all(isinstance(v, Varying) or math.isfinite(_real(v)) for v in numbers)
    if value is not None and not (fit and len(numbers) in (1, most)):
        wanted = "a number" if most == 1 else "a number, or three along the material's axes"
        raise ModelError(f"the coefficient of thermal expansion = {value} must be {wanted}")


def check_conductivity(value: Any, most: int) -> None:
    """Raise ModelError if a conductivity is given and is neither a positive number nor `most` of them along the axes."""
    numbers = [value] if not isinstance(value, (Sequence, np.ndarray)) or isinstance(value, str) else list(value)
    if len(numbers) not in (1, most):
        raise ModelError(f"the conductivity = {value} must be a number{', or three along the axes' * (most > 1)}")
    for number in numbers:
        if not (number is None or isinstance(number, Varying)):
            check_positive("the conductivity", number)


# A number, a function of the position, or numbers for each cell or point; for type checkers, a number when read.
if TYPE_CHECKING:
    Constant = Any
else:
    Constant = Value | Array


@typed(ModelError)
@dataclass(frozen=True)
class LinearElastic(Material):
    """Isotropic linear elasticity.

    Parameters
    ----------
    E : float, callable or ndarray (n,)
        Young's modulus [pressure], positive: a number; a function from positions (n, dim) [length] to numbers (n,),
        such as `Tabulated`; or an array with a number for each solid cell of the groups of the material, for each
        solid cell of the mesh, in the order of ``mesh.solids``, or for each point of the mesh. A column (n, 1) always
        refers to cells.
    nu : float, callable or ndarray (n,)
        Poisson's ratio, -1 < nu < 0.5 [-]; like E.
    volumetric : str
        Treatment of the dilatation: ``"plain"`` uses the full dilatation; ``"mean_dilatation"`` projects it on its
        mean in each quadrangle, hexahedron, wedge and pyramid (in quadratic ones on a linear function), so that they
        do not lock if the material is nearly incompressible; ``"auto"`` selects the latter from nu = 0.49 on. It has
        no effect on linear triangles and tetrahedra and in plane stress.
    density : float, callable or ndarray (n,), optional
        Mass per volume [mass / length^3], for gravity, centrifugal loads and modes; zero or more; like E.
    expansion : float, callable or ndarray (n,), optional
        Coefficient of thermal expansion [1 / temperature]; like E.
    incompatible_modes : bool
        Whether linear quadrangles and hexahedra have incompatible modes, which avoid shear locking in bending and
        volumetric locking, in place of a mean dilatation. It has no effect on other elements and in axisymmetry.
        Assembly then costs three times and stress recovery ten times as much.
    conductivity : float, callable or ndarray (n,), optional
        Thermal conductivity [power / (length temperature)], positive; like E.

    Raises
    ------
    ModelError
        If a constant is outside its range.

    Examples
    --------
    >>> import fastcontact as fc
    >>> steel = fc.LinearElastic(E=210_000.0, nu=0.3, density=7.85e-9, expansion=12e-6)
    >>> steel.shear_modulus
    80769.23076923077
    >>> graded = fc.LinearElastic(E=lambda points: 1000.0 + 10.0 * points[:, 1], nu=0.3)
    """

    E: Constant
    nu: Constant
    volumetric: str = "auto"
    density: Constant | None = None
    expansion: Constant | None = None
    incompatible_modes: bool = False
    conductivity: Constant | None = None

    def __post_init__(self) -> None:
        for name in ("E", "nu", "density", "expansion", "conductivity"):
            object.__setattr__(self, name, wrapped(getattr(self, name)))
        if not isinstance(self.E, Varying):
            check_positive("Young's modulus E", self.E)
        if not isinstance(self.nu, Varying) and not -1.0 < _real(self.nu) < 0.5:
            raise ModelError(
                f"Poisson's ratio nu = {self.nu} must lie between -1 and 0.5, both excluded "
                "(for an incompressible material take nu = 0.4999, in quadrangles or hexahedra: they have a mean dilatation "
                "then and do not lock)"
            )
        check_known("volumetric", self.volumetric, VOLUMETRIC, ModelError)
        self.check_thermal_and_density(1)

    @property
    def described(self) -> str:
        """E and nu, for messages."""
        return f"E = {self.E:g}, nu = {self.nu:g}"

    @property
    def young(self) -> tuple[float, float]:
        """Smallest and largest Young's modulus, equal unless it varies [pressure]."""
        return self.E.range if isinstance(self.E, Varying) else (self.E, self.E)

    @property
    def contact_modulus(self) -> float:
        """E / (1 - nu^2) [pressure]; the smallest value if they vary."""
        if not self.graded:
            return self.E / (1 - self.nu**2)
        samples = [self.constants_at(*sample) for sample in self._cells().samples()]
        return float(min(np.min(c.E / (1 - c.nu**2)) for c in samples))

    @property
    def largest_nu(self) -> float:
        """Poisson's ratio [-]; if it varies, the largest, and zero before the material is assigned to cells."""
        if not isinstance(self.nu, Varying):
            return self.nu
        return 0.0 if self.nu.cells is None else self.nu.range[1]

    def compliances(self, constants: Any) -> Array:
        """Return compliances (n, 6, 6) [1 / pressure] of constants that may be arrays (n,)."""
        E, nu = np.broadcast_arrays(np.atleast_1d(constants.E), np.atleast_1d(constants.nu))
        S = np.zeros((len(E), 6, 6))
        S[:, range(3), range(3)] = ((1 + nu) / E)[:, None]
        S[:, range(3, 6), range(3, 6)] = (1 / (E / (2 * (1 + nu))))[:, None]
        S[:, :3, :3] -= (nu / E)[:, None, None]
        return S

    def admissible(self, constants: Any) -> Any:
        """Return where (n,) E is positive and nu between -1 and 0.5."""
        E, nu = np.asarray(constants.E), np.asarray(constants.nu)
        return (E >= 1.0 / LARGEST) & (E <= LARGEST) & (nu > -1.0) & (nu < 0.5)

    @property
    def averaged(self) -> bool:  # type: ignore[override]
        """Whether elements use a mean dilatation, if they support it and kinematics are not plane stress."""
        nearly = self.largest_nu >= NEARLY_INCOMPRESSIBLE
        return self.volumetric == "mean_dilatation" or (self.volumetric == "auto" and nearly)

    @property
    def shear_modulus(self) -> float:
        """Shear modulus [pressure]."""
        return self.E / (2 * (1 + self.nu))

    def moduli(self, kinematics: str) -> Array:
        """Return the matrix (4, 4), in 3D (6, 6) [pressure] from strains (xx, yy, zz, 2xy, in 3D 2yz, 2xz) to stresses.

        Plane stress has no stress zz (Timoshenko and Goodier, 1970, section 16).
        """
        if self.graded:
            raise ModelError(
                "constants of the material depend on the position: ask for moduli_at(points, kinematics, ...)"
            )
        return np.asarray(isotropic_moduli(np.array([self.E], float), np.array([self.nu], float), kinematics)[0])

    def moduli_at(self, points: Array, kinematics: str, constants: Any = None) -> Array:
        """Return the moduli (n, 4, 4), in 3D (n, 6, 6) [pressure] at `points` (n, dim) [length]; see `Material.moduli_at`."""
        source = self if constants is None else constants
        E, nu = (np.broadcast_to(np.asarray(value, float), len(points)) for value in (source.E, source.nu))
        return isotropic_moduli(E, nu, kinematics)


def isotropic_moduli(E: Array, nu: Array, kinematics: str) -> Array:
    """Return the moduli (n, 4, 4), in 3D (n, 6, 6) [pressure] of isotropic materials; see `LinearElastic.moduli`.

    Of Young's moduli `E` (n,) [pressure] and Poisson's ratios `nu` (n,) [-].
    """
    check_known("kinematics", kinematics, KINEMATICS, ModelError)
    G = E / (2 * (1 + nu))
    if kinematics == "plane_stress":
        D, normal = np.zeros((len(E), 4, 4)), E / (1 - nu * nu)
        D[:, 0, 0] = D[:, 1, 1] = normal
        D[:, 0, 1] = D[:, 1, 0] = normal * nu
        D[:, 3, 3] = G
        return D
    size = 6 if kinematics == "3d" else 4
    D = np.zeros((len(E), size, size))
    D[:, :3, :3] = (E * nu / ((1 + nu) * (1 - 2 * nu)))[:, None, None]
    D[:, range(3), range(3)] += 2 * G[:, None]
    D[:, range(3, size), range(3, size)] = G[:, None]
    return D
