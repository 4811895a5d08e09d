"""Thermal contact conductance as a function of pressure and gap, and the discrete heat transfer between the two sides.

The heat flow at a constraint is ``h * area * (T_secondary - T_primary)``, where temperatures are weighted with the test
functions of the gap of the constraint. The same weights distribute heat flows to the nodes. The shape functions of the mortar
multiplier sum to one, so that a uniform flux is transmitted exactly between non-matching meshes (Hueber and Wohlmuth,
2009, section 3).

At the rim of a contact, facets are partly closed. A conductance that drops to zero when the contact opens then applies to the
closed part of these facets, see `closed_fractions`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array, diags_array

from fastcontact._tools.argument_types import number_pairs
from fastcontact._tools.records import record
from fastcontact.arrays import Array, mask_at
from fastcontact.contact.surface import Surface
from fastcontact.errors import ContactError
from fastcontact.mesh import elements
from fastcontact.mesh.flat_pieces import flat_pieces

if TYPE_CHECKING:
    from fastcontact.contact.constraints import Constraints
    from fastcontact.contact.obstacles.rigid_side import RigidSide

TABLE_KEYS = ("pressure", "gap")


class Conductance:
    """Thermal conductance of a contact: heat flow per unit area and temperature difference [power / (area temperature)].

    Raises ContactError if `law` has none of the forms below.

    Parameters
    ----------
    name : str
        Name of the contact pair, for messages.
    law : float, callable, sequence or mapping
        A number, which applies where the sides touch; a function of pressures and gaps (m,), which also applies where the
        sides are open; pairs (pressure, conductance), which apply where the sides touch; or a mapping of ``"pressure"`` to
        such pairs and of ``"gap"`` to pairs (gap, conductance), which apply where the sides are open, or everywhere if there
        are no pairs for pressure.
    """

    def __init__(self, name: str, law: Any) -> None:
        self.name, self._law, self._tables = name, law, dict[str, Array]()
        if callable(law):
            return
        tables = law if isinstance(law, Mapping) else {"pressure": law}
        if isinstance(law, (int, float)) and not isinstance(law, bool):
            if not 0.0 <= law < np.inf:
                raise ContactError(f"the conductance {law} of contact '{name}' must be a number, zero or more")
            tables = {"pressure": [(0.0, law)]}
        if not tables or not set(tables) <= set(TABLE_KEYS):
            raise self._invalid()
        self._tables = {key: self._table(rows) for key, rows in tables.items()}

    def _table(self, rows: Any) -> Array:
        """Return the pairs `rows` as an array (n, 2), or raise ContactError."""
        table = number_pairs(rows)
        ascending = table is not None and np.isfinite(table).all() and (np.diff(table[:, 0]) > 0.0).all()
        if table is None or not ascending or not len(table) or table.min() < 0.0:
            raise self._invalid()
        return table

    def _invalid(self) -> ContactError:
        return ContactError(
            f"the conductance of contact '{self.name}' must be a number, a function of pressures and gaps, or tables of "
            "nonnegative, ascending pairs: [(0.0, 100.0), (10.0, 5000.0)] by pressure, or "
            '{"pressure": [...], "gap": [...]}'
        )

    @property
    def signature(self) -> Any:
        """Values that identify the conductance: the argument itself or, for a function, samples of its values."""
        if not callable(self._law):
            return self._law
        samples = np.concatenate([[0.0], np.logspace(-9, 9, 37)])
        return [self(samples, np.zeros(len(samples))), self(np.zeros(len(samples)), samples)]

    @property
    def jump(self) -> float:
        """Amount by which the conductance drops when a contact without pressure opens [power / (area temperature)]."""
        closed, opened = self(np.zeros(2), np.array([0.0, np.finfo(float).tiny]))
        return float(closed - opened)

    def __call__(self, pressure: Array, gap: Array) -> Array:
        """Return conductances (m,) at pressures (m,) [pressure] and gaps (m,) [length]; a gap of zero means contact.

        Raises ContactError if a function fails or does not return nonnegative numbers of this shape.
        """
        closed = gap == 0.0
        if not callable(self._law):
            arguments = {"pressure": pressure, "gap": gap}
            interpolated = {key: np.interp(arguments[key], *table.T) for key, table in self._tables.items()}
            closed_values = interpolated.get("pressure", interpolated.get("gap", 0.0))
            return np.where(closed, closed_values, interpolated.get("gap", 0.0))
        try:
            h = np.asarray(self._law(pressure, gap), float)
        except Exception as error:
            raise ContactError(
                f"the conductance of contact '{self.name}' fails: {type(error).__name__}: {error}"
            ) from error
        h = np.broadcast_to(h, gap.shape) if h.ndim == 0 else h
        if h.shape != gap.shape or not (np.isfinite(h).all() and (h >= 0.0).all()):
            raise ContactError(
                f"the conductance of contact '{self.name}' must return a nonnegative number for each pressure and gap, "
                f"shape {gap.shape}, not shape {h.shape}{'' if h.shape != gap.shape else f', least {h.min():g}'}"
            )
        return h


@record
class HeatTransfer:
    """Discrete heat transfer between the two sides of a contact pair.

    Attributes
    ----------
    secondary, primary : csr_array (m, n_points)
        Weights of the nodal temperatures on both sides of each constraint, which sum to one on each meshed side [-].
    area : ndarray (m,)
        Area of each constraint, zero for constraints that face no primary point [area].
    """

    secondary: csr_array
    primary: csr_array
    area: Array

    @property
    def jump(self) -> csr_array:
        """Matrix (m, n_points) that maps nodal temperatures to their jumps, secondary minus primary side [-]."""
        return csr_array(self.secondary - self.primary)

    def matrix(self, h: Array) -> csr_array:
        """Return the conductance matrix (n_points, n_points) for conductances `h` (m,) per area [power / temperature]."""
        return csr_array(self.jump.T @ diags_array(h * self.area) @ self.jump)

    def nodal_powers(self, power: Array) -> Array:
        """Return the nodal powers (n_points,) of a heat `power` (m,) at the constraints, half of it on each side [power]."""
        return np.asarray(0.5 * (self.secondary.T @ power + self.primary.T @ power))


def heat_transfer(
    constraints: Constraints, secondary: Surface, primary: Surface | RigidSide, shape: tuple[int, ...]
) -> HeatTransfer:
    """Return the heat transfer between the two sides of a contact pair.

    The weights of temperatures are those of the displacements along the normal of each constraint. A rigid primary side has
    no points and thus no weights. `shape` is that of the points of the mesh, (n_points, dim).
    """
    n, dim = shape
    on_secondary = mask_at(np.setdiff1d(secondary.points, primary.points), n)
    components = [csr_array(constraints.B[:, : n * dim][:, axis::dim]) for axis in range(dim)]
    normal = np.stack([matrix @ on_secondary for matrix in components], axis=1)
    square = np.einsum("md,md->m", normal, normal)
    scale = normal / np.where(square > 0.0, square, np.inf)[:, None]
    weights = sum(diags_array(scale[:, axis]) @ components[axis] for axis in range(dim))
    assert constraints.areas is not None
    is_facing = np.isfinite(constraints.areas) & (square > 0.0)
    of_secondary = csr_array(weights @ diags_array(on_secondary.astype(float)))
    return HeatTransfer(of_secondary, csr_array(of_secondary - weights), np.where(is_facing, constraints.areas, 0.0))


def closed_fractions(side: Surface, points: Array, pressure: Array, gap: Array, modulus: float) -> Array:
    r"""Return the closed fractions (n_nodes,) of the areas of the secondary nodes, estimated from pressures and gaps [-].

    At the distance s from the rim of a smooth contact, the pressure is :math:`A \sqrt s` inside, and the gap is
    :math:`4 A s^{3/2} / (3 E^*)` outside (Johnson, 1985, section 4.2), with a constant A. If the rim is halfway between a
    closed and an open node at the distance h, the function :math:`p - 3 E^* g / (2 h)` of the pressure p and the gap g thus
    has opposite values at these nodes. Its linear interpolation vanishes at the rim: the closed fraction of a line is the sum
    of the positive nodal values divided by the sum of the absolute values. The same ratio is used for triangles.

    Parameters
    ----------
    side : Surface
        The secondary side. Quadratic facets are divided into flat lines or triangles between their nodes.
    points : ndarray (n_points, dim)
        Coordinates [length].
    pressure, gap : ndarray (n_nodes,)
        Nodal pressures [pressure], and nodal gaps, infinite at nodes that have none [length].
    modulus : float
        Effective modulus E* of both bodies [pressure].
    """
    closed, total = np.zeros((2, len(gap)))
    for block in side.blocks:
        local, corners = block.local, elements.get(block.element).n_corners
        if not np.isfinite(gap[local[:, corners:]]).any():  # no gaps at mid-side nodes
            local = local[:, :corners]
        nodes = local[:, flat_pieces(local.shape[1], points.shape[1])].reshape(-1, points.shape[1])
        nodes = nodes[np.isfinite(gap[nodes]).all(axis=1)]
        edges = np.diff(points[side.points[nodes]], axis=1)
        size = np.linalg.det(edges @ edges.transpose(0, 2, 1)) ** (0.5 / edges.shape[1])
        level = np.maximum(pressure[nodes], 0.0) - 1.5 * modulus * np.maximum(gap[nodes], 0.0) / size[:, None]
        is_closed, sizes = level >= 0.0, np.abs(level).sum(axis=1)
        inside = np.maximum(level, 0.0).sum(axis=1)
        fraction = np.divide(inside, sizes, out=np.ones(len(level)), where=sizes > 0.0)[:, None]
        count = is_closed.mean(axis=1, keepdims=True)  # share of the closed nodes, which the closed part covers first
        of_closed = np.minimum(fraction / np.where(count > 0.0, count, 1.0), 1.0)
        of_open = np.maximum(fraction - count, 0.0) / np.where(count < 1.0, 1.0 - count, 1.0)
        area, shares = size[:, None] ** edges.shape[1], np.where(is_closed, of_closed, of_open)
        np.add.at(closed, nodes, area * shares)
        np.add.at(total, nodes, np.broadcast_to(area, nodes.shape))
    return np.divide(closed, total, out=(gap == 0.0).astype(float), where=total > 0.0)
