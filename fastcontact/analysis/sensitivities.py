"""Sensitivities: derivatives of one quantity with respect to many parameters from one adjoint solution.

At the end of a load step, equilibrium ``K u = f + B.T multiplier`` and the active constraints
``gap0 + B u + C multiplier = 0``, with the compliance C of the contact, are smooth equations as long as the active set does
not change. The adjoint solution for a quantity, with the transposed matrix of these equations, gives its derivative with
respect to every parameter as a scalar product with the derivative of the residual (Haftka and Gürdal, Elements of Structural
Optimization, 1992, chapter 7).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from fastcontact._jit import parallel
from fastcontact._tools.argument_types import typed
from fastcontact._tools.html_table import fields_table
from fastcontact.analysis import restart
from fastcontact.analysis.convergence_messages import first_points, named_nodes, nearest_nodes
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.load_step import prepare_start
from fastcontact.analysis.newton import newton
from fastcontact.analysis.problem import Problem, prepare
from fastcontact.analysis.sensitivity.adjoint import Adjoint, Change, Gradient
from fastcontact.analysis.sensitivity.moving_contact import OPPOSITE_NODES, REMEDY, MovingContact
from fastcontact.analysis.sensitivity.parameters import KINDS, check_parameter
from fastcontact.analysis.sensitivity.quantities import check_quantity, with_gradient
from fastcontact.analysis.solution import Solution
from fastcontact.analysis.stages import stage_of
from fastcontact.arrays import Array
from fastcontact.elasticity.multipoint_constraints import TemporaryConstraint
from fastcontact.errors import ModelError
from fastcontact.model.model import Model
from fastcontact.model.ramp import Ramp, RampLike, ramp_of
from fastcontact.results.step import StepResult
from fastcontact.round_off import SINGLE_PRECISION, TINY


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of a quantity at the end of a load step.

    Attributes
    ----------
    value : float
        Value of the quantity [its unit].
    derivatives : dict
        Derivative of the quantity for each parameter, as a tuple [unit of the quantity per unit of the parameter].
    margin : float
        Distance of the active set from a change: the smallest multiplier of an active constraint relative to the
        largest one of its pair, or the smallest open gap relative to the largest displacement, whichever is smaller;
        at most 1 [-].
    solutions : int
        Number of linear solutions: one for the adjoint problem, and those for the variation of the contact geometry.

    Examples
    --------
    See `sensitivities`.

    >>> import fastcontact as fc
    >>> result = fc.sensitivities(model, step, ("pressure_max", "hertz"), [("E", "BLOCK")])  # doctest: +SKIP
    >>> result.derivatives["E", "BLOCK"]  # doctest: +SKIP
    """

    value: float
    derivatives: dict[tuple[str | int, ...], float]
    margin: float
    solutions: int

    _repr_html_ = fields_table


@typed(ModelError)
@parallel.on_one_blas_thread
def sensitivities(
    model: Model,
    step: StepResult,
    quantity: Sequence[str | int],
    parameters: Sequence[Sequence[str | int]],
    *,
    ramp: RampLike | None = None,
    criteria: Criteria | None = None,
    linear_solver: str = "auto",
    margin: float = 1e-6,
) -> Sensitivities:
    """Return the derivatives of a quantity with respect to parameters of the model, by one adjoint solution.

    The state at the end of the step is recomputed. Its active set is held fixed, and the contact geometry varies with
    the displacements. Derivatives of internal forces with respect to material constants are central differences at the
    solution; so are those of mortar contact between bodies with respect to the displacements at which they are paired.

    Parameters
    ----------
    model : Model
    step : StepResult
        The last step that `solve` returned, or the last one of a result file, with its `restart`.
    quantity : sequence
        ``("displacement", point, "y")``, where the point is a number or a group of one point [length]; ``("reaction",
        group, "y")``, the sum of the support forces on a group [force]; ``("contact_force", pair, "y")``, on the
        secondary side [force]; ``("pressure_max", pair)``, at the node of the largest pressure, or ``("pressure",
        pair, point)`` [pressure].
    parameters : sequence of sequences
        ``("E", material)`` [pressure] and ``("nu", material)`` [-] of a `LinearElastic`, where `material` is one of its
        groups or its number in the model; for an `Orthotropic` with the numbers of the axes, such as ``("E", material,
        "1")``, ``("nu", material, "12")`` and ``("G", material, "12")`` [pressure]; ``("expansion", material)``, or
        ``("expansion", material, "1")`` along one axis [1 / temperature]; ``("load", group)``, the factor of all loads
        on a group [-]; ``("load", obstacle)``, the factor of the force on a rigid obstacle [-]; ``("speed", group)``, the
        angular speed of centrifugal forces [radian / time]; ``("temperature", group)``, the factor of the temperature
        rise [-]; ``("pretension", name)``, the factor of the force or the shortening of a section [-]; ``("prescribed",
        group)``, the factor of the displacements prescribed on a group, or ``("prescribed", group, "y")`` of one
        component [-]; ``("motion", obstacle)``, the factor of its motion [-]; ``("clearance", pair)``, a length added
        to the gap [length]. All factors have the value 1. For loads, speeds and temperatures that are defined without a
        group, the group is ``"all solid cells"``.
    ramp, criteria, linear_solver
        As for `solve`.
    margin : float
        Smallest admissible `Sensitivities.margin` [-].

    Returns
    -------
    Sensitivities

    Raises
    ------
    ModelError
        If there is no such quantity or parameter; with nonlinear bodies or heat conduction; with friction, wear, or
        locked pretension sections, since results then depend on earlier steps; if an active constraint is about to open
        or an open one to close; if a node projects onto the edge between two facets, and the one-sided derivatives
        differ there.

    Examples
    --------
    The force on a block between rigid planes is proportional to its modulus:

    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0), "BLOCK")
    >>> model.fix("LEFT", "x")
    >>> floor = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    >>> model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor)
    >>> model.prescribe("TOP", y=-0.001)
    >>> step = fc.solve(model, 1)[-1]
    >>> result = fc.sensitivities(model, step, ("contact_force", "floor", "y"), [("E", "BLOCK")], ramp=1)
    >>> round(result.value, 9), round(result.derivatives["E", "BLOCK"], 9)
    (1.0, 0.001)
    """
    keys = [tuple(parameter) for parameter in parameters]
    check_arguments(model, quantity, parameters)
    problem, contact = recomputed_step(model, step, ramp_of(ramp), criteria or Criteria(), linear_solver)
    distance = checked_margin(contact, margin) if problem.pairs else 1.0
    contact, gradient = with_gradient(contact, step, tuple(quantity))
    changes = [KINDS[str(parameter[0])][2](contact, parameter) for parameter in keys]
    values, solutions = _derivatives(contact, gradient, changes)
    return Sensitivities(gradient.value, dict(zip(keys, values.tolist(), strict=True)), distance, solutions)


def check_arguments(model: Model, quantity: Sequence[str | int], parameters: Sequence[Sequence[str | int]]) -> None:
    """Raise ModelError or MeshError if a model has no such quantity or parameter, see `sensitivities`."""
    model.refuse_nonlinear("sensitivities are")
    if model.conducts:
        raise ModelError("sensitivities are not available with heat conduction, which depends on the contact")
    check_quantity(model, tuple(quantity))
    for parameter in parameters:
        check_parameter(model, tuple(parameter))


def _derivatives(contact: MovingContact, gradient: Gradient, changes: Sequence[Change]) -> tuple[Array, int]:
    """Return the derivatives of a quantity with respect to parameters, and the number of linear solutions."""
    forward, backward = contact.derivatives([change.lift for change in changes])
    adjoint = Adjoint(contact, gradient, csr_array(0.5 * (forward + backward)))
    values = adjoint.derivatives(changes)
    kinks = contact.kinks(forward, backward)
    if kinks.nnz:
        with_kinks = Adjoint(contact, gradient, csr_array(0.5 * (forward + backward) + kinks))
        jumps = np.abs(with_kinks.derivatives(changes) - values)
        # One-sided derivatives differ where points project onto edges between facets.
        if (jumps > SINGLE_PRECISION * np.abs(values)).any():
            raise ModelError(_kink_message(contact, kinks, float((jumps / np.maximum(np.abs(values), TINY)).max())))
    return values, adjoint.solutions


def _kink_message(contact: MovingContact, kinks: csr_array, jump: float) -> str:
    mesh = contact.problem.model.mesh
    dofs = np.unique(kinks.indices)
    points = np.unique(dofs[dofs < contact.problem.model.n_dofs] // mesh.dim)
    return (
        f"{first_points(mesh, points.tolist())} lie opposite nodes of the other side, between two of its facets: the "
        f"one-sided derivatives differ by a relative amount of {jump:.1e}. {OPPOSITE_NODES}"
    )


def recomputed_step(
    model: Model, step: StepResult, ramp: Ramp, criteria: Criteria, linear_solver: str
) -> tuple[Problem, MovingContact]:
    """Return the problem of a step, and the contact at its end with fixed multipliers.

    Raises
    ------
    ModelError
        If the step belongs to another case, or depends on earlier ones.
    """
    _check_independent_of_path(model, step, criteria)
    case = restart.identity(model, ramp, criteria)
    restart.check(step, case, model)
    model.check(ramp)
    problem = prepare(stage_of(model, step), ramp, criteria, linear_solver=linear_solver)
    closed_pairs = frozenset(name for name, contact in step.contact.items() if contact.active.any())
    state, load = restart.put_back(problem, step, closed_pairs), problem.load_at(step.load_factor)
    state = replace(state, obstacles=problem.obstacles_at(load, state.u))
    equilibrium = newton(prepare_start(problem, state, step.index, load))
    u, no_values, inactive, pressures = equilibrium.u, np.empty(0), np.empty(0, bool), dict[str, Array]()
    solution = Solution.frictionless(u, no_values, no_values, inactive, inactive)
    if equilibrium.settled is not None:
        solution, pressures = equilibrium.settled.solution, equilibrium.settled.iterate.pressure
    return problem, MovingContact(problem, state, load, step.load_factor, u, solution, pressures)


def _check_independent_of_path(model: Model, step: StepResult, criteria: Criteria) -> None:
    meanings = {"friction": "friction", "wear": "wear", "cohesion": "a cohesive layer", "adhesion": "adhesion"}
    for pair in model.contact:
        for option, meaning in meanings.items():
            if pair.options.get(option):
                raise ModelError(
                    f"contact '{pair.name}' has {meaning}: its results depend on all load steps, and sensitivities consider "
                    f"a single step. Use finite differences of two solutions, or omit {option}"
                )
        if pair.fluid is not None:
            raise ModelError(f"contact '{pair.name}' has a fluid, which sensitivities do not support: omit it")
        if pair.options.get("kind") == "bilateral_once_closed":
            raise ModelError(
                f"contact '{pair.name}' keeps nodes closed that closed in earlier load steps, and sensitivities consider a "
                "single step. Use finite differences of two solutions"
            )
    begin = float(np.nextafter(step.load_factor, -np.inf))
    if any(isinstance(relation, TemporaryConstraint) and relation.acts_from(begin) for relation in model.relations):
        raise ModelError(
            "pretension sections or temporary supports hold positions from earlier load steps, and sensitivities consider a "
            "single step. Request sensitivities before the positions are held, or use finite differences of two solutions"
        )
    if criteria.geometry_updates is not None and not criteria.keep_pairing:
        raise ModelError(
            f"after a fixed number of geometry updates ({criteria.geometry_updates}) contact detection has not "
            "converged: omit geometry_updates, or keep the pairing (keep_pairing)"
        )


def checked_margin(contact: MovingContact, margin: float) -> float:
    """Return the distance of the active set from a change, see `Sensitivities.margin`.

    Raises
    ------
    ModelError
        If this distance is less than `margin`.
    """
    constraints, solution = contact.constraints, contact.solution
    largest_u = float(np.abs(contact.u).max(initial=0.0))
    gap = constraints.gap0 + constraints.B @ contact.u
    distance = np.full(len(constraints), np.inf)
    for name, rows in constraints.rows.items():
        active, usable = solution.active[rows], constraints.usable[rows]
        # Forces are divided by areas, since the force of a constraint with a small area is small.
        areas = constraints.parts[name].areas
        force = solution.multiplier[rows] / (1.0 if areas is None else areas)
        largest_force = float(np.abs(force).max(initial=0.0)) or 1.0
        distance[rows] = np.where(active, force / largest_force, np.where(usable, gap[rows] / largest_u, np.inf))
    distance[constraints.equality] = np.inf
    critical = np.flatnonzero(~(distance >= margin))
    if len(critical):
        nodes = nearest_nodes(contact.problem, constraints, critical)
        largest_distance = float(np.abs(distance[critical]).max())
        closed = solution.active[critical]
        change = "open" if closed.all() else "close" if not closed.any() else "open or close"
        count_text = "1 constraint is" if len(critical) == 1 else f"{len(critical)} constraints are"
        raise ModelError(
            f"{count_text} about to {change}, at {named_nodes(contact.problem, nodes)}: forces or gaps are "
            f"{largest_distance:.1e} of the largest, less than margin = {margin:g}. The one-sided derivatives differ there. "
            f"{REMEDY}"
        )
    return min(1.0, float(distance.min(initial=1.0)))
