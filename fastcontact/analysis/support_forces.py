"""Reaction resultants by support group, spring forces, and bolt forces over the load history."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack
from scipy.sparse.linalg import lsqr

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array, Mask
from fastcontact.elasticity.springs import ground_force
from fastcontact.errors import ModelError
from fastcontact.model.model import Model
from fastcontact.results.step import StepResult


@typed(ModelError)
def support_forces(model: Model, step: StepResult) -> dict[str, Array]:
    """Return the resultant support force of each group with supports.

    Unlike `StepResult.reaction`, it excludes the forces of multi-point constraints and of springs to the ground. A
    component that several groups support at a node is assigned to the first of them, so that the sum over the groups
    is complete.

    Parameters
    ----------
    model : Model
    step : StepResult
        A result of this model.

    Returns
    -------
    dict of str to ndarray (dim,)
        [force]; in axisymmetry over the full circle.

    Raises
    ------
    ModelError
        If the step is of another model.

    Examples
    --------
    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.block(), kinematics="plane_stress")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    >>> model.fix("BOTTOM", "y")
    >>> model.fix("BOTTOM_LEFT", "x")
    >>> model.add_pressure("TOP", 2.0)
    >>> step = fc.solve(model, 1)[-1]
    >>> fc.support_forces(model, step)["BOTTOM"].round(9)
    array([0., 2.])
    """
    _check(model, step)
    n, (held, _) = model.n_dofs, model.prescribed()
    related = [relation for _, relation in model.related_supports]
    coupling = [relation for relation in model.relations if not any(relation is other for other in related)]
    reaction = step.reaction.ravel() - ground_force(model.springs, step.displacement.ravel())
    rows = [relation.rows for relation in (*related, *coupling)]
    rows += [section.row(n) for section in model.pretensions]  # a locked section transmits a force like a constraint
    forces = multipliers(reaction, rows, held.ravel())
    reaction = reaction - sum((R.T @ force for R, force in zip(rows, forces, strict=True)), np.zeros(n))
    by_support: dict[str, Array] = {}
    left = np.where(held, reaction.reshape(held.shape), 0.0)
    for support in model.supports:
        nodes, k = model.mesh.points_of(support.group), support.component
        by_support.setdefault(support.group, np.zeros(held.shape[1]))[k] += left[nodes, k].sum()
        left[nodes, k] = 0.0
    for (group, relation), force in zip(model.related_supports, forces, strict=False):
        resultant = (relation.rows.T @ force).reshape(held.shape).sum(axis=0)
        by_support[group] = by_support.get(group, 0.0) + resultant
    return by_support


def multipliers(reaction: Array, rows: Sequence[csr_array], held: Mask) -> list[Array]:
    """Return the Lagrange multipliers (m,) of multi-point constraints with rows (m, n_dofs) [force].

    They follow from the balance of forces at components without supports. `reaction` (n_dofs,) contains the forces of
    supports and constraints [force], and `held` (n_dofs,) marks the components with supports.
    """
    if not rows:
        return []
    free = csr_array(csr_array(vstack(rows, format="csr"))[:, np.flatnonzero(~held)])
    multiplier = lsqr(free.T, reaction[~held], atol=1e-14, btol=1e-14, iter_lim=20 * sum(free.shape))[0]
    return np.split(multiplier, np.cumsum([block.shape[0] for block in rows])[:-1])


@typed(ModelError)
def spring_forces(model: Model, step: StepResult) -> dict[str, Array]:
    """Return the tensions of the springs by name, such as ``"spring on 'TOP'"``.

    Parameters
    ----------
    model : Model
    step : StepResult
        A result of this model.

    Returns
    -------
    dict of str to ndarray (m,)
        Tensions of the m springs of each name, positive in tension [force].

    Raises
    ------
    ModelError
        If the step is of another model.

    Examples
    --------
    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.block(divisions=(1, 1)), kinematics="plane_stress")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    >>> model.fix("LEFT", "x")
    >>> model.add_spring("BOTTOM", y=50.0)
    >>> model.add_pressure("TOP", 2.0)
    >>> step = fc.solve(model, 1)[-1]
    >>> {name: tension.round(9) for name, tension in fc.spring_forces(model, step).items()}
    {"spring on 'BOTTOM'": array([-1., -1.])}
    """
    _check(model, step)
    forces: dict[str, Array] = {}
    for spring in model.springs:
        name, tension = spring.name.removeprefix("the "), spring.tension(step.displacement)
        forces[name] = np.concatenate([forces[name], tension]) if name in forces else tension
    return forces


def pretension_history(steps: Iterable[StepResult]) -> NDArray[np.void]:
    """Return force and shortening of every pretension section as a table, one row for each load step, for `write_csv`.

    Parameters
    ----------
    steps : iterable of StepResult

    Returns
    -------
    structured ndarray (n_steps,)
        ``step``, ``load_factor``; for each section ``NAME_force``, positive in tension [force], and ``NAME_shortening``
        [length]; NaN in steps without it.

    Examples
    --------
    See `Model.add_pretension`.

    >>> import fastcontact as fc
    >>> fc.write_csv("bolts.csv", fc.pretension_history(steps))  # doctest: +SKIP
    """
    steps = list(steps)
    names = list(dict.fromkeys(name for step in steps for name in step.pretension))
    columns_of = [(name, kind) for name in names for kind in ("force", "shortening")]
    rows = [
        (step.index, step.load_factor, *(step.pretension.get(name, {}).get(kind, np.nan) for name, kind in columns_of))
        for step in steps
    ]
    columns = [(f"{name}_{kind}", float) for name, kind in columns_of]
    return np.array(rows, [("step", int), ("load_factor", float), *columns])


def _check(model: Model, step: StepResult) -> None:
    if step.displacement.shape != model.mesh.points.shape:
        raise ModelError(
            f"load step {step.index} has {len(step.displacement)} points and the model {model.mesh.n_points}: pass the model "
            "of this step"
        )
