"""The discrete problem of an analysis, which is prepared from a model and is immutable."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, csr_array

from fastcontact._jit import parallel
from fastcontact._tools.records import field, record, replace
from fastcontact.analysis.active_dofs import ActiveDofs
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.floating_bodies import FloatingBodies
from fastcontact.analysis.heat import Heat, prepared_heat
from fastcontact.analysis.state import State
from fastcontact.analysis.work import Work
from fastcontact.arrays import Array, Indices, Mask, scattered
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.held_motions import HeldMotions
from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide
from fastcontact.contact.overclosure import OverclosureLaw
from fastcontact.elasticity.constrained_system import System
from fastcontact.elasticity.following_loads import FollowerLoad
from fastcontact.elasticity.initial_states import InitialState
from fastcontact.elasticity.loads import Load
from fastcontact.elasticity.material_field import MaterialField
from fastcontact.elasticity.material_sides import MaterialSides, material_sides
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.elasticity.nonlinear_bodies import COMPLETE, DeformedBodies, NonlinearBodies
from fastcontact.elasticity.springs import stiffness_warnings, with_springs
from fastcontact.elasticity.stiffness import rigid_modes, stiffness
from fastcontact.elasticity.temperature import Temperature
from fastcontact.errors import ContactError
from fastcontact.linear import choice
from fastcontact.linear.protocol import TOLERANCE, LinearSolver, Loaded
from fastcontact.linear.sparse_rows import stacked_rows, sum_of_blocks
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import ROTATION
from fastcontact.model.contact_pair import angle_at
from fastcontact.model.force_driven_obstacles import ForceDrivenObstacles
from fastcontact.model.model import Model
from fastcontact.model.pretension import Pretension
from fastcontact.model.ramp import PartHistory, Ramp, Table, combined, multiplier, sums_by_ramp
from fastcontact.model.rigid_motions import FreeMotions, free_motions
from fastcontact.round_off import SINGLE_PRECISION

ByRamp = Mapping[PartHistory, Array]
# Shear, relative to the frictional capacity, that is neglected by default at nodes that close and slide. With 1, nodes stick
# to what they pass (`test_a_beam_that_passes_a_disc_in_one_step_does_not_stick_to_it`).
NEGLIGIBLE_SHEAR = 1e-3


@record
class StepLoad:
    """The loads at the end of a load step.

    n_dofs is the number of displacement components of all points and of the force-driven obstacles.

    Attributes
    ----------
    lift : ndarray (n_dofs,)
        Displacements that supports and multi-point constraints prescribe if all unknowns are zero, see `System.lift`
        [length].
    force : ndarray (n_dofs,)
        External forces [force].
    obstacles : dict of str to ndarray (dim,)
        Prescribed displacement of the rigid obstacle of each contact pair [length].
    clearance_factors : dict of str to float
        Factor of the clearances of each contact pair whose clearances vary [-].
    angles : dict of str to float
        Rotation angle of each rigid obstacle that rotates, by the name of its contact pair [radian].
    following : tuple of float
        Factor of each load that depends on the displacements [-].
    friction_factors : dict of str to float
        Factor of the coefficient of friction of each contact pair whose coefficient varies [-].
    fluids : dict of str to float
        Fluid pressure at the source of each contact pair that fluid may enter [pressure].
    rise : ndarray (n_points,), optional
        Temperature rise, which strains nonlinear bodies [temperature]. For linear bodies, `force` includes its nodal forces.
    instant : float
        Pseudo-time at the end of the step [-].
    """

    lift: Array
    force: Array
    obstacles: Mapping[str, Array]
    clearance_factors: Mapping[str, float]
    angles: Mapping[str, float] = field(default_factory=dict)
    following: tuple[float, ...] = ()
    friction_factors: Mapping[str, float] = field(default_factory=dict)
    fluids: Mapping[str, float] = field(default_factory=dict)
    rise: Array | None = None
    instant: float = 0.0


@record
class Problem:
    """A model prepared for analysis.

    Attributes
    ----------
    model : Model
    ramp : Ramp
    criteria : Criteria
    solver : LinearSolver
        Linear solver, prepared for the stiffness matrix. Its snapshot is part of the state.
    pairs : dict of str to Formulation
        The formulation of each contact pair.
    field : MaterialField
        Material constants of all solid cells.
    system : System
        Stiffness matrix, supports and multi-point constraints.
    floating_bodies : FloatingBodies, optional
        Bodies that are restrained by contact alone, with their springs, if there are such bodies.
    dofs : ActiveDofs
        Degrees of freedom of the contact problem.
    contact_dofs : ndarray of int
        Displacement components that contact constraints may involve.
    sides : MaterialSides
        Interfaces between materials; nodal stresses are averaged separately on each side.
    force_driven : ForceDrivenObstacles
        Rigid obstacles that are driven by forces.
    prescribed, forces : dict of ramp table to ndarray (n_points + n_driven, dim)
        For each ramp, the prescribed displacements [length] and the nodal forces [force] at multiplier 1.
    initial_snapshot : dict
        Snapshot of the solver before the first step.
    warnings : tuple of str
        Warnings about the stiffness of springs.
    bodies : NonlinearBodies, optional
        The solid cells, if they are nonlinear. `system` and `solver` then hold the tangent at zero displacements, or at
        `linearised_at`.
    following : sequence of (FollowerLoad, ramp table)
        Loads that depend on the displacements. `forces` include their forces on the undeformed bodies.
    heat : Heat, optional
        Heat conduction, if the model has any.
    linearised_at : ndarray (n_dofs,), optional
        Displacements at which `system` contains the tangent, for bodies in finite strain [length].
    """

    model: Model
    ramp: Ramp
    criteria: Criteria
    solver: LinearSolver
    pairs: Mapping[str, Formulation]
    field: MaterialField
    sides: MaterialSides
    system: System
    floating_bodies: FloatingBodies | None
    dofs: ActiveDofs
    contact_dofs: Indices
    force_driven: ForceDrivenObstacles
    prescribed: ByRamp
    forces: ByRamp
    initial_snapshot: Mapping[str, Any]
    warnings: tuple[str, ...] = ()
    bodies: NonlinearBodies | None = None
    following: Sequence[tuple[FollowerLoad, Table | None]] = ()
    heat: Heat | None = None
    linearised_at: Array | None = None

    @cached_property
    def until_settled(self) -> bool:
        """Whether the contact geometry is updated until displacements converge; otherwise the number of updates is fixed."""
        return self.criteria.geometry_updates is None and not self.criteria.keep_pairing

    @cached_property
    def reference_points(self) -> dict[str, tuple[int, int]]:
        """Numbers of the points with the displacement and the rotation of each supported reference point, by name."""
        mesh, (supported, _) = self.model.mesh, self.model.prescribed()
        for _, support in self.model.related_supports:
            supported.ravel()[support.rows.indices] = True
        names = [name for name in mesh.point_groups if name + ROTATION in mesh.point_groups]
        points = {name: (mesh.point(name), mesh.point(name + ROTATION)) for name in names}
        return {name: pair for name, pair in points.items() if supported[list(pair)].any()}

    @cached_property
    def friction_while_touching(self) -> float:
        """`Criteria.friction_while_touching` or its default; 1 means that friction is solved in whole steps.

        With nonlinear bodies it is 1, because their steps are halved instead. Between bodies the default is 1 unless each
        node has one weighted gap: the other formulations reproduce code_aster, which measures slip from the beginning of the
        step.
        """
        criteria, floats = self.criteria, self.floating_bodies is not None
        if self.bodies is not None:
            return 1.0
        if criteria.friction_while_touching is not None:
            return criteria.friction_while_touching
        whole_steps = self.model.mesh.dim == 3 or criteria.geometry_updates is not None or floats
        pairs = [pair for pair in self.pairs.values() if pair.friction and not isinstance(pair.primary, RigidSide)]
        return NEGLIGIBLE_SHEAR if not whole_steps and all(pair.weighs_gaps for pair in pairs) else 1.0

    @property
    def extrapolates(self) -> bool:
        """Whether load steps start from an extrapolation of earlier ones."""
        return self.solver.iterative or self.bodies is not None

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Number of points, including one for each force-driven obstacle, and dimension."""
        n_points, dim = self.model.mesh.points.shape
        return n_points + len(self.force_driven.pairs), dim

    def load_at(self, instant: float) -> StepLoad:
        """Return the loads at an instant of the ramp."""
        prescribed = combined(self.prescribed, self.ramp, instant, self.shape)
        lift = self.system.lift(prescribed.ravel(), self.factors(self.model.relations, instant))
        pairs, factor = self.model.contact, partial(multiplier, ramp=self.ramp, instant=instant)
        sides = {name: pair.primary for name, pair in self.pairs.items()}
        obstacles = {p.name: factor(p.ramp) * s.motion for p in pairs if isinstance(s := sides[p.name], RigidSide)}
        clearances = {p.name: factor(p.clearance_ramp) for p in pairs if p.clearance_ramp is not None}
        angles = {p.name: angle_at(p, self.ramp, instant) for p in pairs if p.rotation is not None}
        friction = {p.name: factor(p.friction_ramp) for p in pairs if p.friction_ramp is not None}
        fluids = {p.name: p.fluid.pressure * factor(p.fluid.ramp) for p in pairs if p.fluid is not None}
        force = combined(self.forces, self.ramp, instant, self.shape).ravel()
        following = tuple(factor(table) for _, table in self.following)
        temperatures = self.factors(self.model.temperatures, instant)
        rise = None if self.bodies is None else self.model.temperature_rise(temperatures)
        return StepLoad(lift, force, obstacles, clearances, angles, following, friction, fluids, rise, instant)

    def loaded(self, load: StepLoad) -> Loaded:
        """Return the prepared matrix with the right-hand side of a load."""
        return self.solver.load(self.system.right_side(load.force, load.lift))

    def factors(
        self, histories: Iterable[Temperature | InitialState | Pretension | Load | MultiPointConstraint], instant: float
    ) -> list[float]:
        """Return the multipliers of loads, temperatures and other parts of the model at an instant [-]."""
        return [multiplier(history.ramp, self.ramp, instant) for history in histories]

    def displacement(self, u: Array) -> Array:
        """Return the displacements (n_points, dim) of the mesh, given all displacements u (n_dofs,) [length]."""
        points = self.model.mesh.points
        return u[: points.size].reshape(points.shape)

    def round_off_lengths(self, u: Array) -> Array:
        """Return the lengths (n_dofs,) whose round-off limits the accuracy of displacements u (n_dofs,) [length].

        These are the displacements. In finite strain the distances from the centre of the mesh are added, because
        displacements of rotated bodies are differences of coordinates.
        """
        if self.bodies is None or not self.bodies.finite:
            return u
        points, lengths = self.model.mesh.points, np.abs(u)
        lengths[: points.size] += np.abs(points - points.mean(axis=0)).ravel()
        return lengths

    def obstacles_at(self, load: StepLoad, u: Array) -> dict[str, Array]:
        """Return the displacement (dim,) of the rigid obstacle of each contact pair [length].

        Prescribed displacements are those of `load`. Displacements of force-driven obstacles are taken from u (n_dofs,).
        """
        driven = self.force_driven.displacements(u) if self.force_driven.pairs else {}
        return {**load.obstacles, **driven}

    def configuration(self, name: str, state: State, load: StepLoad, u: Array) -> Configuration:
        """Return the configuration of a contact pair at the end of a load step.

        Parameters
        ----------
        name : str
            Name of the pair.
        state : State
            State at the beginning of the load step.
        load : StepLoad
        u : ndarray (n_dofs,)
            Displacements of all points, and then of the force-driven obstacles [length].
        """
        zero, side, wear = np.zeros(self.model.mesh.dim), self.pairs[name].secondary, state.wear.get(name)
        worn = wear or state.worn.get(name)
        depth = None if worn is None else scattered(worn.depth, side.points, self.model.mesh.n_points)
        return Configuration(
            self.displacement(u),
            self.displacement(state.u),
            Pose(self.obstacles_at(load, u).get(name, zero), load.angles.get(name, 0.0)),
            Pose(state.obstacles.get(name, zero), state.angles.get(name, 0.0)),
            load.clearance_factors.get(name, 1.0),
            state.never_opening.get(name),
            state.elastic_slip.get(name),
            depth,
            wear,
            state.bonds.get(name),
            load.fluids.get(name, 0.0),
            linearisation_point=None if self.linearised_at is None else self.displacement(self.linearised_at),
            friction_factor=load.friction_factors.get(name, 1.0),
        )

    def pairing_configuration(self, name: str, state: State, load: StepLoad, u: Array) -> Configuration:
        """Return the `configuration` in which the surfaces are paired: undeformed with `Criteria.keep_pairing`."""
        configuration = self.configuration(name, state, load, u)
        if self.criteria.keep_pairing:
            return replace(configuration, displacement=np.zeros_like(configuration.displacement))
        return configuration

    def deformed(
        self, u: Array, start: State, rise: Array | None, *, geometric: int = COMPLETE, tangent: bool = True
    ) -> DeformedBodies:
        """Return the nonlinear bodies at displacements u (n_dofs,) [length], see `NonlinearBodies.at`.

        `start` is the state at the beginning of the load step, and `rise` (n_points,) the temperature rise at its end
        [temperature].
        """
        assert self.bodies is not None
        initial_history = start.history or self.bodies.initial_history
        return self.bodies.at(self.displacement(u), initial_history, rise=rise, geometric=geometric, tangent=tangent)

    def initial_state(self) -> State:
        """Return the state before the first load step."""
        # Gaps are differences of coordinates, whose round-off limits their accuracy.
        round_off = 8 * np.finfo(float).eps * float(np.abs(self.model.mesh.points).max())
        zero, instant = np.zeros(self.force_driven.n_dofs), self.ramp.table[0][0]
        return State(zero, round_off, solver=self.initial_snapshot, work=Work(), instant=instant)


def linear_with_quadratic_cells(model: Model) -> bool:
    """Return whether a model of linear bodies has quadratic cells; see `linear.choice.make`."""
    return not model.nonlinear and any(elements.get(name).order == 2 for name in model.mesh.solids)


@parallel.on_one_blas_thread
def prepare(
    model: Model, ramp: Ramp, criteria: Criteria, *, linear_solver: str = "auto", linear_tolerance: float = TOLERANCE,
    linear_precision: str | None = None,
) -> Problem:  # fmt: skip
    """Return the discrete problem of a checked model: assemble the stiffness matrix, and prepare the linear solver.

    For the parameters see `run.solve`.
    """
    mesh, driven = model.mesh, model.force_driven
    supported, prescribed = model.prescribed_by_ramp()
    moved = np.any([values != 0.0 for values in prescribed.values()], axis=0) & supported
    for relation in model.relations:
        moving = np.flatnonzero(np.broadcast_to(relation.value, relation.rows.shape[0]))
        moved.flat[relation.rows[moving].indices] = True
    held = HeldMotions.of(supported, stacked_rows(model.relations, model.n_dofs), moved)
    pairs = {pair.name: model.bind(pair, held) for pair in model.contact}
    for name, options in ((name, pair.options) for name, pair in pairs.items() if criteria.keep_pairing):
        if isinstance(options.penalty, OverclosureLaw) or options.cohesion is not None or options.source is not None:
            raise ContactError(
                f"contact '{name}' has a table of penalties, a cohesive layer, adhesion, or a fluid, which require updates "
                "of the geometry: omit keep_pairing"
            )
    solver = choice.make(
        linear_solver, dim=mesh.dim, n_dofs=model.n_dofs, precision=linear_precision,
        tolerance=choice.limited_tolerance(linear_tolerance, criteria.relative),
        needs_columns=not all(pair.eliminable for pair in pairs.values()),
        has_quadratic_cells=linear_with_quadratic_cells(model),
    )  # fmt: skip
    field = model.material_field()
    solver.contrast = field.contrast
    sides = material_sides(mesh, field.distinct_materials)
    K = stiffness(mesh, model.kinematics, field.moduli, field.moduli_rows, None, field.treatment)
    warnings = stiffness_warnings(K, model.springs)
    K = with_springs(K, model.springs)
    fixed, relations = driven.supported(supported).ravel(), driven.relations(model.relations)
    system = System(driven.stiffness(K), fixed, relations, driven.without_stiffness)
    driven_points = mesh.n_points + np.arange(len(driven))
    side_points = [side.points for pair in pairs.values() for side in (pair.secondary, pair.primary)]
    points = np.unique(np.concatenate([driven_points, *side_points])).astype(np.intp)
    contact_dofs = (points[:, None] * mesh.dim + np.arange(mesh.dim)).ravel()
    motions = _floating_motions(model, supported)
    floating = FloatingBodies(motions, system, solver.iterative, model.springs) if len(motions) else None
    dofs = _prepared_dofs(model, solver, system, floating, contact_dofs)
    thermal = {} if model.nonlinear else model.thermal_forces_by_ramp()
    forces = sums_by_ramp([*model.forces_by_ramp().items(), *thermal.items(), *model.initial_forces_by_ramp().items()])
    return Problem(
        model, ramp, criteria, solver, pairs, field, sides, system, floating, dofs, contact_dofs, driven,
        driven.prescribed(prescribed), driven.forces(forces), solver.snapshot(), tuple(warnings),
        model.nonlinear_bodies(field), model.following_loads() if model.strain == "finite" else [],
        prepared_heat(model, ramp, criteria, linear_solver, solver.tolerance),
    )  # fmt: skip


def linearised(
    problem: Problem, K: bsr_array, u: Array, K_contact: csr_array | None, stiff_springs: bool, replaces_springs: bool
) -> Problem:
    """Return a problem whose system and linear solver use the tangent of the terms at displacements u.

    In finite strain, rigid-body modes of floating bodies are those of the deformed configuration.

    Parameters
    ----------
    problem : Problem
    K : bsr_array (n, n)
        Tangent of the terms, see `Terms.tangent`; it is modified [force / length].
    u : ndarray (n_dofs,)
        Displacements about which the terms are linearised [length].
    K_contact : csr_array (n_dofs, n_dofs), optional
        Stiffness due to contact, which is added to K [force / length].
    stiff_springs : bool
        Whether the springs of floating bodies are as stiff as the bodies.
    replaces_springs : bool
        Whether the springs of floating bodies are omitted if `K_contact` resists all their motions. For a nearly
        singular tangent, the iteration of positions with springs may not converge.
    """
    K, model, floating = problem.force_driven.stiffness(K), problem.model, problem.floating_bodies
    system = problem.system.with_stiffness(K if K_contact is None else sum_of_blocks(K, K_contact))
    solver, displacement = problem.solver.copy_for_similar_matrix(), problem.displacement(u)
    finite = problem.bodies and problem.bodies.finite
    if floating is not None and finite:
        motions = floating.motions
        if model.kinematics != "axisymmetric":
            rotated = _floating_motions(model, model.prescribed_by_ramp()[0], displacement)
            motions = rotated if len(rotated) == len(motions) else motions
        floating = FloatingBodies(motions, system, problem.solver.iterative and not stiff_springs, model.springs)
    if replaces_springs and floating is not None and K_contact is not None:
        modes = floating.motions.displacement
        values = np.linalg.eigvalsh(modes.T @ (K_contact @ modes))
        floating = None if values[0] > SINGLE_PRECISION * values[-1] else floating
    dofs = _prepared_dofs(model, solver, system, floating, problem.contact_dofs, displacement)
    point = u if finite else None
    return replace(problem, system=system, solver=solver, dofs=dofs, floating_bodies=floating, linearised_at=point)


def _floating_motions(model: Model, supported: Mask, displacement: Array | float = 0.0) -> FreeMotions:
    """Return the rigid-body modes that supports and multi-point constraints leave free.

    Rotations refer to the configuration displaced by `displacement` (n_points, dim) [length]; `supported` (n_points, dim)
    are the components that supports hold.
    """
    deformed = model.mesh.replace(points=model.mesh.points + displacement)
    motions = free_motions(deformed, model.kinematics, supported, model.constraint_rows())
    return model.force_driven.motions(motions)


def _prepared_dofs(
    model: Model, solver: LinearSolver, system: System, floating: FloatingBodies | None, contact_dofs: Indices,
    displacement: Array | float = 0.0,
) -> ActiveDofs:  # fmt: skip
    """Prepare the linear solver for a system, and return the degrees of freedom of the contact problem.

    They are those of the contact surfaces and of the springs of floating bodies if the solver condenses the stiffness
    matrix. Otherwise they are all degrees of freedom.

    Parameters
    ----------
    model : Model
    solver : LinearSolver
    system : System
    floating : FloatingBodies or None
        Floating bodies, whose springs are added to the matrix.
    contact_dofs : ndarray of int
        Degrees of freedom of the contact surfaces.
    displacement : ndarray (n_points, dim)
        Displacements at which the near null space is computed [length].
    """
    involved, matrix = system.involved_unknowns(contact_dofs), system.matrix
    if floating is not None:
        involved, matrix = np.union1d(involved, floating.dofs), floating.with_springs(matrix)
    modes = system.unknowns_of(model.force_driven.near_nullspace(near_nullspace(model, displacement)))
    retained = solver.prepare(matrix, modes, involved, release=True)
    if matrix is system.matrix:
        system.set_matrix(retained)
    springs = np.empty(0, np.intp) if floating is None else floating.dofs
    return ActiveDofs(system, contact_dofs, springs, involved if model.contact and solver.condenses else None)


def near_nullspace(model: Model, displacement: Array | float = 0.0) -> Array:
    """Return the near null space (n_dofs, k) for multigrid: the rigid-body modes of the mesh [-].

    Rotations refer to the configuration displaced by `displacement` (n_points, dim) [length]. One set of modes suffices for
    all bodies, because aggregates do not extend over several bodies. In axisymmetric models, motions in the plane are not
    rigid-body modes of the ring, but their energy is small away from the axis, so coarse spaces must contain them.
    """
    return rigid_modes(model.mesh.points + displacement, "plane_strain" if model.mesh.dim == 2 else model.kinematics)
