"""The supports of a model: prescribed displacements, and the axis of symmetry.

A `Value` is a number, or a function from reference positions (n, dim) [length] to numbers (n,) [unit of the quantity].
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array, Indices, Mask, largest
from fastcontact.contact.obstacles.rigid_side import Rotation
from fastcontact.elasticity.loads import Value, axis_values, check_points, check_value, evaluated
from fastcontact.elasticity.material_axes import Axes, checked_axes, frames
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.elasticity.symmetry_axis import axis_nodes
from fastcontact.errors import ModelError
from fastcontact.model.contact_pair import rotation_of
from fastcontact.model.parts.base import Support, displacement_name
from fastcontact.model.parts.contact import ModelContact
from fastcontact.model.ramp import History, PartHistory, Table, interpolation_tables, magnitudes, table_of
from fastcontact.model.relation_rows import NORMAL, normals_of, rows_along
from fastcontact.round_off import ROUND_OFF, SINGLE_PRECISION

log = logging.getLogger("fastcontact")
# Unit vectors or a function that returns them, as for materials. In 2D a single vector also suffices.
SupportAxes = Axes | Sequence[float]


@typed(ModelError)
class ModelSupports(ModelContact):
    """A model with supports."""

    def fix(self, group: str, components: str, *, axes: SupportAxes = None) -> None:
        """Fix displacement components of all nodes of a group at zero.

        Parameters
        ----------
        group : str
        components : str
            ``"x"``, ``"y"``, ``"xy"``, in 3D also ``"z"``; or ``"normal"``, along the normals of a group of facets.
        axes : sequence or callable, optional
            Directions (k, 3) [-] of x, y and z, as described for `prescribe`; by default the axes of the mesh.

        Raises
        ------
        MeshError, ModelError
            If the group does not exist, or a component is unknown.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.rings(), kinematics="plane_strain")
        >>> model.fix("SYMMETRY_X", "x")
        >>> model.fix("SYMMETRY_Y", "y")
        >>> model.fix("RIM", "x", axes=fc.CylindricalAxes())  # the radial component
        """
        if not components:
            raise ModelError(f"fix('{group}', ...) has no component: specify, for example, 'x' or 'xy'")
        if axes is not None:
            self._add_along_axes(group, dict.fromkeys(components, 0.0), axes, None)
        elif components == NORMAL:
            self.prescribe(group, normal=0.0)
        else:
            self._add_support(group, dict.fromkeys(components, 0.0), None)

    def prescribe(
        self,
        group: str,
        *,
        normal: Value | Sequence[tuple[float, Value]] | None = None,
        axes: SupportAxes = None,
        rotation: Mapping[str, Any] | None = None,
        ramp: History = None,
        **components: Value | Sequence[tuple[float, Value]],
    ) -> None:
        """Prescribe displacement components of all nodes of a group.

        Parameters
        ----------
        group : str
        normal : float, callable or sequence of (float, float or callable), optional
            Outward displacement along the mean normal of the facets at each node; the group must contain facets [length].
        axes : sequence or callable, optional
            Directions (k, 3) [-] of x, y and z: unit vectors in rows, or a function of position that returns them, as
            described for `Orthotropic`. In 2D a single vector of two numbers also suffices. With
            ``axes=fc.CylindricalAxes()`` x, y and z are the radial, circumferential and axial components.
        rotation : mapping, optional
            Rigid rotation of the group about an axis, exact for any angle. ``angle``: angle at multiplier 1 [radian].
            ``centre``: a point (dim,) on the axis [length]. ``axis``, in 3D: direction of the axis. ``ramp``, optional:
            history of the angle. All components of the group are then prescribed; x, y and z translate the axis.
            Axisymmetric models do not support rotation.
        ramp : Ramp or iterable of (float, float), optional
            History of the displacement.
        **components : float, callable or sequence of (float, float or callable)
            Displacements ``x``, ``y`` and ``z`` at multiplier 1: numbers, or functions from reference positions (n,
            dim) [length] to displacements (n,) [length]. A displacement that is not proportional to a single history is
            given as pairs of load factor and displacement, also for `normal` and with `axes`. Displacements are
            interpolated linearly between these load factors, starting from zero at the load factor 0.

        Raises
        ------
        MeshError, ModelError
            If the group does not exist, or arguments are invalid or exclude each other.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.rings(), kinematics="plane_strain")
        >>> model.prescribe("RIM", normal=-0.1)  # shrinks the rim
        >>> model.prescribe("BORE", x=lambda points: 0.01 * points[:, 1], y=0.0)

        Displacements that a global model has at the load factors 0.5 and 1, as functions of position:

        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> x_at_half, x_at_end = (lambda points: 0.0 * points[:, 1]), (lambda points: 0.01 * points[:, 1])
        >>> model.prescribe("LEFT", x=[(0.5, x_at_half), (1.0, x_at_end)])

        A group that rotates by 90 degrees while the load factor goes from 0 to 1:

        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain", strain="finite")
        >>> model.prescribe("TOP", rotation={"angle": 1.5707963, "centre": (0.5, 1.0)})
        """
        if rotation is not None:
            if axes is not None or normal is not None:
                raise ModelError(f"the support of '{group}' rotates: give the displacement of its axis as x, y, z")
            rotation_and_ramp = rotation_of(f"the rotation of '{group}'", rotation, self.kinematics)
            self._add_support(group, dict.fromkeys("xyz"[: self.mesh.dim], 0.0) | components, ramp, *rotation_and_ramp)
            return
        if axes is not None:
            if normal is not None:
                raise ModelError(f"the support of '{group}' acts along its normals or along axes: give one of them")
            self._add_along_axes(group, components, axes, ramp)
            return
        if normal is not None:
            nodes, directions = normals_of(self.mesh, group)
            self._add_along(group, displacement_name("normal", group), nodes, directions, normal, ramp)
        if components or normal is None:
            self._add_support(group, components, ramp)

    def _add_along_axes(self, group: str, components: Mapping[str, Any], axes: SupportAxes, ramp: History) -> None:
        """Prescribe displacements along the given axes by multi-point constraints."""
        dim, name = self.mesh.dim, f"the support of '{group}'"
        check_points(self.mesh, group, "no displacement can be prescribed on it")
        nodes = self.mesh.points_of(group).astype(np.intp)
        positions = self.mesh.points[nodes]
        try:
            frame = frames(checked_axes(axes), positions, self.kinematics)
        except ModelError as error:
            raise ModelError(str(error).replace("a material", name).replace("a point of a cell", "a node")) from None
        for axis, value in axis_values(name, components, dim).items():
            direction = frame[:, axis]
            if dim == 2 and np.abs(direction[:, 2]).max() > SINGLE_PRECISION:
                raise ModelError(f"{name}: its axes have components out of the plane of the model")
            directions, caption = np.ascontiguousarray(direction[:, :dim]), displacement_name("xyz"[axis], group)
            self._add_along(group, f"{caption} along axes", nodes, directions, value, ramp)

    def _add_along(self, group: str, name: str, nodes: Indices, directions: Array, value: Any, ramp: History) -> None:
        """Prescribe the displacements of `nodes` (n,) along `directions` (n, dim) by multi-point constraints."""
        value, table = _checked_value(name, value, table_of(ramp, f"the ramp of {name}"))
        rows, positions = rows_along(nodes, directions, self.n_dofs), self.mesh.points[nodes]
        if isinstance(value, tuple):  # the displacement of each node has a separate history
            histories = zip(*(evaluated(u, positions, name).tolist() for _, u in value), strict=True)
            begin, instants = [(0.0, 0.0)] if value[0][0] else [], [instant for instant, _ in value]
            tables = [(*begin, *zip(instants, history, strict=True)) for history in histories]
            relations = [MultiPointConstraint(name, rows[[row]], 1.0, table) for row, table in enumerate(tables)]
        else:
            relations = [MultiPointConstraint(name, rows, evaluated(value, positions, name), table)]
        self.relations += relations
        self.related_supports += [(group, relation) for relation in relations]

    def _add_support(
        self, group: str, components: Mapping[str, Any], ramp: History, rotation: Rotation | None = None,
        rotation_ramp: Table | None = None,
    ) -> None:  # fmt: skip
        """Add a support for each component of the displacement, after checking it."""
        check_points(self.mesh, group, "no displacement can be prescribed on it")
        for axis, value in axis_values(f"the support of '{group}'", components, self.mesh.dim).items():
            name = displacement_name("xyz"[axis], group)
            table = table_of(ramp, f"the ramp of the displacement prescribed on '{group}'")
            value, table = _checked_value(name, value, table, rotation is not None)
            self.supports.append(Support(group, axis, value, table, rotation, rotation_ramp))

    def prescribed(self) -> tuple[Mask, Array]:
        """Return the mask of the prescribed components and their displacements at multiplier 1 [length].

        Both arrays have the shape (n_points, dim); displacements are zero at components that are not prescribed.
        """
        fixed, by_ramp = self.prescribed_by_ramp()
        return fixed, sum(by_ramp.values(), np.zeros(self.mesh.points.shape))

    def prescribed_by_ramp(self) -> tuple[Mask, dict[PartHistory, Array]]:
        """Return the mask (n_points, dim) of the prescribed components and their displacements at multiplier 1, by history.

        Displacements have the shape (n_points, dim) [length] for each history. Raises ModelError if two supports contradict
        each other by more than round-off of the largest displacement.
        """
        fixed = np.zeros(self.mesh.points.shape, bool)
        by_ramp: dict[PartHistory, Array] = {}
        groups = [self.mesh.points_of(support.group) for support in self.supports]
        displacements = [s.by_history(self.mesh.points[nodes]) for s, nodes in zip(self.supports, groups, strict=True)]
        round_off = ROUND_OFF * max((largest(magnitudes(values)) for values in displacements), default=0.0)
        for number, (support, nodes, histories) in enumerate(zip(self.supports, groups, displacements, strict=True)):
            k, repeated = support.component, fixed[nodes, support.component]
            for history in histories:
                by_ramp.setdefault(history, np.zeros(self.mesh.points.shape))
            if repeated.any():
                differences = {h: (u[nodes, k] - histories.get(h, 0.0))[repeated] for h, u in by_ramp.items()}
                rows = np.flatnonzero(magnitudes({h: u for h, u in differences.items() if u.any()}) > round_off)
                if len(rows):
                    self._raise_contradiction(number, int(nodes[repeated][rows[0]]))
            for history, values in histories.items():
                by_ramp[history][nodes[~repeated], k] = values[~repeated]
            fixed[nodes, k] = True
        self._fix_axis(fixed, by_ramp)
        return fixed, by_ramp

    def _raise_contradiction(self, number: int, node: int) -> None:
        """Raise a ModelError which states that support `number` contradicts an earlier support at `node`."""
        support = self.supports[number]
        for first in self.supports[:number]:
            if first.component == support.component and node in self.mesh.points_of(first.group):
                break
        position = self.mesh.points[[node]]
        value, first_value = (s.last_value(position) for s in (support, first))
        axis, ramp = "xyz"[support.component], " with another ramp" if value == first_value else ""
        raise ModelError(
            f"'{support.group}' prescribes {axis} = {value:.15g} at point {node}, but '{first.group}' "
            f"prescribes {first_value:.15g} there{ramp}: remove one of the two"
            + (f", or give both histories as pairs: {axis}=[(0.5, f), (1.0, g)]" if support.ramp != first.ramp else "")
        )

    def _fix_axis(self, fixed: Mask, by_ramp: Mapping[PartHistory, Array]) -> None:
        """Fix the radial displacement at the axis of an axisymmetric model; raise ModelError if a support contradicts it."""
        axis = self.axis_nodes
        for values in by_ramp.values():
            nodes = axis[np.abs(values[axis, 0]) > SINGLE_PRECISION * np.abs(values).max()]
            if len(nodes):
                raise ModelError(
                    f"x = {values[nodes[0], 0]:g} is prescribed at point {nodes[0]} on the axis of symmetry, where the "
                    "radial displacement is zero: leave the points at x = 0 out of the group"
                )
            values[axis, 0] = 0.0
        fixed[axis, 0] = True

    @property
    def axis_nodes(self) -> Indices:
        """Nodes (k,) on the axis of an axisymmetric model, where x is fixed without a support; empty for other models."""
        return axis_nodes(self.mesh) if self.kinematics == "axisymmetric" else np.empty(0, np.intp)

    def _log_axis_nodes(self) -> None:
        """Log the nodes whose radial displacement is fixed only by the axial symmetry, and not by a support."""
        supported = [self.mesh.points_of(support.group) for support in self.supports if support.component == 0]
        nodes = np.setdiff1d(self.axis_nodes, np.concatenate(supported)) if supported else self.axis_nodes
        if len(nodes):
            log.info("axis of symmetry: x is fixed at %d nodes with x = 0 (first: point %d)", len(nodes), nodes[0])


def _checked_value(name: str, value: Any, table: Table | None, rotates: bool = False) -> tuple[Any, Table | None]:
    """Return a displacement (a number, a function or pairs (load factor, displacement)) and its history after checks."""
    if isinstance(value, Iterable):
        if table is not None or rotates:
            raise ModelError(f"{name} is given at several load factors: leave out ramp and rotation")
        value = tuple((float(instant), displacement) for instant, displacement in value)
        table = interpolation_tables([instant for instant, _ in value], name)[-1]
    for _, displacement in value if isinstance(value, tuple) else [(1.0, value)]:
        check_value(name, displacement)
    return value, table
