"""Linear elastic materials: the base class of all materials, and isotropic elasticity."""

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
from fastcontact.elasticity.material_axes import TENSOR_INDICES, Axes, frames, rotations
from fastcontact.elasticity.varying_constants import Cells, Varying, map_constants, varying_items, wrap_varying
from fastcontact.errors import ModelError, check_known
from fastcontact.round_off import ROUND_OFF

AnyMaterial = TypeVar("AnyMaterial", bound="Material")

KINEMATICS = ("axisymmetric", "plane_strain", "plane_stress", "3d")
# Treatments of the dilatation.
VOLUMETRIC = ("auto", "plain", "mean_dilatation")
# Poisson's ratio above which a material has a mean dilatation by default.
NEARLY_INCOMPRESSIBLE = 0.49
# Names of the constants that determine the moduli, and of all constants that may vary with position.
MODULI = ("E", "nu", "G")
CONSTANTS = (*MODULI, "density", "expansion", "conductivity")


@typed(ModelError)
class Material:
    """Base class of materials, with linear elastic moduli in material axes, density and thermal properties.

    Attributes
    ----------
    density : float, Varying or None
        Mass per unit volume [mass / length^3].
    expansion : float, Varying, tuple or None
        Coefficient of thermal expansion, or one coefficient along each axis [1 / temperature].
    conductivity : float, Varying, tuple or None
        Thermal conductivity, or one conductivity along each axis [power / (length temperature)].
    axes : sequence, callable or None
        Material axes as unit vectors in rows (3, 3) [-], or as a function of position, see `Orthotropic`. None means the axes
        of the mesh.
    averaged : bool
        Whether elements that support a mean dilatation use it, except in plane stress.
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
        """The smallest and the largest Young's modulus along the material axes [pressure]."""
        E = 1.0 / np.diagonal(self._all_compliances(), axis1=1, axis2=2)[:, :3]
        return float(E.min()), float(E.max())

    @property
    def contact_modulus(self) -> float:
        """Smallest plane-strain modulus along the axes, a measure of the contact stiffness [pressure]."""
        D = np.moveaxis(np.linalg.inv(self._all_compliances()), 0, -1)
        pairs = (0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)
        return float(np.min([D[i, i] - D[i, j] * D[j, i] / D[j, j] for i, j in pairs]))

    def _all_compliances(self) -> Array:
        """Return the compliances (n, 6, 6) [1 / pressure] in material axes; varying ones at the points `Cells.samples`."""
        if not self.graded:
            return self.local_compliance[None]
        return np.concatenate([self.compliances(self.constants_at(*sample)) for sample in self._cells().samples()])

    @property
    def local_compliance(self) -> Array:
        """Compliance matrix (6, 6) [1 / pressure] in material axes, which maps stresses 11, 22, 33, 12, 23, 13 to strains.

        The shear components of the strain are engineering shear strains, which are twice those of the tensor.
        """
        return np.asarray(self.compliances(self)[0])

    @property
    def described(self) -> str:
        """Text with the constants of the material, for messages."""
        raise NotImplementedError

    @property
    def varies(self) -> bool:
        """Whether material axes, moduli or thermal expansion depend on position."""
        return callable(self.axes) or self.graded or bool(varying_items(self.expansion) or varying_items(self.axes))

    @property
    def graded(self) -> bool:
        """Whether constants that determine the moduli depend on position."""
        return any(varying_items(getattr(self, name, None)) for name in MODULI)

    @property
    def varies_inside(self) -> bool:
        """Whether material axes, moduli or thermal expansion vary within cells, as functions and nodal values do.

        Cells with a mean dilatation use the constants at their centres instead.
        """
        varying = [v for name in (*MODULI, "expansion") for v in varying_items(getattr(self, name, None))]
        return (callable(self.axes) or any(v.varies_within_cells for v in varying)) and not self.averaged

    def check_thermal_and_density(self, n_axes: int) -> None:
        """Raise ModelError if the density is negative or a thermal constant is inadmissible.

        For thermal constants, see `check_expansion` and `check_conductivity`. A material may have one constant of each kind,
        or `n_axes`, which is 3 for materials with axes and 1 otherwise. Constants that vary are checked by `bound`.
        """
        density = self.density
        if not isinstance(density, Varying) and density is not None and not 0.0 <= _real(density) < math.inf:
            raise ModelError(f"the density = {density} must be a non-negative number")
        check_expansion(self.expansion, n_axes)
        check_conductivity(self.conductivity, n_axes)

    def bound(self: AnyMaterial, cells: Cells) -> AnyMaterial:
        """Return a copy of the material whose varying constants are assigned to `cells`, so that they can be evaluated.

        Raises ModelError if a varying constant is not admissible somewhere in these cells.
        """
        names = [name for name in (*CONSTANTS, "axes") if varying_items(getattr(self, name, None))]
        if not names:
            return self

        def with_cells(name: str) -> Any:
            constant, label = getattr(self, name), f"the constant {name} of the material"
            return map_constants(constant, lambda v: type(v)(v.source, cells, label) if isinstance(v, Varying) else v)

        bound_material = copy.copy(self)
        for name in names:
            object.__setattr__(bound_material, name, with_cells(name))
        for sample in cells.samples():
            bound_material._check_at([name for name in names if name != "axes"], *sample)
        return bound_material

    def constants_at(self, name: str, rows: Indices, N: Array) -> SimpleNamespace:
        """Return the constants at n points in each of the given cells of an element type, as attributes.

        Varying constants are arrays (n_rows * n,) [unit of the constant], and the others are numbers. `name` is the element
        type, `rows` (n_rows,) of int contains the numbers of the cells, and `N` (n, n_nodes) [-] the shape functions at the
        points.
        """

        def at(value: Any) -> Any:
            return map_constants(value, lambda v: v.at(name, rows, N) if isinstance(v, Varying) else v)

        return SimpleNamespace(**{key: at(getattr(self, key, None)) for key in (*CONSTANTS, "axes")})

    def compliances(self, constants: Any) -> Array:
        """Return the compliances (n, 6, 6) [1 / pressure] in material axes; the constants may be arrays (n,)."""
        raise NotImplementedError

    def admissible(self, constants: Any) -> Any:
        """Return, for each set of constants (n,), whether moduli are in range and the elastic energy is positive definite."""
        raise NotImplementedError

    def _cells(self) -> Cells:
        """Return the cells of the material; raise ModelError if the material has not been assigned to cells."""
        varying = [v for name in CONSTANTS for v in varying_items(getattr(self, name, None))]
        if not varying or varying[0].cells is None:
            raise ModelError("constants of the material depend on the position: add the material to a model first")
        return varying[0].cells

    def _check_at(self, names: Sequence[str], element: str, rows: Indices, N: Array) -> None:
        """Raise ModelError, with the position, if constants are inadmissible in a cell; `names` are the varying constants."""
        constants, count = self.constants_at(element, rows, N), len(rows) * len(N)
        wrong = np.array(np.broadcast_to(~np.asarray(self.admissible(constants), bool), count))
        if constants.density is not None:
            wrong |= np.asarray(constants.density) < 0.0
        for k in constants.conductivity if isinstance(constants.conductivity, tuple) else (constants.conductivity,):
            wrong |= k is not None and ~(np.asarray(k, float) > 0.0)
        if not wrong.any():
            return
        point = int(wrong.argmax())
        values = {
            name: map_constants(getattr(constants, name), lambda v: float(np.broadcast_to(np.asarray(v), count)[point]))
            for name in names
        }
        mesh, cell = self._cells().mesh, int(rows[point // len(N)])
        where = f"in cell {cell} of {element} near {mesh.points[mesh.cells[element][cell]].mean(axis=0)}"
        try:
            dataclasses.replace(self, **values)  # type: ignore[type-var] # raises the error for these values
        except ModelError as error:
            raise ModelError(f"{where}: {error}") from None

    def moduli(self, kinematics: str) -> Array:
        """Return the matrix (4, 4), in 3D (6, 6) [pressure] that maps strains (xx, yy, zz, 2xy, in 3D 2yz, 2xz) to stresses.

        In axisymmetry, x, y and z denote the radial, axial and circumferential directions. In plane stress, the rows and
        columns of zz are zero (Timoshenko and Goodier, 1970, section 16). Raises ModelError if material axes or moduli depend
        on position.
        """
        if callable(self.axes) or varying_items(self.axes) or self.graded:
            raise ModelError(
                "axes or constants of the material depend on the position: call moduli_at(points, kinematics, constants)"
            )
        return np.asarray(self.moduli_at(np.zeros((1, 3 if kinematics == "3d" else 2)), kinematics)[0])

    def moduli_at(self, points: Array, kinematics: str, constants: Any = None) -> Array:
        """Return the moduli (n, 4, 4), in 3D (n, 6, 6) [pressure] at `points` (n, dim) [length]; see `moduli`.

        If constants vary, `constants` must be the result of `constants_at` for these points.
        """
        compliance = self._mesh_compliance(points, kinematics, constants)
        if kinematics == "3d":
            return np.asarray(np.linalg.inv(compliance))
        if kinematics != "plane_stress":
            return np.asarray(np.linalg.inv(compliance)[:, :4, :4])
        in_plane = np.ix_(range(len(compliance)), (0, 1, 3), (0, 1, 3))
        D = np.zeros((len(compliance), 4, 4))
        D[in_plane] = np.linalg.inv(compliance[in_plane])
        return D

    def compliance_at(self, points: Array, kinematics: str, constants: Any = None) -> Array:
        """Return the compliance (n, 4, 4), in 3D (n, 6, 6) [1 / pressure] at `points` (n, dim) [length].

        In 2D, it includes the component zz, whereas the stresses yz and xz are zero. Therefore, stress : compliance : stress
        is twice the density of the elastic energy.
        """
        size = 6 if kinematics == "3d" else 4
        return np.asarray(self._mesh_compliance(points, kinematics, constants)[:, :size, :size])

    def expansion_at(self, points: Array, kinematics: str, constants: Any = None) -> Array:
        """Return the strain (n, 4), in 3D (n, 6) [1 / temperature] per unit temperature rise at `points` (n, dim) [length].

        The strain is NaN without a coefficient of thermal expansion. Raises ModelError if it has an out-of-plane shear
        component, which plane kinematics exclude.
        """
        size = 6 if kinematics == "3d" else 4
        if self.expansion is None:
            return np.full((len(points), size), np.nan)
        expansion = (self if constants is None else constants).expansion
        components, tensor = self._along_axes(expansion, points, kinematics, constants)
        strain = np.stack([tensor[:, i, j] * (1.0 if i == j else 2.0) for i, j in TENSOR_INDICES], axis=1)
        if np.abs(strain[:, size:]).max(initial=0.0) > ROUND_OFF * np.abs(components).max(initial=0.0):
            raise ModelError(
                f"the expansion of the material with {self.described} causes out-of-plane shear: align one axis with z, "
                "or use a 3D mesh"
            )
        return np.asarray(strain[:, :size])

    def conductivity_at(self, points: Array, kinematics: str, constants: Any) -> Array:
        """Return the conductivity (n, dim, dim) [power / (length temperature)] at `points` (n, dim) [length].

        `constants` is the result of `constants_at` for these points. Raises ModelError if, due to inclined material axes, an
        in-plane temperature gradient causes an out-of-plane heat flux.
        """
        conductivity, dim = constants.conductivity, points.shape[1]
        if not isinstance(conductivity, tuple):
            return np.broadcast_to(conductivity, len(points))[:, None, None] * np.eye(dim)
        components, tensor = self._along_axes(conductivity, points, kinematics, constants)
        if np.abs(tensor[:, :dim, dim:]).max(initial=0.0) > ROUND_OFF * components.max(initial=0.0):
            raise ModelError(
                f"the conductivity of the material with {self.described} causes an out-of-plane heat flux: align one "
                "axis with z, or use a 3D mesh"
            )
        return np.asarray(tensor[:, :dim, :dim])

    def _along_axes(self, values: Any, points: Array, kinematics: str, constants: Any) -> tuple[Array, Array]:
        """Return `values`, one constant or three, as components (n, 3) along the material axes and as tensors (n, 3, 3).

        Both have the unit of `values`. The tensors refer to the axes of the mesh.
        """
        components, axes = np.empty((len(points), 3)), self._frames(points, kinematics, constants)
        for axis in range(3):
            components[:, axis] = values[axis] if isinstance(values, tuple) else values
        return components, np.einsum("nai,na,naj->nij", axes, components, axes)

    def _frames(self, points: Array, kinematics: str, constants: Any) -> Array:
        """Return the material axes (n, 3, 3) [-] at `points` (n, dim) [length]; `constants` contains axes given by cell."""
        axes = constants.axes if constants and varying_items(self.axes) else self.axes
        if varying_items(axes):
            raise ModelError("axes given by cell need `constants`: pass `constants_at` of a model's material")
        return frames(axes, points, kinematics)

    def _mesh_compliance(self, points: Array, kinematics: str, constants: Any) -> Array:
        """Return the compliance (n, 6, 6) [1 / pressure] at `points` (n, dim) [length] in the axes of the mesh.

        Raises ModelError if the material couples in-plane stresses with out-of-plane shear, which plane kinematics exclude.
        """
        check_known("kinematics", kinematics, KINEMATICS, ModelError)
        stress_rotation = rotations(self._frames(points, kinematics, constants))
        # Engineering strains transform by the inverse transpose of the matrix that transforms stresses.
        inverse = np.linalg.inv(stress_rotation)
        local = self.local_compliance if constants is None or not self.graded else self.compliances(constants)
        compliance = np.asarray(inverse.transpose(0, 2, 1) @ local @ inverse)
        coupling = np.abs(compliance[:, :4, 4:]).max(initial=0.0)
        if kinematics != "3d" and coupling > ROUND_OFF * np.abs(compliance).max(initial=0.0):
            raise ModelError(
                f"the material with {self.described} couples in-plane strains with out-of-plane shear, which {kinematics} "
                "excludes: align one axis with z, or use a 3D mesh"
            )
        if kinematics != "3d":
            compliance[:, :4, 4:] = compliance[:, 4:, :4] = 0.0
        return compliance


def _real(value: Any) -> float:
    """Return `value` as a float; infinity if it is too large for a float, and NaN if it is not a real number."""
    try:
        return float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    except OverflowError:
        return math.inf


def check_positive(name: str, value: Any) -> None:
    """Raise ModelError, with the `name` of the value, unless it is a number from 1 / LARGEST to LARGEST."""
    number = _real(value)
    if not 0.0 < number < math.inf:
        raise ModelError(f"{name} = {value!r} must be a positive number")
    if not 1.0 / LARGEST <= number <= LARGEST:
        limits = f"{1.0 / LARGEST:g} and {LARGEST:g}"
        raise ModelError(f"{name} is out of range: it must lie between {limits}, whatever its unit")


def check_expansion(value: Any, n_axes: int) -> None:
    """Raise ModelError if a coefficient of expansion is given and is neither a finite number nor `n_axes` finite numbers."""
    numbers = [value] if not isinstance(value, (Sequence, np.ndarray)) else list(value)
    valid = all(isinstance(v, Varying) or math.isfinite(_real(v)) for v in numbers)
    if value is not None and not (valid and len(numbers) in (1, n_axes)):
        required = "a number" if n_axes == 1 else "a number, or three along the material's axes"
        raise ModelError(f"the coefficient of thermal expansion = {value} must be {required}")


def check_conductivity(value: Any, n_axes: int) -> None:
    """Raise ModelError if a conductivity is given and is neither a positive number nor `n_axes` positive numbers."""
    numbers = [value] if not isinstance(value, (Sequence, np.ndarray)) or isinstance(value, str) else list(value)
    if len(numbers) not in (1, n_axes):
        raise ModelError(f"the conductivity = {value} must be a number{', or three along the axes' * (n_axes > 1)}")
    for number in numbers:
        if not (number is None or isinstance(number, Varying)):
            check_positive("the conductivity", number)


# A number, a function of position, or numbers for all cells or points. For type checkers, it is Any, because callers use the
# attributes of materials with constant properties as numbers.
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
        Young's modulus, greater than 0 [pressure]: a number, a function from positions (n, dim) [length] to numbers (n,),
        such as `Tabulated`, or an array. An array has one number for each solid cell of the groups of the material, for
        each solid cell of the mesh in the order of ``mesh.solids``, or for each point of the mesh. An array (n, 1)
        always belongs to cells, even if the mesh has n points.
    nu : float, callable or ndarray (n,)
        Poisson's ratio, -1 < nu < 0.5 [-], in one of the forms of E.
    volumetric : {"auto", "plain", "mean_dilatation"}
        Treatment of the dilatation. ``"plain"`` does not modify it. ``"mean_dilatation"`` projects it
        onto constants in linear cells and onto linear functions in quadratic cells, so that nearly incompressible materials
        do not lock. In quadratic triangles, tetrahedra, wedges and pyramids, only the mean has the full bulk modulus, and the
        remainder has at most the bulk modulus for nu = 0.3. ``"auto"`` selects the mean dilatation for nu >= 0.49. The
        treatment has no effect on linear triangles and tetrahedra, and none in plane stress.
    density : float, callable or ndarray (n,), optional
        Mass per unit volume, at least 0, in one of the forms of E [mass / length^3]. Gravity, centrifugal loads and
        vibration modes need it.
    expansion : float, callable or ndarray (n,), optional
        Coefficient of thermal expansion, in one of the forms of E [1 / temperature].
    incompatible_modes : bool
        Whether linear quadrangles and hexahedra have incompatible modes instead of a mean dilatation. The modes
        avoid shear locking in bending as well as volumetric locking, at four to six times the cost of assembly and 20 to 30
        times the cost of stress recovery. The option has no effect on other elements and in axisymmetry.
    conductivity : float, callable or ndarray (n,), optional
        Thermal conductivity, greater than 0, in one of the forms of E [power / (length temperature)].

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
            object.__setattr__(self, name, wrap_varying(getattr(self, name)))
        if not isinstance(self.E, Varying):
            check_positive("Young's modulus E", self.E)
        if not isinstance(self.nu, Varying) and not -1.0 < _real(self.nu) < 0.5:
            raise ModelError(
                f"Poisson's ratio nu = {self.nu} must be greater than -1 and less than 0.5 "
                "(for an incompressible material use nu = 0.4999 with quadrangles or hexahedra, whose mean dilatation avoids "
                "locking)"
            )
        check_known("volumetric", self.volumetric, VOLUMETRIC, ModelError)
        self.check_thermal_and_density(1)

    @property
    def described(self) -> str:
        """Text with E and nu, for messages."""
        return f"E = {self.E:g}, nu = {self.nu:g}"

    @property
    def largest_nu(self) -> float:
        """Largest Poisson's ratio [-]; zero if it varies and the material has not been assigned to cells."""
        if not isinstance(self.nu, Varying):
            return self.nu
        return 0.0 if self.nu.cells is None else self.nu.range[1]

    def compliances(self, constants: Any) -> Array:
        """Return the compliances (n, 6, 6) [1 / pressure]; the constants may be arrays (n,)."""
        E, nu = np.broadcast_arrays(np.atleast_1d(constants.E), np.atleast_1d(constants.nu))
        S = np.zeros((len(E), 6, 6))
        S[:, range(3), range(3)] = ((1 + nu) / E)[:, None]
        S[:, range(3, 6), range(3, 6)] = (1 / (E / (2 * (1 + nu))))[:, None]
        S[:, :3, :3] -= (nu / E)[:, None, None]
        return S

    def admissible(self, constants: Any) -> Any:
        """Return whether E is in range and nu lies between -1 and 0.5, for each set of constants (n,)."""
        E, nu = np.asarray(constants.E), np.asarray(constants.nu)
        return (E >= 1.0 / LARGEST) & (E <= LARGEST) & (nu > -1.0) & (nu < 0.5)

    @property
    def averaged(self) -> bool:  # type: ignore[override]
        """Whether elements that support a mean dilatation use it, except in plane stress."""
        nearly_incompressible = self.largest_nu >= NEARLY_INCOMPRESSIBLE
        return self.volumetric == "mean_dilatation" or (self.volumetric == "auto" and nearly_incompressible)

    @property
    def shear_modulus(self) -> float:
        """Shear modulus [pressure]."""
        return self.E / (2 * (1 + self.nu))

    def moduli_at(self, points: Array, kinematics: str, constants: Any = None) -> Array:
        """Return the moduli (n, 4, 4), in 3D (n, 6, 6) [pressure] at `points` (n, dim) [length]; see `Material.moduli_at`."""
        source = self if constants is None else constants
        E, nu = (np.broadcast_to(np.asarray(value, float), len(points)) for value in (source.E, source.nu))
        return isotropic_moduli(E, nu, kinematics)


def isotropic_moduli(E: Array, nu: Array, kinematics: str) -> Array:
    """Return the moduli (n, 4, 4), in 3D (n, 6, 6) [pressure] of isotropic materials; see `LinearElastic.moduli`.

    The materials have the Young's moduli `E` (n,) [pressure] and Poisson's ratios `nu` (n,) [-].
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
