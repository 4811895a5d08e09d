"""Warning about hanging nodes that no contact or constraint connects to the facets on which they lie."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fastcontact.arrays import Indices, Mask, Numbers
from fastcontact.mesh.hanging_nodes import hanging_nodes, hanging_nodes_text
from fastcontact.mesh.mesh import Mesh

if TYPE_CHECKING:
    from fastcontact.model.model import Model


def hanging_nodes_warning(model: Model) -> str:
    """Return a warning if nodes hang on facets of their own body without a contact or constraint between them."""
    mesh = model.mesh
    node, facet, outer = hanging_nodes(mesh)
    relevant = ~model.related_points()[node]
    for pair in model.contact if len(node) else ():
        if pair.primary:
            relevant &= ~_paired_by_contact(mesh, pair.secondary, pair.primary, node, outer.corners[facet])
            relevant &= ~_paired_by_contact(mesh, pair.primary, pair.secondary, node, outer.corners[facet])
    return hanging_nodes_text(mesh, node[relevant], facet[relevant], outer)


def _paired_by_contact(mesh: Mesh, node_group: str, facet_group: str, node: Indices, corners: Numbers) -> Mask:
    """Return the mask (m,) of nodes of `node_group` on facets of `facet_group`, which have the `corners` (m, n_corners)."""
    in_node_group, in_facet_group = np.zeros((2, mesh.n_points), bool)
    in_node_group[mesh.points_of(node_group)] = True
    in_facet_group[mesh.points_of(facet_group)] = True
    return np.asarray(in_node_group[node] & (in_facet_group[corners] | (corners < 0)).all(axis=1))
