"""Node-to-segment contact: no secondary node penetrates the primary facet onto which it projects.

There is one constraint per secondary node. It is enforced exactly, and its multiplier is the nodal contact force. The
pairing, the projections and the normals are constant during the active set iteration (code_aster, R5.03.50, formulation
DISCRETE with ALGO_CONT='CONTRAINTE').

The formulation does not pass the patch test on non-matching meshes, and its pressures oscillate on quadratic facets. Under
a uniform pressure, the forces at the corners of six-node triangles vanish, and those at the corners of eight-node
quadrangles are tensile. Secondary sides with such facets are rejected.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_array, eye_array
from scipy.sparse.linalg import SuperLU, splu

from fastcontact._tools.neighbours import nearest
from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints, NodalField
from fastcontact.contact.formulations._formulation import Formulation
from fastcontact.contact.integration import all_nodes_carry_pressure, even_at_axis, mass_matrix, nodal_areas
from fastcontact.contact.pairing import Candidates, Pairing
from fastcontact.contact.surface import Surface
from fastcontact.errors import ContactError, unknown
from fastcontact.round_off import ROUND_OFF

OPPOSITE = ("facet", "node")


@dataclass(eq=False)
class NodeToSegment(Formulation):
    """Node-to-segment contact. The parameters of `Formulation` apply as well.

    Parameters
    ----------
    opposite : str
        ``"facet"`` to measure the gap to the opposite primary facet, or ``"node"`` to measure it to the nearest primary node.
        ``"node"`` suits matching meshes with little sliding (APPARIEMENT='NODAL' of code_aster).
    """

    opposite: str = "facet"

    name: ClassVar[str] = "node_to_segment"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.opposite not in OPPOSITE:
            raise ContactError(unknown("what a node of node_to_segment lies opposite to", self.opposite, OPPOSITE))
        if self.opposite == "node" and not isinstance(self.primary, Surface):
            raise ContactError("a rigid obstacle has no nodes: leave out opposite = 'node'")
        for block in self.secondary.blocks:
            # The equivalent nodal forces of a uniform pressure must be compressive at all nodes of a facet.
            if not all_nodes_carry_pressure(block.element):
                primary_blocks = self.primary.blocks if isinstance(self.primary, Surface) else ()
                can_swap = primary_blocks and all(all_nodes_carry_pressure(b.element) for b in primary_blocks)
                advice = ", or swap the sides" if can_swap else ""
                raise ContactError(
                    f"node_to_segment cannot have facets of {block.element} on its secondary side '{self.secondary.group}', "
                    f"whose corner nodes carry no pressure: use formulation 'continuous' or 'mortar'{advice}"
                )

    def pair_candidates(self, candidates: Candidates, config: Configuration, tolerance: float | None = None) -> Pairing:
        """Return the pairing of candidates with facets or, if `opposite` is ``"node"``, with the nearest primary nodes."""
        pairing = super().pair_candidates(candidates, config, tolerance)
        if self.opposite == "facet":
            return pairing
        assert isinstance(self.primary, Surface)
        deformed, nodes = self.points + config.displacement, Candidates.from_side(self.primary)
        closest = nearest(deformed[self.primary.points], candidates.positions(deformed))[1]
        normal = pairing.normal
        if self.normals in ("facet", "averaged"):  # The normal at a node is the mean over its facets.
            normal = config.deformed(self.primary, self.points).nodal_normals[closest]
        return replace(pairing, facet=nodes.facet[closest], xi=nodes.xi[closest], normal=normal, overhang_xi=None)

    def unilateral(self, config: Configuration) -> Constraints:
        """Pair the nodes on the deformed configuration, and return one constraint per secondary node."""
        pairing = self.pair_candidates(self.node_candidates, config)
        pairing = replace(pairing, paired=pairing.paired & ~self.excluded[self.secondary.points])
        nodal_areas = self._nodal_forces.nodal_areas
        areas = np.where(nodal_areas > ROUND_OFF * nodal_areas.max(), nodal_areas, np.inf)
        constraints = self.assembled(self.node_candidates, pairing, None, config)
        if self.opposite == "node":
            constraints = replace(constraints, geometry=None)
        return replace(constraints, areas=areas, nodes=self.secondary.points.astype(np.intp), nodal=self._nodal_forces)

    @cached_property
    def _nodal_forces(self) -> NodalForces:
        """The map from the nodal forces of the secondary side to its nodal pressures."""
        areas = nodal_areas(self.secondary, self.points, self.axisymmetric)
        if self.secondary.order == 1:
            return NodalForces(areas)
        even = even_at_axis(self.secondary, self.points) if self.axisymmetric else csr_array(eye_array(len(areas)))
        independent = np.flatnonzero(even.diagonal())
        to_nodes = csr_array(even[:, independent])
        mass = mass_matrix(self.secondary, self.points, self.axisymmetric)
        return NodalForces(areas, to_nodes, independent, splu((to_nodes.T @ mass @ to_nodes).tocsc()))


@record
class NodalForces(NodalField):
    """Map from nodal contact forces to nodal pressures; see `constraints.NodalField`.

    Attributes
    ----------
    nodal_areas : ndarray (n_nodes,)
        Integrals of the shape functions of the nodes [area].
    to_nodes : csr_array (n_nodes, k), optional
        For quadratic facets, map from the k independent nodal pressures to all nodal pressures; see
        `integration.even_at_axis`.
    independent : ndarray of int (k,), optional
        Nodes of the independent pressures.
    mass : SuperLU, optional
        Factorised mass matrix (k, k) of the independent pressures [area]. On quadratic facets, forces divided by nodal areas
        are not the nodal values of a pressure field.
    """

    nodal_areas: Array
    to_nodes: csr_array | None = None
    independent: Indices | None = None
    mass: SuperLU | None = None

    def uncovered(self, side: Surface, usable: Mask) -> list[Array]:
        """See `NodalField`; the complete area of a node without an opposite facet is uncovered."""
        return [np.where(usable[block.local], 0.0, 1.0) for block in side.blocks]

    def pressure(self, force: Array) -> Array:
        """Return nodal pressures (n_nodes,) [pressure] for nodal forces (n_nodes,) [force].

        They are the forces divided by the nodal areas or, for quadratic facets, the solution with the mass matrix.
        """
        if self.to_nodes is None or self.mass is None:
            return force / self.nodal_areas
        return np.asarray(self.to_nodes @ self.mass.solve(self.to_nodes.T @ force))

    def closed_nodes(self, active: Mask, gap: Array, pressure: Array) -> Mask:
        """Return the active nodes, and ends of quadratic lines on the axis if the other nodes of their facets are active.

        The force of such an end vanishes, and in equilibrium its gap may be slightly open.
        """
        if self.to_nodes is None:
            return active
        depends_on_others = self.to_nodes.indptr[1:] - self.to_nodes.indptr[:-1] > 1
        inactive_weight = abs(self.to_nodes) @ (~active[self.independent]).astype(float)
        return active | (depends_on_others & (inactive_weight == 0.0))


FORMULATION = NodeToSegment
