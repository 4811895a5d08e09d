"""Options of a contact pair that do not depend on its formulation, such as clearance, excluded nodes, kind and penalty."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.sparse import csr_array, diags_array, eye_array

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.cohesion import CohesiveLaw
from fastcontact.contact.conductance import Conductance
from fastcontact.contact.obstacles.rigid_side import Rotation
from fastcontact.contact.overclosure import OverclosureLaw
from fastcontact.contact.pairing import Candidates, normals
from fastcontact.contact.surface import Surface
from fastcontact.round_off import SINGLE_PRECISION

KINDS = ("unilateral", "bilateral", "bilateral_once_closed", "tied", "gap_only")
# Kinds of pairs in which the constraints of all paired points are equations from the beginning.
ALWAYS_CLOSED = ("tied", "bilateral")
Field = Callable[[Array], Array]


@record
class PairOptions:
    """The options of a contact pair that do not depend on its formulation.

    Attributes
    ----------
    clearance, clearance_primary : callable, optional
        Functions of reference positions (n, dim) on the secondary and on the primary side [length], which return lengths (n,)
        that are added to the gap: positive clearances or negative interferences [length].
    excluded, frictionless : ndarray of bool (n_points,), optional
        Nodes without contact, and nodes without friction.
    frictionless_along : ndarray (dim,), optional
        Direction along which there is no friction, at the `frictionless` nodes or, if these are not given, everywhere [-].
    kind : str
        One of `KINDS`.
    penalty : float or OverclosureLaw, optional
        Ratio of contact pressure to penetration [pressure / length], or a law for it; None means no penetration.
    tangential_penalty : callable, optional
        Ratio of shear stress to elastic slip at sticking points, as a function from reference positions (n, dim) on the
        secondary side to positive numbers (n,) [pressure / length]; None means no elastic slip.
    wear : float, optional
        Archard's wear coefficient divided by the hardness, for wear of the secondary side [1 / pressure]; None means no wear.
    search_distance : float, optional
        Points are only paired if their gap or penetration, now or at the beginning of the load step, is at most this distance
        [length]; None means any distance.
    conductance : Conductance, optional
        Thermal contact conductance; None means no heat flow.
    friction_heat : float
        Fraction of the frictional work that becomes heat [-].
    obstacle_temperature : float, optional
        Temperature of a rigid obstacle that exchanges heat [temperature].
    cohesion : CohesiveLaw, optional
        Traction-separation law; None means that the pair has no tension.
    initial_clearance_factor : float
        Factor of the clearances in the initial state, in which a cohesive layer is free of stress [-].
    source : ndarray of bool (n_points,), optional
        Nodes at the source of a penetrating fluid; None without fluid.
    representatives : ndarray of int (n_points,), optional
        In periodic models, the node with which each node shares its multiplier.
    sector_rotation : Rotation, optional
        Rotation about the axis of a cyclic sector. Fields of tractions are then interpolated in cylindrical components,
        because tractions rotate from one end of the pair to the other.
    """

    clearance: Field | None = None
    clearance_primary: Field | None = None
    excluded: Mask | None = None
    frictionless: Mask | None = None
    frictionless_along: Array | None = None
    kind: str = "unilateral"
    penalty: float | OverclosureLaw | None = None
    tangential_penalty: Field | None = None
    search_distance: float | None = None
    wear: float | None = None
    conductance: Conductance | None = None
    friction_heat: float = 0.0
    obstacle_temperature: float | None = None
    cohesion: CohesiveLaw | None = None
    initial_clearance_factor: float = 1.0
    source: Mask | None = None
    representatives: Indices | None = None
    sector_rotation: Rotation | None = None

    def friction_axes(
        self, friction: float, directions: Sequence[Array], candidates: Candidates
    ) -> tuple[Array, tuple[Array, ...], tuple[Array, ...]]:
        """Return coefficients of friction, and tangents that are aligned with the direction without friction.

        Parameters
        ----------
        friction : float
            Coefficient of friction of the pair [-].
        directions : sequence of k ndarray (n, dim)
            Unit tangents.
        candidates : Candidates

        Returns
        -------
        coefficients : ndarray (n,)
            Coefficients of friction of the candidates, zero where there is no friction in any direction [-].
        tangents : tuple of k ndarray (n, dim)
            Unit tangents, rotated such that the first is the direction without friction at frictionless candidates.
        slip_axes : tuple of k ndarray (n, dim)
            The same tangents, set to zero in the direction without friction.
        """
        direction = self.frictionless_along
        is_frictionless = np.full(len(candidates.nodes), direction is not None)
        if self.frictionless is not None:
            is_frictionless = candidates.belonging_to(self.frictionless)
        if direction is None:
            return np.where(is_frictionless, 0.0, friction), tuple(directions), tuple(directions)
        normal = normals(directions)
        projected = direction - (normal @ direction)[:, None] * normal
        length = np.linalg.norm(projected, axis=1, keepdims=True)
        has_direction = is_frictionless[:, None] & (length > SINGLE_PRECISION * np.linalg.norm(direction))
        first = np.where(has_direction, projected / np.where(has_direction, length, 1.0), directions[0])
        rotated = (first, *(np.where(has_direction, np.cross(normal, first), tangent) for tangent in directions[1:]))
        return np.full(len(is_frictionless), friction), rotated, (np.where(has_direction, 0.0, first), *rotated[1:])


def nodal_map(side: Surface, excluded: Mask, independent: Indices) -> csr_array:
    """Return the map (m, m) from independent to nodal values of a multiplier field, for a side with `excluded` nodes (m,).

    The value at an excluded node is the mean of the values at its neighbours among the nodes `independent`, so that a uniform
    field remains uniform. The value is zero if there are no such neighbours. All other nodal values are independent.
    """
    m = len(side.points)
    if not excluded.any():
        return csr_array(eye_array(m, format="csr"))
    is_independent = np.isin(np.arange(m), independent) & ~excluded
    neighbours = diags_array(excluded.astype(float)) @ side.node_adjacency @ diags_array(is_independent.astype(float))
    count = np.maximum(np.asarray(neighbours.sum(axis=1)).ravel(), 1.0)
    return csr_array(diags_array((~excluded).astype(float)) + diags_array(1.0 / count) @ neighbours)
