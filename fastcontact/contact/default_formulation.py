"""Default formulation of a contact pair: between bodies, mortar with dual Lagrange multipliers.

Of all choices it alone is right on any two surfaces (``bench/defaults.py``, docs/reference/accuracy.md). Node-to-segment
contact takes the normal of one of two facets at a node that lies opposite a node, and nodes that lie so at first no
longer do once the bodies slide; with averaged normals, too, it passes no uniform pressure between meshes that do not
match; quadrature over whole facets makes errors where the other side ends or bends. Standard multipliers have a digit
more on smooth quadratic facets in the plane, but each of their gaps involves the neighbouring nodes: with multigrid every
closed one costs a linear solution.

Against rigid obstacles it is the continuous one, which also knows what lies between nodes, but node against obstacle on
linear triangles, and in space on all facets whose nodes carry pressure, corners included; on the other facets in space,
which are quadratic, it is mortar again where there is friction. Triangles and tetrahedra cannot meet all conditions of the
continuous formulation, and its pressures oscillate by up to 40 %; in space each of its integration points costs a linear
solution, and with friction nothing eliminates them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from fastcontact.contact.integration import all_nodes_carry
from fastcontact.mesh import elements

# Options of mortar in the plane that only standard multipliers have.
OF_STANDARD = ("n_gauss", "augmentation")


def default_formulation(dim: int, options: Mapping[str, Any]) -> tuple[str, dict[str, Any], str]:
    """Return the name of the formulation of a pair in 2 or 3 dimensions, its options, and why, as the end of a sentence.

    The options are those that the user gave, `options`, and what the choice adds to them.
    """
    asked = [name for name in OF_STANDARD if name in options] if dim == 2 else []
    if "multipliers" in options:
        return "mortar", dict(options), "the pair has the option 'multipliers'"
    if asked:
        return "mortar", dict(options), f"the pair has the option '{asked[0]}'"
    why = "these are right on any two surfaces and cost little with every linear solver"
    return "mortar", {**options, "multipliers": "dual"}, why


def against_obstacle(
    dim: int, facets: Collection[str], of_simplices: bool, options: Mapping[str, Any]
) -> tuple[str, dict[str, Any], str]:
    """Return the formulation of a side against a rigid obstacle, its options, and why, as the end of a sentence.

    Parameters
    ----------
    dim : int
    facets : collection of str
        The kinds of facets on the side.
    of_simplices : bool
        Whether linear triangles or tetrahedra alone have them.
    options : mapping
        Those that the user gave.
    """
    if facets and "integration" not in options:
        if of_simplices and all(elements.get(name).linear == name for name in facets):
            why = "the pressures of the continuous one oscillate on linear triangles and tetrahedra"
            return "node_to_segment", dict(options), why
        if dim == 3 and all(all_nodes_carry(name) for name in facets):
            return "node_to_segment", dict(options), "the continuous one costs many times as much in space"
        if dim == 3 and options.get("friction") and not any(name in options for name in OF_STANDARD):
            why = "multigrid cannot eliminate the continuous one with friction in space"
            return "mortar", {**options, "multipliers": "dual"}, why
    return "continuous", dict(options), "it also knows what lies between nodes"
