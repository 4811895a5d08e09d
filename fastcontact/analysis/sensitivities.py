"""Sensitivities: derivatives of one quantity with respect to many parameters from one adjoint solution.

At the end of a load step, ``K u = f + B.T multiplier`` and ``gap0 + B u + C multiplier = 0`` of the active constraints are
smooth equations as long as the active set does not change. The adjoint solution for a quantity, with the transposed matrix of
these equations, gives its derivative with respect to every parameter as a scalar product with the derivative of the residual
(Haftka and Gürdal, Elements of Structural Optimization, 1992, chapter 7).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from fastcontact._jit import parallel
from fastcontact._tools.argument_types import typed
from fastcontact._tools.html_table import fields_table
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.sensitivity.adjoint import Adjoint, Change, Gradient
from fastcontact.analysis.sensitivity.moving_contact import REMEDY, MovingContact
from fastcontact.analysis.sensitivity.parameters import change_by, check_parameter
from fastcontact.analysis.sensitivity.quantities import check_quantity, with_gradient
from fastcontact.analysis.sensitivity.settled_step import checked_margin, settled_step
from fastcontact.arrays import Array
from fastcontact.errors import ModelError
from fastcontact.model.model import Model
from fastcontact.model.ramp import RampLike, ramp_of
from fastcontact.results.step import StepResult
from fastcontact.round_off import TINY

# Largest effect of points between two facets on a derivative, relative to it.
BETWEEN = 1e-6


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of a quantity at the end of a load step.

    Attributes
    ----------
    value : float
        The quantity [its own unit].
    derivatives : dict
        By parameter, as a tuple, the derivative of the quantity [its unit by that of the parameter].
    margin : float
        How near the active set is to a change: the smallest of the multipliers of active constraints over the largest one of
        their pair, and of the gaps of open ones over the largest displacement; 1 where these are larger [-].
    solutions : int
        Linear solutions that the adjoint took: one, and those for the moving geometry of contact.

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
    """Return the derivatives of a quantity by parameters of the model, by one adjoint solution.

    The state at the end of the step is found again; its active set stands, and contact moves with the bodies. What a constant
    of a material changes in the forces, and displacements in the pairing, are central differences of these at the solution.

    Parameters
    ----------
    model : Model
    step : StepResult
        The last one that `solve` returned, or that a result file holds, with its `restart`.
    quantity : sequence
        ``("displacement", point, "y")``, of a point by its number, or by a group that holds it alone [length];
        ``("reaction", group, "y")``, the sum of the forces of supports on a group [force]; ``("contact_force", pair, "y")``,
        on the secondary side [force]; ``("pressure_max", pair)``, at the node where it is largest now, or
        ``("pressure", pair, point)`` [pressure].
    parameters : sequence of sequences
        ``("E", material)`` [pressure] and ``("nu", material)`` [-] of a `LinearElastic`, by a group that it was given to or
        by its number in the order of the model; of an `Orthotropic` with the axes, as ``("E", material, "1")``,
        ``("nu", material, "12")`` and ``("G", material, "12")`` [pressure]; ``("expansion", material)``, or
        ``("expansion", material, "1")`` along one axis [1 / temperature]; ``("load", group)``, the factor of all loads on a
        group, or of the force on a rigid obstacle by its name [-]; ``("speed", group)``, of its centrifugal forces
        [radian / time]; ``("temperature", group)``, the factor of the rise of its temperatures [-]; of these three also with
        ``"all solid cells"`` for what names no group; ``("pretension", name)``, the factor of the force or the shortening of
        a section [-]; ``("prescribed", group)``, the factor of the displacements prescribed on a group, or
        ``("prescribed", group, "y")`` of one component [-]; ``("motion", obstacle)``, the factor of its motion [-];
        ``("clearance", pair)``, a length added to the gap [length]. All factors are 1 now.
    ramp, criteria, linear_solver
        Those of `solve`.
    margin : float
        What `Sensitivities.margin` must be at least [-].

    Returns
    -------
    Sensitivities

    Raises
    ------
    ModelError
        If there is no such quantity or parameter; with friction, wear, or locked pretension sections, since results then
        depend on earlier steps; if an active constraint is about to open, or an open one to close; if nodes lie between two
        facets, so that there is one derivative to either side.

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
    asked = [tuple(parameter) for parameter in parameters]
    check_asked(model, quantity, parameters)
    problem, contact = settled_step(model, step, ramp_of(ramp), criteria or Criteria(), linear_solver)
    nearest = checked_margin(contact, margin) if problem.pairs else 1.0
    contact, gradient = with_gradient(contact, step, tuple(quantity))
    values, solutions = _derivatives(contact, gradient, [change_by(contact, parameter) for parameter in asked])
    return Sensitivities(gradient.value, dict(zip(asked, values.tolist(), strict=True)), nearest, solutions)


def check_asked(model: Model, quantity: Sequence[str | int], parameters: Sequence[Sequence[str | int]]) -> None:
    """Raise ModelError or MeshError if a model has no such quantity or parameter, see `sensitivities`."""
    model.refuse_nonlinear("sensitivities are")
    if model.conducts:
        raise ModelError("sensitivities are there without conduction of heat, which depends on the contact")
    check_quantity(model, tuple(quantity))
    for parameter in parameters:
        check_parameter(model, tuple(parameter))


def _derivatives(contact: MovingContact, gradient: Gradient, changes: Sequence[Change]) -> tuple[Array, int]:
    """Return the derivatives of a quantity with respect to parameters, and the number of linear solutions."""
    forward, backward = contact.derivatives()
    adjoint = Adjoint(contact, gradient, csr_array(0.5 * (forward + backward)))
    values = np.array([adjoint.derivative(change) for change in changes])
    kinks = contact.kinks(forward, backward)
    if kinks.nnz:
        other = Adjoint(contact, gradient, csr_array(0.5 * (forward + backward) + kinks))
        off = np.abs([other.derivative(change) for change in changes] - values)
        if (off > BETWEEN * np.abs(values)).any():
            raise ModelError(_between(contact, kinks, float((off / np.maximum(np.abs(values), TINY)).max())))
    return values, adjoint.solutions


def _between(contact: MovingContact, kinks: csr_array, off: float) -> str:
    mesh = contact.problem.model.mesh
    dofs = np.unique(kinks.indices)
    points = np.unique(dofs[dofs < contact.problem.model.n_dofs] // mesh.dim)
    named = ", ".join(f"{p} {np.array2string(mesh.points[p], precision=4)}" for p in points[:3])
    more = f" and {len(points) - 3} more" if len(points) > 3 else ""
    return (
        f"points {named}{more} lie opposite nodes of the other side, between two of its facets: to either side derivatives "
        f"differ by {off:.1e} of themselves. {REMEDY}; or keep the pairing (Criteria(keep_pairing=True)), mesh both sides "
        "differently, or take the default formulation"
    )
