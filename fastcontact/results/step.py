"""Results of a load step as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fastcontact._tools.html_table import html_table
from fastcontact.arrays import Array, Mask, Numbers
from fastcontact.errors import FastcontactError, unknown
from fastcontact.results.material_stress import MaterialStress
from fastcontact.results.units import with_unit

# Fraction of the normal forces below which their resultant is negligible.
CANCELLED = 1e-3


def half_width(place: Array, closed: Mask, across: Array | None = None) -> tuple[float, float]:
    """Return the bracket of the half-width of a contact [length]: (NaN, NaN) where nothing is closed.

    `place` (n,) are coordinates of nodes relative to the middle, signed if they lie on both sides of it [length]. The
    bracket is half the width of the outermost `closed` nodes, and that of the next ones beyond, measured in `across`
    (n,), by default `place` [length]. If all nodes lie on one side, the other half is the mirror image.
    """
    if not closed.any():
        return float("nan"), float("nan")
    across, one_sided = place if across is None else across, bool(place.min() >= 0.0)
    beyond = place == place[place > place[closed].max()].min(initial=np.inf)
    if not one_sided:  # the contact cannot extend beyond an end of the surface
        beyond |= place == place[place < place[closed].min()].max(initial=-np.inf)

    def half(nodes: Mask) -> float:
        return float(np.abs(across[nodes]).max() if one_sided else 0.5 * np.ptp(across[nodes]))

    return half(closed), half(closed | beyond) if beyond.any() else float("inf")


@dataclass(frozen=True, eq=False, repr=False)
class ContactResult:
    """State of one contact pair at the end of a step, on the secondary nodes in order along the surface.

    Attributes
    ----------
    name, formulation : str
        Name of the pair and of its formulation.
    points : ndarray of int (m,)
        Point numbers.
    coordinates : ndarray (m, dim)
        Reference coordinates [length].
    abscissa : ndarray (m,)
        Length along the reference surface from its first node; in 3D the distance from the axis of first contact, the line
        along the normal through the node with the smallest gap before any load (of equal ones the nearest to the origin)
        [length].
    gap : ndarray (m,)
        Gap function, clearance included: positive where open, zero where closed, negative where a penalty admits
        penetration; infinite at nodes without an opposite point, such as at the edge of a hole, even if the facets
        around them carry pressure [length].
    pressure : ndarray (m,)
        Contact pressure, positive in compression, per reference area; negative only in tied or bilateral contact under
        tension. Interpolated by the shape functions of the facets, it integrates to the sum of the normal forces. In finite
        strain it refers to the deformed area (in plane stress of unit thickness), as `multiplier` and `shear` do [pressure].
    multiplier : ndarray (m,)
        Nodal pressure of the formulation itself, before that of open nodes and in tension is redistributed to the
        closed nodes [pressure].
    force_vectors : ndarray (m, dim)
        Contact force on each secondary node; axisymmetric: over the full circle [force].
    normal : ndarray (m, dim)
        Unit outward normal of the opposite primary facet [-].
    active : ndarray of bool (m,)
        Closed constraints.
    force : ndarray (dim,)
        Resultant on the secondary side [force].
    radius : (float, float)
        Bracket of the contact radius, in plane problems the half-width along the `tangent`: from the `middle` to the
        outermost closed constraint, and to the first open one beyond it [length]; NaN without contact. In finite strain
        that of the deformed shape.
    shear : ndarray (m, dim)
        Tangential traction on the secondary side, zero for frictionless contact [pressure].
    sticking : ndarray of bool (m,)
        Closed nodes that stick; without friction all closed nodes.
    dissipation : float
        Work of friction in this step [energy].
    obstacle_displacement : ndarray (dim,), optional
        Displacement of a rigid obstacle [length]; None for contact between bodies.
    obstacle_angle : float, optional
        Rotation of a rigid obstacle [radian]; None unless it rotates.
    torque : float, optional
        Torque about the axis of a rotating rigid obstacle that balances the contact, that is the moment of the contact
        forces on the body in the deformed configuration [force times length]; None unless it rotates.
    middle : ndarray (dim,)
        Centre of the contact on the reference surface: in axisymmetry on the axis; otherwise the centre of pressure, moved
        onto the planes of symmetry that the contact reaches, where supports hold an end of the surface [length].
    place : ndarray (m,)
        Distance of each node from the middle: in axisymmetry its radius; in plane problems, and where an axisymmetric
        surface is parallel to the axis, the signed arc length from the middle; in 3D the distance from the line through the
        middle along the mean normal [length].
    tangent : ndarray (dim,), optional
        In plane problems the direction along which half-widths are measured [-]; None where `place` is used instead: in
        axisymmetry, in 3D, and on a ring in contact along its whole circumference.
    wear : ndarray (m,), optional
        Accumulated depth of wear, with the option ``wear`` [length]; the next load step starts from it.
    heat_flux : ndarray (m,), optional
        Heat flux from the secondary to the primary side per reference area, with the option ``conductance``
        [power / area].
    damage : ndarray (m,), optional
        Damage of the cohesive layer, from 0 (intact) to 1 (broken), with the option ``cohesion`` [-].
    fluid_pressure : ndarray (m,), optional
        Pressure of the fluid that has reached the nodes, with `Model.add_fluid_pressure` [pressure].
    slip, slip_total : ndarray (m, dim)
        Tangential displacement of closed nodes relative to the opposite side, in this step and accumulated over all steps;
        zero at sticking nodes, and for the step at open ones [length]. NaN in result files of versions without it.
    primary_points : ndarray of int (k,)
        Point numbers of the primary side; none for a rigid obstacle.
    primary_force_vectors : ndarray (k, dim)
        Contact force on each of them; axisymmetric: over the full circle [force]. Forces on a node of both sides are
        included here alone.
    units : mapping of str to str
        Names of the units of ``length``, ``force`` and ``pressure``, if the model names them, in plane models with
        forces per thickness; shown by reprs, pictures and tables.

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
    primary_points: Numbers = None  # type: ignore[assignment]
    primary_force_vectors: Array = None  # type: ignore[assignment]
    obstacle_angle: float | None = None
    torque: float | None = None
    wear: Array | None = None
    damage: Array | None = None
    fluid_pressure: Array | None = None
    slip: Array = None  # type: ignore[assignment]
    slip_total: Array = None  # type: ignore[assignment]
    heat_flux: Array | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if np.ndim(self.coordinates) != 2:
            raise FastcontactError(
                f"coordinates of a ContactResult must be an array (m, dim), not {type(self.coordinates).__name__}"
            )
        dim = self.coordinates.shape[1]
        defaults = {  # for files of versions that did not measure from the middle
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
        """Texts for reprs and tables: force, largest pressure, closed nodes, contact radius."""
        low, high = self.radius
        inside, outside = (with_unit(f"{end:.4g}", self.units, "length") for end in (low, high))
        radius = f"{low:.4g} to {outside}" if np.isfinite(high) else f"{inside}, to its end"
        force = with_unit(f"{float(np.linalg.norm(self.force)):.6g}", self.units, "force")
        around = (
            with_unit(f", normal {self.normal_force:.6g}", self.units, "force") + " all round" if self.cancels else ""
        )
        return {
            "force": force + around,
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
    def measured_from_axis(self) -> bool:
        """Whether `place` holds radii, in axisymmetry, rather than arc lengths or distances."""
        flat = self.coordinates.shape[1] == 2 and self.tangent is None  # plane problems have one, but for rings
        return flat and bool(self.middle[0] == 0.0) and bool(np.array_equal(self.place, np.abs(self.coordinates[:, 0])))

    @property
    def per_thickness(self) -> bool:
        """Whether forces are per thickness, as in a plane model."""
        if self.coordinates.shape[1] == 3 or self.measured_from_axis:
            return False
        across, size = float(self.force_vectors[:, 0].sum()), float(np.abs(self.force_vectors).sum())
        return bool(abs(self.force[0] - across) <= 1e-9 * size and size > 0.0)

    @property
    def stick_radius(self) -> tuple[float, float]:
        """Bracket of the stick radius, like `radius`: outermost sticking node and the next one; NaN if none sticks."""
        return half_width(self.place, self.active & self.sticking, self.across)

    @property
    def across(self) -> Array:
        """Distance (m,) of each node from the middle, perpendicular to the normal there: radii and half-widths [length]."""
        return self.place if self.tangent is None else (self.coordinates - self.middle) @ self.tangent

    @property
    def pressure_max(self) -> float:
        """Largest nodal pressure [pressure]."""
        return float(self.pressure.max(initial=0.0))

    @property
    def normal_force(self) -> float:
        """Sum of the nodal forces, each along its own normal, positive in compression [force]."""
        normal = np.where(np.isfinite(self.normal), self.normal, 0.0)
        return float(np.einsum("nd,nd->", self.force_vectors, normal))

    @property
    def cancels(self) -> bool:
        """Whether the resultant is negligible compared with the normal forces, as in a press fit."""
        return bool(np.linalg.norm(self.force) < CANCELLED * self.normal_force)

    @property
    def penetration(self) -> float:
        """Largest penetration of closed nodes [length], due to a penalty or to weighted gaps."""
        return float(-self.gap[self.active].min(initial=0.0))


class ContactsByName(dict[str, ContactResult]):
    """Contact pairs by name; the error for an unknown name lists the known ones."""

    def __missing__(self, name: object) -> ContactResult:
        raise KeyError(unknown("contact pair", str(name), self))


@dataclass(frozen=True, eq=False, repr=False)
class StepResult:
    """State at the end of one load step.

    Attributes
    ----------
    index : int
        1 for the first step.
    load_factor : float
        Pseudo-time of the step [-].
    displacement : ndarray (n_points, dim)
        [length].
    stress : ndarray (n_points, 4) or (n_points, 6)
        Nodal stress, averaged over the elements of one material at each node; where materials meet, that of the side
        with the largest von Mises stress. Components are xx, yy, zz, xy (then yz, xz in 3D), in axisymmetry rr, yy,
        hoop, ry [pressure].
    von_mises, von_mises_signed : ndarray (n_points,)
        Equivalent stress of `stress`; the same with the sign of its trace [pressure].
    reaction : ndarray (n_points, dim)
        Forces of supports, multi-point constraints and springs to the ground, zero elsewhere; axisymmetric: over the
        full circle [force].
    contact : dict of str to ContactResult
        Contact results by name of the pair.
    iterations : dict
        ``geometry_updates``, ``active_set_iterations``, ``linear_iterations``, ``history`` (list of dict). With
        floating bodies, ``regularised``: their springs and the forces in them. If round-off prevents the contact
        geometry from meeting the criterion, ``scatter``: the variation of ``displacement`` and contact ``force`` [-].
        With temperatures, ``temperature_factors``, their multipliers; likewise ``initial_factors`` with initial
        stresses and strains, and ``pressure_factors`` with pressures in finite strain [-]. ``work`` and, with
        pretension sections, ``pretension``: see the properties of these names. ``parameter`` of modes and their phases:
        what their load factor is, ``frequency`` or ``phase``.
    warnings : tuple of str
        Warnings of the step.
    cell_fields : dict of str to ndarray (n_solids,)
        Further values of every solid cell, in the order of ``mesh.solids``, e.g. an estimated error [unit of the
        field].
    material_stress : MaterialStress, optional
        The stress of each side at nodes where materials meet; None if there are none.
    temperature : ndarray (n_points,), optional
        Nodal temperature [temperature]; None without heat conduction.
    heat_reaction : ndarray (n_points,), optional
        Heat flow into the nodes with a prescribed temperature, zero elsewhere; axisymmetric: over the full circle
        [power].
    restart : dict, optional
        Restart data for the next step: plain numbers, strings and arrays. Result files keep those of their last step.
    units : mapping of str to str
        As in `ContactResult`.

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
        named = {name: replace(pair, units=self.units) for name, pair in self.contact.items()} if self.units else {}
        object.__setattr__(self, "contact", ContactsByName(named or self.contact))

    @property
    def instant(self) -> str:
        """Load factor, or the frequency of a mode, as text."""
        return f"{self.iterations.get('parameter', 'load factor')} {self.load_factor:.6g}"

    @property
    def shown(self) -> dict[str, str]:
        """Texts for reprs and tables: load factor, largest displacement and stress, iterations."""
        moved, stressed = (float(np.abs(field).max(initial=0.0)) for field in (self.displacement, self.von_mises))
        shown = {
            self.iterations.get("parameter", "load factor"): f"{self.load_factor:.6g}",
            "largest displacement": with_unit(f"{moved:.6g}", self.units, "length"),
            "largest von Mises stress": with_unit(f"{stressed:.6g}", self.units, "pressure"),
        }
        named = {"geometry_updates": "geometry updates", "active_set_iterations": "active-set iterations"}
        return shown | {text: str(self.iterations[key]) for key, text in named.items() if key in self.iterations}

    def __repr__(self) -> str:
        pairs = [
            f"'{c.name}': force {c.shown['force']}, largest pressure {c.shown['largest pressure']}"
            for c in self.contact.values()
        ]
        texts = [f"largest displacement {self.shown['largest displacement']}", *pairs]
        return f"StepResult({self.index}, {self.instant}; {'; '.join(texts)})"

    def _repr_html_(self) -> str:
        """Return tables of the step and of its contact pairs for notebooks."""
        warnings = [("warning", text) for text in self.warnings]
        table = html_table([*self.shown.items(), *warnings], caption=f"Step {self.index}")
        return table + "".join(contact._repr_html_() for contact in self.contact.values())

    @property
    def pretension(self) -> dict[str, dict[str, float]]:
        """``force``, positive in tension [force], and ``shortening`` [length] of each pretension section."""
        return dict(self.iterations.get("pretension", {}))

    @property
    def work(self) -> dict[str, float]:
        """Energies at the end of the step, and work accumulated over all steps [energy].

        ``strain_energy``: springs included, with temperatures treated as forces; for nonlinear bodies the elastic
        energy. ``plastic_work``. ``external_work``: of loads, supports, obstacles and thermal expansion.
        ``friction_work``. ``friction_while_touching``: its part at nodes in the step in which they close, which is too
        large in long steps. ``penalty_energy``: of penalties and cohesive layers. ``energy_released``: dissipated by
        damage of cohesive layers. ``imbalance``: external work minus all others. Empty in files of versions without
        it, and in steps resumed from these.
        """
        return dict(self.iterations.get("work", {}))

    @property
    def heat(self) -> dict[str, Any]:
        """Heat balance at the end of the step, positive into the bodies [power]; empty without heat conduction.

        ``supports``: of prescribed temperatures; ``loads``: of fluxes, sources and nodal heat; ``films``;
        ``friction``; ``imbalance``: largest residual of a node; ``contacts``: heat flow of each pair to its primary
        side; ``exchanges``: number of alternations between heat and contact [-].
        """
        return dict(self.iterations.get("heat", {}))

    @property
    def heat_flux(self) -> Array | None:
        """Mean heat flux (n_solids, dim) of every solid cell [power / area]; None without heat conduction."""
        fluxes = [values for name, values in sorted(self.cell_fields.items()) if name.startswith("heat_flux_")]
        return np.column_stack(fluxes) if fluxes else None

    def stress_of_material(self, number: int) -> Array:
        """Return the nodal stress (n_points, 4) or (n_points, 6) with that of a given material where several meet [pressure].

        Materials are numbered from 0, in the order in which they were added to the model; at nodes of other materials
        the stress is that of `stress`.
        """
        stress = self.stress.copy()
        if self.material_stress is not None:
            of_material = self.material_stress.material == number
            stress[self.material_stress.points[of_material]] = self.material_stress.stress[of_material]
        return stress
