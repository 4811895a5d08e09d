"""The discrete problem of an analysis: built once from a model and immutable."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from fastcontact._jit import parallel
from fastcontact.analysis.active_dofs import ActiveDofs, SurfaceDofs
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.floating_bodies import SOFT, FloatingBodies
from fastcontact.analysis.heat import Heat, prepared_heat
from fastcontact.analysis.slip import at_points
from fastcontact.analysis.state import State
from fastcontact.analysis.work import Work
from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.held_motions import HeldMotions
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.overclosure import OverclosureLaw
from fastcontact.elasticity.constrained_system import System
from fastcontact.elasticity.following_pressure import FollowingPressure
from fastcontact.elasticity.initial_states import InitialState
from fastcontact.elasticity.material_field import MaterialField
from fastcontact.elasticity.material_sides import MaterialSides, material_sides
from fastcontact.elasticity.multipoint_constraints import stacked_rows
from fastcontact.elasticity.nonlinear_bodies import WHOLE, DeformedBodies, NonlinearBodies
from fastcontact.elasticity.springs import stiffened, too_stiff
from fastcontact.elasticity.stiffness import rigid_modes, stiffness
from fastcontact.elasticity.temperature import Temperature
from fastcontact.errors import ContactError
from fastcontact.linear import choice
from fastcontact.linear.protocol import TOLERANCE, LinearSolver
from fastcontact.model.force_driven_obstacles import ForceDrivenObstacles
from fastcontact.model.model import Model
from fastcontact.model.obstacle_rotation import angle_at
from fastcontact.model.ramp import PartHistory, Ramp, Table, combined, multiplier
from fastcontact.model.rigid_motions import FreeMotions, free_motions

ByRamp = Mapping[PartHistory, Array]


@dataclass(frozen=True, eq=False)
class StepLoad:
    """The loads at the end of a load step.

    Attributes
    ----------
    lift : ndarray (n_dofs,)
        Displacements prescribed by supports and multi-point constraints, see `System.lift` [length].
    force : ndarray (n_dofs,)
        External forces [force].
    obstacles : dict of str to ndarray (dim,)
        Prescribed displacement of the rigid obstacle of each contact pair [length].
    clearance_factors : dict of str to float
        Factor on the clearances of each contact pair.
    angles : dict of str to float
        Rotation of the rigid obstacle of each contact pair, where one rotates [radian].
    following : tuple of float
        Factors of pressures that follow the surface.
    friction_factors : dict of str to float
        Factor on the coefficient of friction of each contact pair, where it varies.
    fluids : dict of str to float
        Fluid pressure at the source of each contact pair [pressure].
    rise : ndarray (n_points,), optional
        Temperature rise for the expansion of nonlinear bodies [temperature]; for linear ones it is part of the forces.
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


@dataclass(frozen=True, eq=False)
class Problem:
    """A model prepared for analysis.

    Attributes
    ----------
    model : Model
    ramp : Ramp
    criteria : Criteria
    solver : LinearSolver
        Linear solver with the stiffness matrix; its snapshot is part of the state.
    pairs : dict of str to Formulation
        The contact pairs.
    field : MaterialField
        Materials of all solid cells.
    system : System
        Stiffness, supports and multi-point constraints.
    floating_bodies : FloatingBodies, optional
        Bodies held by contact alone, if there are any.
    dofs : ActiveDofs
        The displacement components that a pairing solves for.
    contact_dofs : ndarray of int
        Components that constraints may involve.
    sides : MaterialSides
        Interfaces between materials, each of which has its own nodal stresses.
    force_driven : ForceDrivenObstacles
        Rigid obstacles that forces move.
    prescribed, forces : dict of ramp table to ndarray (n_points + n_driven, dim)
        By history, displacements [length] and nodal forces [force] at multiplier 1.
    solver_at_rest : dict
        The snapshot of the solver before the first step.
    doubtful : tuple of str
        Warnings about the stiffness.
    bodies : NonlinearBodies, optional
        The solid cells, where they are nonlinear; `system` and `solver` then hold their stiffness before any load.
    following : sequence of (FollowingPressure, ramp table)
        Pressures in finite strain; `forces` contain them in the undeformed configuration.
    heat : Heat, optional
        Heat conduction, if any.
    linearised_at : ndarray (n_dofs,), optional
        Displacements at which `system` is the tangent of bodies in finite strain [length].
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
    solver_at_rest: Mapping[str, Any]
    doubtful: tuple[str, ...] = ()
    bodies: NonlinearBodies | None = None
    following: Sequence[tuple[FollowingPressure, Table | None]] = ()
    heat: Heat | None = None
    linearised_at: Array | None = None

    @cached_property
    def material_of_cells(self) -> Numbers:
        """Material number of every solid cell (n_solids,); equal materials have one number."""
        return np.concatenate(list(self.field.distinct.values()))

    @property
    def shape(self) -> tuple[int, int]:
        """Number of points, those of driven obstacles included, and dimension."""
        return self.force_driven.n_dofs // self.model.mesh.dim, self.model.mesh.dim

    def load_at(self, instant: float) -> StepLoad:
        """Return the loads at an instant of the ramp."""
        prescribed = combined(self.prescribed, self.ramp, instant, self.shape)
        factors = [multiplier(relation.ramp, self.ramp, instant) for relation in self.model.relations]
        lift = self.system.lift(prescribed.ravel(), self.system.values(factors))
        obstacles, clearances, angles, frictions = {}, {}, {}, {}
        for pair in self.model.contact:
            side = self.pairs[pair.name].primary
            if isinstance(side, RigidSide):
                obstacles[pair.name] = multiplier(pair.ramp, self.ramp, instant) * side.motion
            if pair.rotation is not None:
                angles[pair.name] = angle_at(pair, self.ramp, instant)
            if pair.clearance_ramp is not None:
                clearances[pair.name] = multiplier(pair.clearance_ramp, self.ramp, instant)
            if pair.friction_ramp is not None:
                frictions[pair.name] = multiplier(pair.friction_ramp, self.ramp, instant)
        force = combined(self.forces, self.ramp, instant, self.shape).ravel()
        following = tuple(multiplier(table, self.ramp, instant) for _, table in self.following)
        fluids = {
            pair.name: pair.fluid.pressure * multiplier(pair.fluid.ramp, self.ramp, instant)
            for pair in self.model.contact if pair.fluid is not None
        }  # fmt: skip
        temperatures, rise = self.model.temperatures, None
        if self.bodies is not None:
            rise = self.model.temperature_rise(self.factors(temperatures, instant))
        return StepLoad(lift, force, obstacles, clearances, angles, following, frictions, fluids, rise)

    def factors(self, histories: Iterable[Temperature | InitialState], instant: float) -> list[float]:
        """Return the load factors of temperatures or initial states at an instant of the ramp [-]."""
        return [multiplier(history.ramp, self.ramp, instant) for history in histories]

    def displacement(self, u: Array) -> Array:
        """Return the displacements (n_points, dim) of the mesh in all displacements u (n_dofs,) [length]."""
        return u[: self.model.n_dofs].reshape(-1, self.model.mesh.dim)

    def accurate_to(self, u: Array) -> Array:
        """Return the lengths (n_dofs,) to whose round-off displacements u (n_dofs,) are accurate [length].

        These are the displacements themselves, or coordinates where bodies rotate and displacements are their differences.
        """
        if self.bodies is None or not self.bodies.finite:
            return u
        places, sizes = self.model.mesh.points, np.abs(u)
        sizes[: places.size] += np.abs(places - places.mean(axis=0)).ravel()
        return sizes

    def obstacles_at(self, load: StepLoad, u: Array) -> dict[str, Array]:
        """Return the displacement (dim,) of the rigid obstacle of each contact pair; u holds force-driven ones."""
        return {**load.obstacles, **self.force_driven.positions(u)}

    def configuration(self, name: str, state: State, load: StepLoad, displacement: Array, u: Array) -> Configuration:
        """Return the configuration of a contact pair.

        Parameters
        ----------
        name : str
            Name of the pair.
        state : State
            State at the beginning of the load step.
        load : StepLoad
        displacement : ndarray (n_points, dim)
            Displacement of the mesh [length].
        u : ndarray (n_dofs,)
            All displacements, including those of force-driven obstacles [length].
        """
        still, worn = np.zeros(self.model.mesh.dim), state.worn.get(name)
        return Configuration(
            displacement,
            self.displacement(state.u),
            self.obstacles_at(load, u).get(name, still),
            state.obstacles.get(name, still),
            load.clearance_factors.get(name, 1.0),
            state.never_opening.get(name),
            state.elastic_slip.get(name),
            load.angles.get(name, 0.0),
            state.angles.get(name, 0.0),
            None
            if worn is None
            else at_points(self.pairs[name].secondary.points, worn.depth, self.model.mesh.n_points),
            state.bonds.get(name),
            load.fluids.get(name, 0.0),
            linearised=None if self.linearised_at is None else self.displacement(self.linearised_at),
            friction_factor=load.friction_factors.get(name, 1.0),
        )

    def deformed(
        self, u: Array, start: State, rise: Array | None, *, geometric: int = WHOLE, tangent: bool = True
    ) -> DeformedBodies:
        """Return `NonlinearBodies.at` displacements u (n_dofs,) [length], in a load step that begins at `start`.

        `rise` (n_points,) is the temperature rise at the end of the step [temperature].
        """
        assert self.bodies is not None
        before = start.history or self.bodies.beginning
        return self.bodies.at(self.displacement(u), before, rise=rise, geometric=geometric, tangent=tangent)

    def initial_state(self) -> State:
        """Return the state before the first load step."""
        # Gaps are differences of coordinates, and no more accurate than these.
        round_off = 8 * np.finfo(float).eps * float(np.abs(self.model.mesh.points).max())
        return State(
            np.zeros(self.force_driven.n_dofs),
            round_off,
            solver=self.solver_at_rest,
            work=Work(),
            instant=self.ramp.table[0][0],
        )


@parallel.on_one_blas_thread
def prepare(
    model: Model,
    ramp: Ramp,
    criteria: Criteria,
    *,
    linear_solver: str = "auto",
    linear_tolerance: float = TOLERANCE,
    linear_precision: str | None = None,
) -> Problem:
    """Assemble a checked model, and prepare the linear solver; see `run.solve` for the parameters."""
    mesh, driven = model.mesh, model.force_driven
    supported, prescribed = model.prescribed_by_ramp()
    held = HeldMotions.of(supported, stacked_rows(model.relations, model.n_dofs))
    pairs = {pair.name: model.bind(pair, held) for pair in model.contact}
    for name, pair in pairs.items():
        table = isinstance(pair.options.penalty, OverclosureLaw)
        if criteria.keep_pairing and (table or pair.options.cohesion is not None or pair.options.source is not None):
            raise ContactError(
                f"contact '{name}' has a table of penalties, a cohesive layer, adhesion, or a fluid, which updates of the "
                "geometry follow: leave keep_pairing out"
            )
    solver = choice.make(
        linear_solver, dim=mesh.dim, n_dofs=model.n_dofs, precision=linear_precision,
        tolerance=choice.tight_enough(linear_tolerance, criteria.relative),
        columns=not all(pair.eliminable for pair in pairs.values()),
    )  # fmt: skip
    field = model.material_field()
    solver.contrast = field.contrast
    sides = material_sides(mesh, field.distinct)
    K = stiffness(mesh, model.kinematics, field.moduli, field.loops, None, field.treatment)
    doubtful = too_stiff(K, model.springs)
    K = stiffened(K, model.springs)
    system = System(
        driven.stiffness(K),
        driven.supported(supported).ravel(),
        driven.relations(model.relations),
        driven.without_stiffness,
    )
    contact_dofs = _contact_dofs(mesh, pairs, len(driven))
    involved = system.involved(contact_dofs)
    motions = floating_motions(model, supported)
    bodies = FloatingBodies(motions, system, SOFT) if len(motions) else None
    involved = prepare_solver(solver, system, bodies, driven.near_nullspace(near_nullspace(model)), involved)
    return Problem(
        model, ramp, criteria, solver, pairs, field, sides, system, bodies,
        active_dofs(system, contact_dofs, involved, pairs, bodies, solver),
        contact_dofs, driven, driven.prescribed(prescribed), driven.forces(_forces(model)),
        solver.snapshot(), tuple(doubtful), model.nonlinear_bodies(field), model.following_pressures(),
        prepared_heat(model, ramp, criteria, linear_solver, solver.tolerance),
    )  # fmt: skip


def floating_motions(model: Model, supported: Mask, displacement: Array | float = 0.0) -> FreeMotions:
    """Return the rigid-body modes that supports and constraints leave free, at a `displacement` (n_points, dim) [length]."""
    deformed = model.mesh.replace(points=model.mesh.points + displacement)
    motions = free_motions(deformed, model.kinematics, supported, model.holding_rows())
    return model.force_driven.motions(motions)


def active_dofs(
    system: System, contact_dofs: Indices, involved: Indices, pairs: Mapping[str, Formulation],
    bodies: FloatingBodies | None, solver: LinearSolver,
) -> ActiveDofs:  # fmt: skip
    """Return the displacement components that a pairing solves for."""
    if pairs and bodies is None and solver.condenses:
        return SurfaceDofs(system, contact_dofs, involved)
    return ActiveDofs(system, contact_dofs)


def _forces(model: Model) -> dict[Table | None, Array]:
    """Return the nodal forces (n_points, dim) of loads, heat and initial states at multiplier 1, by history [force].

    In nonlinear bodies thermal expansion enters the strains, not the forces.
    """
    forces = model.forces_by_ramp()
    thermal = {} if model.nonlinear else model.thermal_forces_by_ramp()
    for table, values in (*thermal.items(), *model.initial_forces_by_ramp().items()):
        forces[table] = forces[table] + values if table in forces else values
    return forces


def prepare_solver(
    solver: LinearSolver, system: System, bodies: FloatingBodies | None, modes: Array, involved: Indices
) -> Indices:
    """Set the matrix of the linear solver, with the springs of floating bodies; return the unknowns of contact."""
    matrix = system.matrix if bodies is None else bodies.with_springs(system.matrix)
    if bodies is not None:
        involved = np.union1d(involved, bodies.dofs)
    modes = system.unknowns_of(modes)  # releases those of all displacements
    kept = solver.prepare(matrix, modes, involved, release=True)
    if matrix is system.matrix:
        system.keep(kept)
    return involved


def _contact_dofs(mesh: Any, pairs: Mapping[str, Formulation], n_driven: int) -> Indices:
    """Return the displacement components of all points on contact surfaces, and of force-driven obstacles."""
    sides = [side.points for pair in pairs.values() for side in (pair.secondary, pair.primary)]
    points = np.unique(np.concatenate(sides)) if sides else np.empty(0, np.intp)
    moved = mesh.n_points + np.arange(n_driven)
    return (np.concatenate([points, moved])[:, None].astype(np.intp) * mesh.dim + np.arange(mesh.dim)).ravel()


def near_nullspace(model: Model, displacement: Array | float = 0.0) -> Array:
    """Return the near null space (n_dofs, k) for multigrid: rigid-body modes of the mesh [-].

    Rotational modes are those at a `displacement` (n_points, dim) [length].

    One set suffices for all bodies, since aggregates do not span several. In axisymmetry the in-plane motions are no
    rigid-body modes of the ring, but away from the axis their energy is small, and aggregates of two unknowns per node need
    them.
    """
    return rigid_modes(model.mesh.points + displacement, "plane_strain" if model.mesh.dim == 2 else model.kinematics)
