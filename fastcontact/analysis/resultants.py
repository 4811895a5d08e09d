"""Contact summary: resultants, area, mean gap, frictional work, wear; forces of supports, springs and bolts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array, vstack
from scipy.sparse.linalg import lsqr

from fastcontact._tools.argument_types import typed
from fastcontact._tools.html_table import fields_table
from fastcontact.analysis.wear import wear_depth_in_step
from fastcontact.arrays import Array, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.integration import lumped_areas
from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.elasticity.springs import ground_force
from fastcontact.errors import ContactError, ModelError, check_known
from fastcontact.model.model import Model
from fastcontact.results.step import ContactResult, StepResult


@typed(ContactError)
def contact_moment(contact: ContactResult, about: ArrayLike | None = None) -> Array:
    """Return the moment of the contact forces on the secondary side about a point.

    In finite strain, the forces act at the deformed positions of the nodes, otherwise at their reference coordinates.

    Parameters
    ----------
    contact : ContactResult
    about : array_like (dim,), optional
        Point of reference, by default the middle of the contact, in finite strain displaced like the nearest node [length].

    Returns
    -------
    ndarray (1,) or (3,)
        In the plane about z, in 3D about x, y and z [force times length]. Meaningless in axisymmetry, where the moment
        over the full circle is zero.

    Raises
    ------
    ContactError
        If the point of reference does not have one finite coordinate per dimension.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.block_on_block()
    >>> model = fc.Model(mesh, kinematics="plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    >>> model.fix("LOWER_BOTTOM", "xy")
    >>> model.fix("UPPER_LEFT", "x")
    >>> model.add_pressure("UPPER_TOP", 2.0)
    >>> model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER")
    >>> steps = fc.solve(model, 2)
    >>> fc.contact_moment(steps[-1].contact["joint"], about=(0.0, 5.0)).round(6)
    array([100.])
    """
    if about is None:
        nearest = np.abs(contact.place).argmin()
        centre = contact.middle + (contact.positions - contact.coordinates)[nearest]
    else:
        centre = np.asarray(about, float)
    if centre.shape != (contact.coordinates.shape[1],) or not np.isfinite(centre).all():
        raise ContactError(f"the moment of contact '{contact.name}' about {about!r} needs one number per dimension")
    arm, force = contact.positions - centre, contact.force_vectors
    if arm.shape[1] == 2:
        return np.array([float((arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]).sum())])
    return np.asarray(np.cross(arm, force).sum(axis=0))


@dataclass(frozen=True, eq=False)
class ContactResultants:
    """Contact summary of one pair in one load step.

    Attributes
    ----------
    force : ndarray (dim,)
        Resultant force on the secondary side, including that of a fluid [force].
    moment : ndarray (1,) or (3,)
        Moment of the contact forces about the middle of the contact, including those of a fluid, see `contact_moment`;
        zero in axisymmetry [force times length].
    area : float
        Contact area: sum of the tributary areas of the closed nodes, in finite strain on the deformed facets; in 2D
        a length times unit thickness, in axisymmetry over the full circle [length^2]. Its error is up to one row of facets
        along the edge, and it is usually too large: in 3D by 6 % with 9 facets across the radius, and by 18 % with 4.
        Mortar contact between bodies leaves out the parts of facets without an opposite side.
    centre : ndarray (dim,)
        Centre of pressure of the normal forces, in finite strain on the deformed surface; NaN without contact [length]. In
        axisymmetry its radial component is NaN, since the resultant acts along the axis.
    normal_force : float
        Sum of the nodal forces without those of a fluid, each along its own normal [force]. Multiplied by the coefficient
        of friction, it is the friction capacity of a press fit, whose resultant force vanishes.
    mean_gap : float
        Mean gap over the area that faces the other side [length]; NaN if there is none.
    pressure_mean, pressure_max : float
        Normal force divided by area, and the largest nodal pressure, both without the pressure of a fluid [pressure].
    dissipation, friction_work : float
        Work of friction in this step, and accumulated over all steps [energy].
    worn_volume : float
        Volume worn off the secondary side in all steps; zero without the option ``wear`` of the pair [length^3]. In 2D it
        is per unit thickness [length^2]; in axisymmetry it is that of the full circle.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.block_on_block()
    >>> model = fc.Model(mesh, kinematics="plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    >>> model.fix("LOWER_BOTTOM", "xy")
    >>> model.fix("UPPER_LEFT", "x")
    >>> model.add_pressure("UPPER_TOP", 2.0)
    >>> model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER")
    >>> steps = fc.solve(model, 2)
    >>> joint = fc.contact_resultants(model, steps, "joint")[-1]
    >>> joint.centre.round(6)
    array([5., 0.])
    """

    force: Array
    moment: Array
    area: float
    centre: Array
    normal_force: float
    mean_gap: float
    pressure_mean: float
    pressure_max: float
    dissipation: float
    friction_work: float
    worn_volume: float = 0.0

    _repr_html_ = fields_table


@typed(ContactError)
def contact_resultants(model: Model, steps: Iterable[StepResult], name: str) -> list[ContactResultants]:
    """Return the contact summary of a pair in each load step.

    Parameters
    ----------
    model : Model
    steps : iterable of StepResult
        Beginning with the first one, so that the work of friction is complete.
    name : str
        Name of the contact pair.

    Returns
    -------
    list of ContactResultants

    Raises
    ------
    ContactError
        If the model has no such pair.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.block_on_block()
    >>> model = fc.Model(mesh, kinematics="plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    >>> model.fix("LOWER_BOTTOM", "xy")
    >>> model.fix("UPPER_LEFT", "x")
    >>> model.add_pressure("UPPER_TOP", 2.0)
    >>> model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER")
    >>> steps = fc.solve(model, 2)
    >>> last = fc.contact_resultants(model, steps, "joint")[-1]
    >>> round(last.normal_force, 9), round(last.area, 9), round(last.pressure_mean, 9)
    (20.0, 10.0, 2.0)
    """
    pair = _formulation(model, name)
    areas, work, resultants = lumped_areas(pair.secondary, pair.points, pair.axisymmetric), 0.0, []
    for step in steps:
        contact = _result_of_pair(pair, step, name)
        if model.strain == "finite":
            areas = lumped_areas(pair.secondary, pair.points + step.displacement, pair.axisymmetric)
        work += contact.dissipation
        volume = 0.0 if contact.wear is None else float(areas @ contact.wear)
        of_step = _resultants(contact, areas * _covered_fraction(pair, step, name), pair.axisymmetric, work)
        resultants.append(replace(of_step, worn_volume=volume))
    return resultants


def _covered_fraction(pair: Formulation, step: StepResult, name: str) -> Array | float:
    """Return the fraction (n_nodes,) of the tributary areas that has an opposite side; 1 against obstacles [-]."""
    if isinstance(pair.primary, RigidSide):
        return 1.0
    return pair.unilateral(end_of(None, step, name)).nodal_field.covered


#: The earlier name of `ContactResultants`.
ContactAnswers = ContactResultants
#: The earlier name of `contact_resultants`.
contact_answers = contact_resultants


def _resultants(contact: ContactResult, areas: Array, axisymmetric: bool, work: float) -> ContactResultants:
    closed, facing = contact.active, np.isfinite(contact.gap)
    total, area = contact.normal_force, float(areas[closed].sum())
    in_compression, x = bool(total > 0.0), contact.positions
    moment = contact_moment(contact)
    centre = contact.normal_forces @ x / total if in_compression else np.full(x.shape[1], np.nan)
    if axisymmetric:
        centre[0] = np.nan
    return ContactResultants(
        force=contact.force, moment=np.zeros_like(moment) if axisymmetric else moment, area=area, centre=centre,
        normal_force=total,
        mean_gap=float(areas[facing] @ contact.gap[facing] / areas[facing].sum()) if facing.any() else float("nan"),
        pressure_mean=total / area if area else 0.0, pressure_max=contact.pressure_max,
        dissipation=contact.dissipation, friction_work=work,
    )  # fmt: skip


@typed(ContactError)
def contact_history(model: Model, steps: Sequence[StepResult], name: str) -> NDArray[np.void]:
    """Return `contact_resultants` as a table, one row for each load step, for `write_csv` and pandas.

    Parameters
    ----------
    model : Model
    steps : sequence of StepResult
        Beginning with the first one, so that the work of friction is complete.
    name : str
        Name of the contact pair.

    Returns
    -------
    structured ndarray (n_steps,)
        ``step``, ``load_factor``; ``force_x`` ...; ``moment_z``, in 3D ``moment_x`` ...; ``area``; ``centre_x`` ...;
        ``normal_force``, ``mean_gap``, ``pressure_mean``, ``pressure_max``, ``dissipation``, ``friction_work``,
        ``worn_volume``.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.block_on_block()
    >>> model = fc.Model(mesh, kinematics="plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    >>> model.fix("LOWER_BOTTOM", "xy")
    >>> model.fix("UPPER_LEFT", "x")
    >>> model.add_pressure("UPPER_TOP", 2.0)
    >>> model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER")
    >>> steps = fc.solve(model, 2)
    >>> fc.contact_history(model, steps, "joint")["normal_force"].round(9)
    array([10., 20.])
    """
    axes = "xyz"[: model.mesh.dim]
    vectors = {"force": axes, "moment": "z" if model.mesh.dim == 2 else axes, "centre": axes}
    quantities = [field.name for field in fields(ContactResultants)]
    columns = [f"{name}_{axis}" if axis else name for name in quantities for axis in vectors.get(name, [""])]
    of_steps = contact_resultants(model, steps, name)
    return _history(steps, columns, [np.hstack([getattr(values, name) for name in quantities]) for values in of_steps])


def _history(
    steps: Sequence[StepResult], columns: Sequence[str], values: Iterable[Iterable[float]]
) -> NDArray[np.void]:
    """Return a table with one row for each step: its number and load factor, and `values` with the names `columns`."""
    rows = [(step.index, step.load_factor, *row) for step, row in zip(steps, values, strict=True)]
    return np.array(rows, [("step", int), *((column, float) for column in ("load_factor", *columns))])


@typed(ContactError)
def wear(model: Model, steps: Iterable[StepResult], name: str, coefficient: float) -> Array:
    """Return the wear depth at the secondary nodes of a contact pair by Archard's law, accumulated over the load steps.

    ``depth = sum of coefficient * integral of pressure over slip``. With friction the integral of a step is
    `ContactResult.sliding_load`. Without friction it is the slip times the mean of the pressures at the beginning and at the
    end of the step. The slip is then the tangential displacement of a node in the step, relative to the point of the other
    side that is opposite it at the end. The geometry does not change; use the option ``wear`` of the contact pair to include
    its change.

    Parameters
    ----------
    model : Model
    steps : iterable of StepResult
        Consecutive steps, beginning with the first one.
    name : str
        Name of the contact pair.
    coefficient : float
        Archard's coefficient divided by the hardness [1 / pressure].

    Returns
    -------
    ndarray (n_steps, m)
        At the end of each step, at the nodes ``step.contact[name].points`` [length].

    Raises
    ------
    ContactError
        If the model has no such pair, or the coefficient is negative.

    Notes
    -----
    Archard, J. Appl. Phys. 24, 1953.

    Examples
    --------
    No node slides in this model, so that the depth is zero:

    >>> import fastcontact as fc
    >>> mesh = fc.generate.block_on_block()
    >>> model = fc.Model(mesh, kinematics="plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    >>> model.fix("LOWER_BOTTOM", "xy")
    >>> model.fix("UPPER_LEFT", "x")
    >>> model.add_pressure("UPPER_TOP", 2.0)
    >>> model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER")
    >>> steps = fc.solve(model, 2)
    >>> bool(fc.wear(model, steps, "joint", coefficient=1e-9).max() < 1e-20)
    True
    """
    if not (np.isfinite(coefficient) and coefficient >= 0.0):
        raise ContactError(f"the coefficient of wear {coefficient} must be a number, zero or more")
    pair = _formulation(model, name)
    depth, depths = np.zeros(len(pair.secondary.points)), []
    previous: StepResult | None = None
    for number, step in enumerate(steps, 1):
        _result_of_pair(pair, step, name)
        if step.index != number:
            raise ContactError(
                f"wear accumulates over all load steps: step {number} was expected, but got step {step.index}; pass all "
                "steps in order, beginning with the first"
            )
        end, pressure = end_of(previous, step, name), 0.0 if previous is None else previous.contact[name].pressure
        depth = depth + wear_depth_in_step(pair, end, step.contact[name], pressure, coefficient)
        depths.append(depth)
        previous = step
    return np.array(depths).reshape(len(depths), len(depth))


def end_of(previous: StepResult | None, step: StepResult, name: str) -> Configuration:
    """Return the configuration of a contact pair at the end of a step; `previous` is None for the first step."""
    end = replace(Configuration.displaced(step.displacement), pose=pose_of(step.contact[name]))
    if previous is None:
        return end
    return replace(end, start=previous.displacement, pose_start=pose_of(previous.contact[name]))


def pose_of(contact: ContactResult) -> Pose:
    """Return the pose of the obstacle of a contact pair; zero if the pair has no obstacle."""
    zero = np.zeros(contact.coordinates.shape[1])
    displacement = zero if contact.obstacle_displacement is None else np.asarray(contact.obstacle_displacement)
    return Pose(displacement, contact.obstacle_angle or 0.0)


def _result_of_pair(pair: Formulation, step: StepResult, name: str) -> ContactResult:
    """Return the result of a contact pair in a step; ContactError if the step belongs to another model."""
    contact, sizes = step.contact.get(name), (len(pair.points), len(pair.secondary.points))
    if contact is None or (len(step.displacement), len(contact.points)) != sizes:
        raise ContactError(
            f"load step {step.index} belongs to another model: it has no contact pair '{name}' on this mesh"
        )
    return contact


def _formulation(model: Model, name: str) -> Formulation:
    """Return the formulation of a contact pair; ContactError if the model has none of that name."""
    pairs = {pair.name: pair for pair in model.contact}
    check_known("contact pair", name, pairs, ContactError)
    return model.bind(pairs[name])


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
        If the step belongs to another model.

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
    supported, _ = model.prescribed()
    relations = [relation for _, relation in model.related_supports]
    relations += [relation for relation in model.relations if not any(relation is support for support in relations)]
    thickness = _thickness(step)
    reaction, forces = _support_forces(model, relations, supported, step.reaction / thickness, step.displacement)
    resultants: dict[str, Array] = {}
    unassigned = np.where(supported, reaction, 0.0)
    for support in model.supports:
        nodes, k = model.mesh.points_of(support.group), support.component
        resultants.setdefault(support.group, np.zeros(supported.shape[1]))[k] += unassigned[nodes, k].sum()
        unassigned[nodes, k] = 0.0
    for (group, relation), force in zip(model.related_supports, forces, strict=False):
        resultant = (relation.rows.T @ force).reshape(supported.shape).sum(axis=0)
        resultants[group] = resultants.get(group, 0.0) + resultant
    return {group: thickness * resultant for group, resultant in resultants.items()}


def _thickness(step: StepResult) -> float:
    """Return the thickness [length] that the forces of a step of a plane deck refer to; 1 for other steps."""
    return float(step.iterations.get("thickness", 1.0))


def reference_reactions(
    model: Model, points: Mapping[str, tuple[int, int]], reaction: Array, u: Array
) -> dict[str, dict[str, list[float]]]:
    """Return `StepResult.reference_reactions`, from the reactions [force] and displacements `u` [length] (n_points, dim).

    For each supported reference point, `points` contains the numbers of the two points of the mesh that represent its
    displacement and its rotation, see `Problem.reference_points`.
    """
    supported, at_points = model.prescribed()[0], np.zeros(u.shape, bool)
    at_points[[number for pair in points.values() for number in pair]] = True
    related = [r for _, r in model.related_supports if at_points.ravel()[r.rows.indices].all()]  # supports along axes
    for support in related:
        supported.ravel()[support.rows.indices] = True
    relations = [relation for relation in model.relations if not any(relation is support for support in related)]
    nodal = _support_forces(model, relations, supported, reaction, u)[0]
    return {
        name: {"force": nodal[point].tolist(), "moment": nodal[rotation, : 2 * model.mesh.dim - 3].tolist()}
        for name, (point, rotation) in points.items()
    }


def _support_forces(
    model: Model, relations: Sequence[MultiPointConstraint], supported: Mask, reaction: Array, u: Array
) -> tuple[Array, list[Array]]:
    """Return the nodal forces (n_points, dim) of supports, and the Lagrange multipliers of each of the `relations` [force].

    `reaction` and the displacements `u` [length] have the shape (n_points, dim) or (n_dofs,).
    """
    rows = [relation.rows for relation in relations]
    reaction = reaction.ravel() - ground_force(model.springs, u.ravel())
    forces = multipliers(reaction, rows, supported.ravel())
    reaction = reaction - sum((R.T @ force for R, force in zip(rows, forces, strict=True)), np.zeros(model.n_dofs))
    return reaction.reshape(supported.shape), forces


def multipliers(reaction: Array, rows: Sequence[csr_array], supported: Mask) -> list[Array]:
    """Return the Lagrange multipliers (m,) of multi-point constraints with rows (m, n_dofs) [force].

    They follow from the balance of forces at components without supports. `reaction` (n_dofs,) contains the forces of
    supports and constraints [force], and `supported` (n_dofs,) marks the components with supports.
    """
    if not rows:
        return []
    columns = csr_array(csr_array(vstack(rows, format="csr"))[:, np.flatnonzero(~supported)])
    multiplier = lsqr(columns.T, reaction[~supported], atol=1e-14, btol=1e-14, iter_lim=20 * sum(columns.shape))[0]
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
        If the step belongs to another model.

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
        name, tension = spring.name.removeprefix("the "), _thickness(step) * spring.tension(step.displacement)
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
    quantities = [(name, quantity) for name in names for quantity in ("force", "shortening")]
    values = ([step.pretension.get(name, {}).get(quantity, np.nan) for name, quantity in quantities] for step in steps)
    return _history(steps, [f"{name}_{quantity}" for name, quantity in quantities], values)


def _check(model: Model, step: StepResult) -> None:
    if step.displacement.shape != model.mesh.points.shape:
        raise ModelError(
            f"load step {step.index} has {len(step.displacement)} points and the model {model.mesh.n_points}: pass the model "
            "of this step"
        )
