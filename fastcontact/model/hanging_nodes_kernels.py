# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Facets close to nodes that do not belong to them, found by a tree of boxes."""

import numpy as np

from fastcontact._jit.decorators import interpretable_kernel
from fastcontact.contact.search.box_tree_kernels import DEPTH, square_to_box


@interpretable_kernel
def facing_facets(points, nodes, outward, facets, centre, normal, reach, tree, order, facing):
    """Fill `facing` (m, k) with the facets that each of `nodes` (m,) faces at a distance below their `reach`, -1 for none.

    A node faces a facet (n, n_nodes; -1 for no node) if it does not belong to the facet but lies in its box, and if the
    angle between the `normal` (n, dim) of the facet and the normal `outward` (n_points, dim) of the node exceeds 120 degrees.
    Distances are measured from the plane through the `centre` (n, dim). The leaves of the tree are the boxes of the facets in
    their `order` (n,).
    """
    stack, leaves = np.empty(DEPTH, np.int64), len(tree.low) // 2
    for i in range(len(nodes)):
        node, count, top = nodes[i], 0, 1
        point = points[node]
        stack[0] = 1
        while top > 0 and count < facing.shape[1]:
            top -= 1
            box = stack[top]
            if square_to_box(tree, box, point) > 0.0:
                continue
            if box < leaves:
                stack[top], stack[top + 1] = 2 * box + 1, 2 * box
                top += 2
                continue
            f = order[box - leaves]
            along, height = 0.0, 0.0
            for d in range(points.shape[1]):
                along += normal[f, d] * outward[node, d]
                height += normal[f, d] * (point[d] - centre[f, d])
            if along > -0.5 or abs(height) > reach[f]:
                continue
            is_corner = False
            for a in range(facets.shape[1]):
                is_corner = is_corner or facets[f, a] == node
            if not is_corner:
                facing[i, count] = f
                count += 1
