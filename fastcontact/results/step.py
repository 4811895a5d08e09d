"""Results of load steps, and sequences of steps."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, SupportsIndex, overload

import numpy as np

from fastcontact._tools.html_table import html_table
from fastcontact.arrays import Array, Mask, Numbers
from fastcontact.elasticity import recovery
from fastcontact.elasticity.material_sides import MaterialSides
from fastcontact.errors import FastcontactError, ModelError, NameSuggestions, unknown
from fastcontact.results.units import value_text, with_unit
from fastcontact.round_off import LENGTH_ROUND_OFF


@dataclass(frozen=True, eq=False)
class MaterialStress:
    """Stress of each material at the nodes where materials meet.

    Attributes
    ----------
    cells : ndarray of int (n_solids,)
        Material number of each solid cell, in the order of ``mesh.solids``. Materials are numbered from 0 in the order
        in which they were added to the model; equal materials have the number of the first.
    points : ndarray of int (k,)
        Node of each row, in ascending order. A node where materials meet has a row for each material.
    material : ndarray of int (k,)
        Material number of each row.
    stress : ndarray (k, 4) or (k, 6)
        Mean stress of the cells with the material at the node [pressure]. The components are those of
        `StepResult.stress`.
    """

    cells: Numbers
    points: Numbers
    material: Numbers
    stress: Array

    def at(self, point: int) -> dict[int, Array]:
        """Return the stress (4,) or (6,) of each material at a node [pressure].

        Parameters
        ----------
        point : int
            Number of the node.

        Returns
        -------
        dict of int to ndarray
            Stress by material number; empty if the node has one material only.
        """
        return {int(self.material[row]): self.stress[row] for row in np.flatnonzero(self.points == point)}


def nodal_stress_of_materials(
    sides: MaterialSides, cells: Numbers, separated: Array, n_points: int
) -> tuple[Array, MaterialStress]:
    """Return the nodal stress (n_points, n_components) [pressure] and the stress of each material at interfaces.

    At a node on an interface, the nodal stress is that of the material with the largest von Mises stress.

    Parameters
    ----------
    sides : MaterialSides
        Nodes at material interfaces.
    cells : ndarray of int (n_solids,)
        Material number of each solid cell.
    separated : ndarray (m, n_components)
        Stress at the m points of the mesh that is cut along interfaces, see `MaterialSides` [pressure].
    n_points : int
        Number of points of the mesh.

    Returns
    -------
    stress : ndarray (n_points, n_components)
        Nodal stress [pressure].
    material_stress : MaterialStress
        Stress of each material at interfaces.
    """
    stress, values = separated[:n_points].copy(), separated[sides.slot]
    # The last row of each node has the largest von Mises stress.
    order = np.lexsort((recovery.von_mises(values), sides.points))
    stress[sides.points[order]] = values[order]
    return stress, MaterialStress(cells, sides.points, sides.material, values)


# Smallest number of elements across the radius of a contact that resolves its pressure.
MIN_ELEMENTS_ACROSS_RADIUS = 4


def coarse_contact_text(name: str, count: int) -> str:
    """Return the statement that a contact has only `count` elements across its radius."""
    return f"contact '{name}' has only {count} {'elements' if count > 1 else 'element'} across its radius"


def coarse_contact_notes(iterations: Mapping[str, Any]) -> list[str]:
    """Return the warnings about contacts with too few elements across their radius, which apply to a single step.

    `iterations` is `StepResult.iterations`.
    """
    needed = f"its pressure needs {MIN_ELEMENTS_ACROSS_RADIUS} or more"
    coarse = iterations.get("coarse_contacts", {})
    return [f"{coarse_contact_text(name, count)} in this step: {needed}" for name, count in coarse.items()]


def warnings_of_run(warnings: Iterable[str], iterations: Mapping[str, Any]) -> list[str]:
    """Return the `warnings` of a step that do not apply to this step only; `iterations` are those of the step."""
    notes = coarse_contact_notes(iterations)
    return [text for text in warnings if text not in notes]


# Fractions of the sum of the normal forces below which the resultant of a contact is negligible, and below which the sum is
# printed with it. The resultant is 0.90 of the sum on a quarter of a press fit.
NEGLIGIBLE, INCLINED = 1e-3, 0.95


def force_text(
    force: Sequence[float], parts: Sequence[float], normal_force: float, units: Mapping[str, str], fluid: float = 0.0
) -> str:
    """Return the magnitude of a contact force as text, with further values in parentheses.

    `parts` are `ContactResult.force_parts` [force]. With friction the further values are the normal and the tangential part.
    Without friction they are the components of the vector `force` (dim,) [force], unless it is parallel to an axis: in a half
    model, one of them is the component normal to the plane of symmetry, which the other half balances. If the nodal normal
    forces partly balance each other, their sum `normal_force` [force] is appended, and if they balance completely it is the
    only one of these values. The magnitude of the force of a `fluid` [force], which `force` includes and the parts do not, is
    appended, too.
    """
    values = (*parts, normal_force, fluid)
    total, normal, tangential, normal_sum, of_fluid = (value_text(value, units, "force", 6) for value in values)
    if fluid:
        return f"{force_text(force, parts, normal_force, units)}, of which the fluid {of_fluid}"
    suffix = f", sum of normal forces {normal_sum}" if min(parts[:2]) < INCLINED * normal_force else ""
    if parts[0] < NEGLIGIBLE * normal_force:
        return total + suffix
    if parts[2] > LENGTH_ROUND_OFF * parts[0]:
        return f"{total} (normal {normal}, tangential {tangential}){suffix}"
    along_an_axis = f"{max(map(abs, force)):.6g}" == f"{parts[0]:.6g}"
    components = ", ".join(f"{axis} {part:.6g}" for axis, part in zip("xyz", force, strict=False))
    return f"{total}{'' if along_an_axis else f' ({components})'}{suffix}"


def half_width(place: Array, closed: Mask, across: Array | None = None) -> tuple[float, float]:
    """Return a lower and an upper bound of the half-width of a contact [length]; (NaN, NaN) if no node is closed.

    The lower bound is half the distance between the two outermost closed nodes, and the upper bound half the distance between
    the next nodes beyond them, or infinite if there are no such nodes. If all nodes lie on one side of the middle, the
    contact is assumed to be symmetric. `place` (n,) contains the positions of the nodes relative to the middle [length], with
    a sign if nodes lie on both sides, and `closed` (n,) is the mask of closed nodes. Distances are differences of the
    coordinate `across` (n,) [length], which is `place` by default.
    """
    if not closed.any():
        return float("nan"), float("nan")
    across, one_sided = place if across is None else across, bool(place.min() >= 0.0)
    beyond = place == place[place > place[closed].max()].min(initial=np.inf)
    if not one_sided:  # the contact has a second end
        beyond |= place == place[place < place[closed].min()].max(initial=-np.inf)

    def half(nodes: Mask) -> float:
        return float(np.abs(across[nodes]).max() if one_sided else 0.5 * np.ptp(across[nodes]))

    return half(closed), half(closed | beyond) if beyond.any() else float("inf")


@dataclass(frozen=True, eq=False, repr=False)
class ContactResult(NameSuggestions):
    """State of one contact pair at the end of a load step.

    Arrays of length m belong to the m nodes of the secondary side, which are ordered along the surface.

    Attributes
    ----------
    name, formulation : str
        Name of the pair and of its formulation.
    points : ndarray of int (m,)
        Point numbers of the secondary nodes.
    coordinates : ndarray (m, dim)
        Reference coordinates of the secondary nodes [length].
    abscissa : ndarray (m,)
        Arc length along the reference surface from its first node. In 3D the distance from the axis of first contact
        [length]; this axis is the line along the normal through the node with the smallest gap in the reference
        configuration or, of several such nodes, the one nearest to the origin.
    gap : ndarray (m,)
        Gap function, which includes the clearance: positive at open nodes, about zero at closed nodes, and negative where a
        penalty admits penetration. Only `node_to_segment` contact closes the gaps of nodes exactly. The other formulations
        close weighted means of the gap or the gaps at integration points. If facets on curved surfaces do not match, the
        gap at a closed node differs from zero, or with a penalty from minus the ratio of pressure and penalty, by up to
        about twice the sagitta of a facet, which is proportional to the square of the facet length. The gap is infinite at
        nodes without an opposite point, for example at the edge of a hole or where the secondary side extends beyond the
        primary side, even if the facets around them carry pressure: use ``gap[np.isfinite(gap)].max()`` instead of
        ``gap.max()`` [length].
    pressure : ndarray (m,)
        Contact pressure per unit reference area, positive in compression; it is negative only in tied or bilateral contact
        under tension. Its interpolation by the shape functions of the facets integrates to the sum of the normal forces.
        In finite strain `pressure`, `multiplier` and `shear` are per unit deformed area, with unit thickness in plane
        stress [pressure].
    multiplier : ndarray (m,)
        Nodal pressure as computed by the formulation, before the pressure of open nodes and of nodes in tension is
        redistributed to the closed nodes [pressure].
    force_vectors : ndarray (m, dim)
        Contact force on each secondary node, in axisymmetry integrated over the full circle. It includes the force of a
        fluid, `fluid_force_vectors` [force].
    normal : ndarray (m, dim)
        Unit outward normal of the opposite primary facet [-].
    active : ndarray of bool (m,)
        Whether the constraint of each node is closed.
    force : ndarray (dim,)
        Resultant contact force on the secondary side, including that of a fluid [force].
    radius : (float, float)
        Lower and upper bound of the contact radius, in 2D of the half-width along the `tangent` [length]; NaN without
        contact. They are the distances from the `middle` to the outermost closed node and to the first open node beyond it,
        in finite strain in the deformed configuration. With `continuous` contact, integration points take the place of
        nodes. In 3D, pairs of a closed and an open node with a common facet are considered; the lower bound is the smallest
        distance of their closed nodes and the upper bound the largest distance of their open nodes, so that all semi-axes of
        an elliptic contact lie between the bounds. If the contact is a ring around an open middle, the bounds refer to its
        outer edge. The upper bound is infinite if the side is closed up to its edge.
    shear : ndarray (m, dim)
        Tangential traction on the secondary side, zero in frictionless contact [pressure].
    sticking : ndarray of bool (m,)
        Whether each node is closed and does not slide in this step; without friction all closed nodes stick.
    stick_bounds : (float, float), optional
        The property `stick_radius` in 3D, where it depends on the facets [length]; None in 2D and in files of earlier
        versions.
    dissipation : float
        Frictional work of this step [energy].
    obstacle_displacement : ndarray (dim,), optional
        Displacement of a rigid obstacle [length]; None for contact between bodies.
    obstacle_angle : float, optional
        Rotation of a rigid obstacle [radian]; None unless it rotates.
    torque : float, optional
        Torque about the axis of rotation that holds a rotating rigid obstacle in equilibrium. It is equal to the moment of
        the contact forces on the deformable body in the deformed configuration [force times length]; None unless the
        obstacle rotates.
    displacement : ndarray (m, dim), optional
        Displacement of the secondary nodes in finite strain, where the contact forces act on the deformed body [length].
    middle : ndarray (dim,)
        Centre of the contact on the reference surface [length]. In axisymmetry it lies on the axis, unless the surface is
        parallel to it or closes on itself, like that of an O-ring. In all other cases it is the centre of pressure, moved
        onto the planes of symmetry that the contact reaches. A plane of symmetry is assumed where supports
        prescribe zero displacement at an end of the surface beyond which the other body does not extend.
    place : ndarray (m,)
        Position of each node relative to the `middle` [length]: the radius in axisymmetry; the signed arc length in 2D, and
        where an axisymmetric surface is parallel to the axis or closes on itself; in 3D the distance from the line through
        the middle along the mean normal.
    tangent : ndarray (dim,), optional
        Direction along which half-widths are measured in 2D [-]. It is None in axisymmetry, in 3D, and on a ring in contact
        along its entire circumference or across the ends of a period, where `place` is used instead.
    direction : ndarray (dim,), optional
        Mean normal of the contact in 3D, without its components normal to the planes of symmetry that the contact reaches
        [-]. It is None in 2D, without a mean normal, and in files of earlier versions.
    wear : ndarray (m,), optional
        Accumulated wear depth at the end of the step, with the option ``wear`` [length].
    heat_flux : ndarray (m,), optional
        Heat flux from the secondary to the primary side per unit reference area, with the option ``conductance``
        [power / area].
    damage : ndarray (m,), optional
        Damage of the cohesive layer, from 0 (intact) to 1 (broken), with the option ``cohesion`` [-].
    fluid_pressure : ndarray (m,), optional
        Pressure of the fluid at the nodes that it has reached, with `Model.add_fluid_pressure` [pressure].
    fluid_force_vectors : ndarray (m, dim), optional
        Part of `force_vectors` due to the fluid; None without fluid, and in files of earlier versions [force].
    sliding_load : ndarray (m,), optional
        Integral of the pressure over the slip in this step, in pairs with friction [pressure * length].
    slip, slip_total : ndarray (m, dim)
        Tangential displacement of closed nodes relative to the opposite side, in this step and accumulated over all steps
        [length]. Where friction is solved in increments, slip is measured from the instant at which a node closes. At open
        and at sticking nodes `slip` is zero. Both arrays are NaN if the result file was written by a version that did not
        store them.
    primary_points : ndarray of int (k,)
        Point numbers of the nodes of the primary side; empty for a rigid obstacle.
    primary_force_vectors : ndarray (k, dim)
        Contact force on each primary node, in axisymmetry integrated over the full circle [force]. The force on a node
        that belongs to both sides is included here and not in `force_vectors`.
    units : mapping of str to str
        Names of the units of ``length``, ``force`` and ``pressure``, which reprs, plots and tables show; empty if the model
        does not name its units. In plane models the name of the unit of force is per thickness.

    Examples
    --------
    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    >>> model.fix("LEFT", "x")
    >>> model.add_obstacle("floor", secondary="BOTTOM", obstacle=fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0)))
    >>> model.add_pressure("TOP", 2.0)
    >>> floor = fc.solve(model, 1)[-1].contact["floor"]
    >>> floor.pressure.round(9)
    array([2., 2., 2., 2., 2.])
    >>> round(floor.normal_force, 9)
    2.0
    """

    name: str
    formulation: str
    points: Numbers
    coordinates: Array
    abscissa: Array
    gap: Array
    pressure: Array
    multiplier: Array
    force_vectors: Array
    normal: Array
    active: Mask
    force: Array
    radius: tuple[float, float]
    shear: Array = None  # type: ignore[assignment]
    sticking: Mask = None  # type: ignore[assignment]
    dissipation: float = 0.0
    obstacle_displacement: Array | None = None
    middle: Array = None  # type: ignore[assignment]
    place: Array = None  # type: ignore[assignment]
    tangent: Array | None = None
    direction: Array | None = None
    primary_points: Numbers = None  # type: ignore[assignment]
    primary_force_vectors: Array = None  # type: ignore[assignment]
    obstacle_angle: float | None = None
    stick_bounds: tuple[float, float] | None = None
    torque: float | None = None
    wear: Array | None = None
    damage: Array | None = None
    fluid_pressure: Array | None = None
    fluid_force_vectors: Array | None = None
    sliding_load: Array | None = None
    slip: Array = None  # type: ignore[assignment]
    slip_total: Array = None  # type: ignore[assignment]
    heat_flux: Array | None = None
    displacement: Array | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if np.ndim(self.coordinates) != 2:
            raise FastcontactError(
                f"coordinates of a ContactResult must be an array (m, dim), not {type(self.coordinates).__name__}"
            )
        dim = self.coordinates.shape[1]
        defaults = {  # of attributes that result files of earlier versions do not contain
            "middle": lambda: np.zeros(dim),
            "place": lambda: np.abs(self.coordinates[:, 0]) if dim == 2 else np.array(self.abscissa),
            "primary_points": lambda: np.empty(0, np.int32),
            "primary_force_vectors": lambda: np.empty((0, dim)),
            "shear": lambda: np.zeros_like(self.coordinates),
            "sticking": lambda: np.array(self.active),
            **dict.fromkeys(("slip", "slip_total"), lambda: np.full_like(self.coordinates, np.nan)),
        }
        for name, default in defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, default())

    @property
    def shown(self) -> dict[str, str]:
        """Names and values of the force, the largest pressure, the closed nodes and the contact radius, for reprs."""
        low, high = self.radius
        inside, outside = (with_unit(f"{end:.4g}", self.units, "length") for end in (low, high))
        radius = f"{low:.4g} to {outside}" if np.isfinite(high) else "none, closed to its end"
        if self.is_ring:
            radius = f"ring from {self.place[self.active].min():.4g} to {outside if np.isfinite(high) else inside}"
        fluid = float(np.linalg.norm(self.fluid_force))
        return {
            "force": force_text(self.force.tolist(), self.force_parts, self.normal_force, self.units, fluid),
            "largest pressure": with_unit(f"{self.pressure_max:.6g}", self.units, "pressure"),
            "closed": f"{int(self.active.sum())} of {len(self.points)} nodes",
            "contact radius": radius if np.isfinite(low) else "none",
        }

    def __repr__(self) -> str:
        texts = ", ".join(f"{name} {text}" for name, text in self.shown.items())
        return f"ContactResult('{self.name}', {self.formulation}: {texts})"

    def _repr_html_(self) -> str:
        """Return a table for notebooks."""
        return html_table(self.shown.items(), caption=f"Contact '{self.name}', {self.formulation}")

    @property
    def positions(self) -> Array:
        """Positions (m, dim) of the secondary nodes at which forces act: in finite strain the deformed ones [length]."""
        return self.coordinates if self.displacement is None else self.coordinates + self.displacement

    @property
    def measured_from_axis(self) -> bool:
        """Whether `place` contains distances from the axis of symmetry instead of arc lengths or distances in 3D."""
        # In plane models, only rings and contacts across periodic ends have no tangent.
        flat = self.coordinates.shape[1] == 2 and self.tangent is None
        return flat and bool(self.middle[0] == 0.0) and bool(np.array_equal(self.place, np.abs(self.coordinates[:, 0])))

    @property
    def is_ring(self) -> bool:
        """Whether the contact area of an axisymmetric model does not contain the axis, so that it has two edges."""
        return self.measured_from_axis and 0.0 < float(self.place[self.active].min(initial=np.inf)) < np.inf

    @property
    def extent(self) -> str:
        """Term for the quantity `radius`: "radius", or "half-width" in 2D unless it is measured from the axis."""
        return "radius" if self.coordinates.shape[1] == 3 or self.measured_from_axis else "half-width"

    @property
    def per_thickness(self) -> bool:
        """Whether forces are per unit thickness, as in plane models."""
        if self.coordinates.shape[1] == 3 or self.measured_from_axis:
            return False
        # In axisymmetry the resultant has no radial component, but the nodal forces do.
        force_x, size = float(self.force_vectors[:, 0].sum()), float(np.abs(self.force_vectors).sum())
        return bool(abs(self.force[0] - force_x) <= 1e-9 * size and size > 0.0)

    @property
    def stick_radius(self) -> tuple[float, float]:
        """Lower and upper bound of the radius of the stick zone, in 2D of its half-width [length]; NaN if no node sticks.

        They are the distances from the `middle` to the outermost sticking node and to the next node. In 3D, pairs of a
        sticking and another node with a common facet are considered as for `radius`, so that the edge of the stick zone lies
        between the bounds in every direction.
        """
        if self.stick_bounds is None:
            return half_width(self.place, self.active & self.sticking, self.across)
        return self.stick_bounds

    @property
    def across(self) -> Array:
        """Position (m,) of each node relative to `middle` along `tangent`, or `place` without a tangent [length]."""
        return self.place if self.tangent is None else (self.coordinates - self.middle) @ self.tangent

    @property
    def pressure_max(self) -> float:
        """Largest nodal pressure [pressure]."""
        return float(self.pressure.max(initial=0.0))

    @property
    def normal_force(self) -> float:
        """Sum of the normal components of the nodal forces without those of a fluid, positive in compression [force]."""
        return float(self.normal_forces.sum())

    @property
    def _finite_normal(self) -> Array:
        return np.where(np.isfinite(self.normal), self.normal, 0.0)

    @property
    def normal_forces(self) -> Array:
        """Normal components (m,) of the nodal forces without those of a fluid; zero without an opposite point [force]."""
        return np.einsum("nd,nd->n", self.force_vectors - self._fluid_force_vectors, self._finite_normal)

    @property
    def _fluid_force_vectors(self) -> Array:
        return 0.0 * self.force_vectors if self.fluid_force_vectors is None else self.fluid_force_vectors

    @property
    def fluid_force(self) -> Array:
        """Resultant force (dim,) of a fluid on the secondary side; zero without fluid [force]."""
        return np.where(self.force == 0.0, 0.0, self._fluid_force_vectors.sum(axis=0))  # see `force_parts`

    @property
    def force_parts(self) -> tuple[float, float, float]:
        """Magnitudes of `force` and of the vector sums of the nodal normal and tangential contact forces [force].

        The sums do not contain `fluid_force`. Without friction the last one is zero. Where normals vary, the second is
        smaller than `normal_force`.
        """
        contact_force = self.force - self.fluid_force
        along = self.normal_forces @ self._finite_normal if self.shear.any() else contact_force
        along = np.where(self.force == 0.0, 0.0, along)  # radial forces of axisymmetric models balance each other
        total, normal_part, tangential = np.linalg.norm([self.force, along, contact_force - along], axis=1)
        return float(total), float(normal_part), float(tangential)

    def force_against_theory(self, share: float) -> float:
        """Return the force that is compared with a theory, of whose contact the model contains the fraction `share` [-].

        Pressures on the inclined facets of a quarter or a half have a resultant along the surface, which the other parts of
        the contact balance. For a `share` below 1, the force is therefore the component of `force` along `direction`.

        Parameters
        ----------
        share : float
            Fraction of the contact of the theory that the model contains, for example 0.25 for a quarter [-].

        Returns
        -------
        float
            Magnitude of `force` or of its component, not divided by `share` [force].
        """
        if share == 1.0 or self.direction is None:
            return float(np.linalg.norm(self.force))
        return abs(float(self.force @ self.direction))

    @property
    def cancels(self) -> bool:
        """Whether the normal forces balance each other, so that their resultant is negligible, as in a press fit."""
        return bool(np.linalg.norm(self.force) < NEGLIGIBLE * self.normal_force)

    @property
    def penetration(self) -> float:
        """Largest penetration of closed nodes [length], due to a penalty or because only weighted gaps are closed."""
        return float(-self.gap[self.active].min(initial=0.0))


class ContactsByName(dict[str, ContactResult]):
    """Contact results by name of the pair; the error for an unknown name lists the known names."""

    def __missing__(self, name: object) -> ContactResult:
        raise KeyError(unknown("contact pair", str(name), self))


@dataclass(frozen=True, eq=False, repr=False)
class StepResult(NameSuggestions):
    """State at the end of one load step.

    Attributes
    ----------
    index : int
        Number of the step; the first step has the number 1.
    load_factor : float
        Load factor, the pseudo-time of the analysis, at the end of the step [-].
    displacement : ndarray (n_points, dim)
        Nodal displacements [length].
    stress : ndarray (n_points, 4) or (n_points, 6)
        Nodal stress [pressure], averaged at each node over the adjacent cells of one material. Where materials meet, it is
        the average of the material with the largest von Mises stress. Components are xx, yy, zz, xy, in 3D also yz, xz;
        in axisymmetry rr, yy, hoop, ry.
    von_mises : ndarray (n_points,)
        Equivalent stress of `stress` according to von Mises [pressure]. Nodal stresses are extrapolated from integration
        points: in plastic bodies they may exceed the yield stress, while ``cell_fields["yield_ratio"]`` is at most 1.
    von_mises_signed : ndarray (n_points,)
        Equivalent stress with the sign of the trace of the stress [pressure].
    reaction : ndarray (n_points, dim)
        Nodal forces of supports, multi-point constraints and springs to the ground, zero at other nodes; in axisymmetry
        integrated over the full circle [force].
    contact : dict of str to ContactResult
        Contact results by name of the pair.
    iterations : dict
        Iteration counts and further data of the step:

        - ``geometry_updates``, ``active_set_iterations``, ``linear_iterations``: numbers of iterations.
        - ``history``: list of dicts with the iterations.
        - ``regularised``, with floating bodies: their soft springs, the forces in these springs, the rigid-body motions
          whose amplitude is undetermined, and by how much bodies with such motions moved in the step [length].
        - ``scatter``, if round-off prevents the contact geometry from meeting the criterion: relative variation of
          ``displacement`` and of the contact ``force`` [-].
        - ``coarse_contacts``, if there are any: number of elements across the radius of contacts with fewer than four,
          by name of the pair.
        - ``temperature_factors``, ``initial_factors``, ``pressure_factors``, ``spin_factors``: multipliers of the
          temperatures, of the initial stresses and strains, of the pressures and of the centrifugal forces [-].
        - ``work``, ``pretension`` and ``reference_reactions``: data of the properties of the same names.
        - ``thickness``, in plane decks: thickness to which the forces of the step refer [length].
        - ``parameter``, in vibration modes, whose shapes have no unit: quantity that the load factor represents,
          ``frequency`` or ``phase``.
    warnings : tuple of str
        Warnings of the step. All but the last step of a run contain only warnings that apply to a single step, about
        contacts with too few elements across their radius; the first one also contains those about the model.
    cell_fields : dict of str to ndarray (n_solids,)
        Further fields with one value for each solid cell, in the order of ``mesh.solids``, for example an estimated error
        [unit of the field].
    material_stress : MaterialStress, optional
        Stress in each material at nodes where materials meet; None if there are no such nodes.
    temperature : ndarray (n_points,), optional
        Nodal temperature [temperature]; None without heat conduction.
    heat_reaction : ndarray (n_points,), optional
        Heat flow into the nodes with a prescribed temperature, zero at other nodes; in axisymmetry integrated over the
        full circle [power].
    restart : dict, optional
        Data from which the next step starts: numbers, strings and arrays. Result files store them for their last step only.
    units : mapping of str to str
        Names of units, as described for `ContactResult`.

    Examples
    --------
    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.block(), kinematics="plane_stress")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    >>> model.fix("BOTTOM", "y")
    >>> model.fix("BOTTOM_LEFT", "x")
    >>> model.add_pressure("TOP", 2.0)
    >>> step = fc.solve(model, 1)[-1]
    >>> round(float(step.stress[0, 1]), 9), round(float(step.reaction[:, 1].sum()), 9)
    (-2.0, 2.0)
    """

    index: int
    load_factor: float
    displacement: Array
    stress: Array
    von_mises: Array
    von_mises_signed: Array
    reaction: Array
    contact: dict[str, ContactResult] = field(default_factory=dict)
    iterations: dict[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    cell_fields: dict[str, Array] = field(default_factory=dict)
    restart: dict[str, Any] | None = field(default=None, repr=False)
    material_stress: MaterialStress | None = None
    temperature: Array | None = None
    heat_reaction: Array | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.contact, Mapping):
            raise FastcontactError(f"contact of a StepResult must be a dict, not {type(self.contact).__name__}")
        pairs = {name: replace(pair, units=self.units) for name, pair in self.contact.items()} if self.units else {}
        object.__setattr__(self, "contact", ContactsByName(pairs or self.contact))

    @property
    def instant(self) -> str:
        """Text with the load factor, or with the frequency if the step is a vibration mode."""
        parameter = self.iterations.get("parameter", "load factor")
        # The names of units do not include that of time, which follows from the unit of density.
        return f"{parameter} {self.load_factor:.6g}{' per unit of time' if parameter == 'frequency' else ''}"

    @property
    def shown(self) -> dict[str, str]:
        """Names and values of the load factor, the largest displacement and stress, and the iterations, for reprs."""
        displacement, stress = (float(np.abs(field).max(initial=0.0)) for field in (self.displacement, self.von_mises))
        units = {} if "parameter" in self.iterations else self.units
        shown = {
            self.iterations.get("parameter", "load factor"): f"{self.load_factor:.6g}",
            "largest displacement": with_unit(f"{displacement:.6g}", units, "length"),
            "largest von Mises stress": with_unit(f"{stress:.6g}", self.units, "pressure"),
        }
        labels = {"geometry_updates": "geometry updates", "active_set_iterations": "active-set iterations"}
        return shown | {label: str(self.iterations[key]) for key, label in labels.items() if key in self.iterations}

    def __repr__(self) -> str:
        shown = [(contact.name, contact.shown) for contact in self.contact.values()]
        pairs = [f"'{name}': force {s['force']}, largest pressure {s['largest pressure']}" for name, s in shown]
        texts = [f"largest displacement {self.shown['largest displacement']}", *pairs]
        return f"StepResult({self.index}, {self.instant}; {'; '.join(texts)})"

    def _repr_html_(self) -> str:
        """Return tables of the step and of its contact pairs for notebooks."""
        warnings = [("warning", text) for text in self.warnings]
        table = html_table([*self.shown.items(), *warnings], caption=f"Step {self.index}")
        return table + "".join(contact._repr_html_() for contact in self.contact.values())

    @property
    def principal_stress(self) -> Array:
        """Principal stresses (n_points, 3) of `stress`, in ascending order [pressure]."""
        return recovery.principal_stress(self.stress)

    @property
    def tresca(self) -> Array:
        """Tresca stress (n_points,) of `stress`, the largest minus the smallest principal stress [pressure]."""
        return recovery.tresca(self.stress)

    @property
    def pretension(self) -> dict[str, dict[str, float]]:
        """The ``force``, positive in tension [force], and ``shortening`` [length] of pretension sections, by name."""
        return dict(self.iterations.get("pretension", {}))

    @property
    def reference_reactions(self) -> dict[str, dict[str, list[float]]]:
        """The ``force`` (dim,) [force] and ``moment`` [force times length] of the supports of reference points, by name.

        The moment has one component in the plane and three in 3D. In `reaction` these forces are those of the coupled nodes,
        and the values at reference points are zero.
        """
        return dict(self.iterations.get("reference_reactions", {}))

    @property
    def work(self) -> dict[str, float]:
        """Energies at the end of the step, and work accumulated over all steps [energy].

        - ``strain_energy``: energy of the bodies and springs, for nonlinear bodies the elastic energy. Thermal strains are
          treated as external forces.
        - ``plastic_work``: work of plastic deformation.
        - ``external_work``: work of loads, supports, obstacles and thermal strains, and that of contact pressures on
          changes of the gap by `clearance_ramp`.
        - ``friction_work``: work dissipated by friction.
        - ``friction_while_touching``: part of the frictional work that is dissipated at nodes in the step in which their
          gaps close, unless they take over the forces of other nodes, and by pairs in the step in which all their nodes
          open. In long steps, this part is overestimated.
        - ``penalty_energy``: energy of penalties and cohesive layers, and of the small compliance of pressure fields.
        - ``energy_released``: energy dissipated by damage of cohesive layers. For adhesion, this energy is
          reversible: it decreases as the surfaces approach each other.
        - ``wear_work``: work of contact pressures on the wear depth. Wear may also change the strain energy.
        - ``imbalance``: external work minus the sum of all other energies.

        The dict is empty if the result file was written by a version that did not store these values, and in steps that
        were resumed from such a file.
        """
        return dict(self.iterations.get("work", {}))

    @property
    def heat(self) -> dict[str, Any]:
        """Heat flows at the end of the step, positive into the bodies [power]; empty without heat conduction.

        - ``supports``: heat flow at nodes with prescribed temperatures.
        - ``loads``: heat flow of fluxes, volumetric sources and nodal sources.
        - ``films``: heat flow of convection.
        - ``friction``: frictional heat.
        - ``imbalance``: largest residual of the heat balance of a node.
        - ``contacts``: heat flow to the primary side of each contact pair, by name.
        - ``exchanges``: number of alternating solutions of the heat conduction and the contact problem [-].
        """
        return dict(self.iterations.get("heat", {}))

    @property
    def heat_flux(self) -> Array | None:
        """Mean heat flux vector (n_solids, dim) of each solid cell [power / area]; None without heat conduction."""
        fluxes = [values for name, values in sorted(self.cell_fields.items()) if name.startswith("heat_flux_")]
        return np.column_stack(fluxes) if fluxes else None

    def stress_of_material(self, number: int) -> Array:
        """Return the nodal stress with the values of a given material where several materials meet [pressure].

        Parameters
        ----------
        number : int
            Number of the material, from 0, in the order in which materials were added to the model.

        Returns
        -------
        ndarray (n_points, 4) or (n_points, 6)
            Stress averaged over the cells of the material at its nodes, and `stress` at all other nodes [pressure].
        """
        stress = self.stress.copy()
        if self.material_stress is not None:
            of_material = self.material_stress.material == number
            stress[self.material_stress.points[of_material]] = self.material_stress.stress[of_material]
        return stress


# Largest number of steps that the repr of a list shows.
MAX_SHOWN = 30


class _StepList(NameSuggestions):
    """Base class of lists of steps, whose AttributeError states that an attribute belongs to each step."""

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> object:
            if not name.startswith("_") and (name in StepResult.__dataclass_fields__ or hasattr(StepResult, name)):
                text = f"'{type(self).__name__}' has no attribute '{name}': each step has one, such as [-1].{name}"
                raise AttributeError(text, name=name)
            return super().__getattr__(name)


class StepSequence(_StepList, Sequence[StepResult]):
    """A sequence of steps, each of which is read or computed on access."""

    @abstractmethod
    def _step(self, position: int) -> StepResult: ...

    @overload
    def __getitem__(self, number: int) -> StepResult: ...
    @overload
    def __getitem__(self, number: slice) -> list[StepResult]: ...
    def __getitem__(self, number: int | slice) -> StepResult | list[StepResult]:
        """Return a step by its index, or a list of steps for a slice."""
        positions = self._positions(number)
        return self._step(positions) if isinstance(positions, int) else [self._step(position) for position in positions]

    def _positions(self, number: int | slice) -> int | range:
        """Return the position of a step, or the positions of a slice."""
        return range(len(self))[number]


class Steps(_StepList, list[StepResult]):
    """A list of `StepResult`, which notebooks display as a table."""

    @overload
    def __getitem__(self, index: SupportsIndex) -> StepResult: ...
    @overload
    def __getitem__(self, index: slice) -> Steps: ...
    def __getitem__(self, index: SupportsIndex | slice) -> StepResult | Steps:
        """Return a step, or `Steps` for a slice."""
        if isinstance(index, slice):
            return Steps(super().__getitem__(index))
        return super().__getitem__(index)

    def __repr__(self) -> str:
        lines = (f"  {step!r}" for step in self[-MAX_SHOWN:])
        return "\n".join([f"{len(self)} steps", *(["  ..."] if len(self) > MAX_SHOWN else []), *lines])

    def _repr_html_(self) -> str:
        """Return an HTML table with a row for each contact pair of each step."""
        rows = [row for step in self[-MAX_SHOWN:] for row in table_rows(step)]
        omitted = f", {len(self) - MAX_SHOWN} of them not shown" if len(self) > MAX_SHOWN else ""
        return html_table(rows, HEAD, f"{len(self)} steps{omitted}")


HEAD = ("step", "load factor", "geometry updates", "contact", "force", "largest pressure", "closed", "contact radius")


def table_rows(step: StepResult) -> list[tuple[str, ...]]:
    """Return a row of strings with the columns `HEAD` for each contact pair of a step, or one row if there are no pairs."""
    leading = (str(step.index), f"{step.load_factor:.6g}", str(step.iterations.get("geometry_updates", "")))
    pairs = [(name, *contact.shown.values()) for name, contact in step.contact.items()]
    return [(*leading, *pair) for pair in pairs] or [(*leading, *[""] * (len(HEAD) - len(leading)))]


def phases(shape: StepResult, count: int) -> list[StepResult]:
    """Return `count` steps that show a vibration mode, `shape`, at equidistant phases of a period.

    The load factor of a step is its phase in periods, in [0, 1). Raises ModelError if `count` is less than two.
    """
    if count < 2:
        raise ModelError(f"count = {count}: a period needs two phases or more")
    materials = shape.material_stress
    return [
        replace(
            shape, index=k + 1, load_factor=k / count, displacement=factor * shape.displacement,
            stress=factor * shape.stress, von_mises=abs(factor) * shape.von_mises,
            von_mises_signed=factor * shape.von_mises_signed, reaction=factor * shape.reaction,
            contact={},  # contact results are not part of a vibration mode
            material_stress=None if materials is None else replace(materials, stress=factor * materials.stress),
            restart=None, iterations={"parameter": "phase"},
        )
        for k, factor in enumerate(np.cos(2.0 * np.pi * np.arange(count) / count).tolist())
    ]  # fmt: skip
