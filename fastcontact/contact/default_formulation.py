"""Choice of the default formulation of a contact pair.

Between bodies the default is mortar with dual Lagrange multipliers, the only formulation that is accurate on any two surfaces
(``bench/defaults.py``, docs/reference/accuracy.md). Node-to-segment contact does not transmit a uniform pressure between
non-matching meshes, even with averaged normals, and matching meshes no longer match once the bodies slide. Without averaged
normals, the normal at a primary node is that of one of its facets. Continuous contact integrates over complete facets, which
is inaccurate where the other side ends or bends. Mortar with standard multipliers is more accurate by one digit on smooth
quadratic facets in 2D. However, each of its gaps involves the neighbouring nodes, so that with multigrid every closed
constraint costs a linear solution.

Against rigid obstacles the default is the continuous formulation, which also enforces contact between nodes, with two
exceptions. Node-to-segment is used on linear triangles and tetrahedra, and in 3D on facets whose nodes, including corners,
all carry pressure. Triangles and tetrahedra cannot satisfy all constraints of the continuous formulation, and its
pressures oscillate by up to 40 %; in 3D each of its integration points costs a linear solution. On the other facets in 3D,
which are quadratic, mortar is used with friction, because integration points with friction cannot be eliminated.
The option `integration` always selects the continuous formulation; `n_gauss` and `augmentation` select it instead of mortar.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from fastcontact.contact.integration import all_nodes_carry_pressure
from fastcontact.mesh import elements

# Options that mortar in two dimensions has for standard multipliers only.
STANDARD_OPTIONS = ("n_gauss", "augmentation")


def default_formulation(dim: int, options: Mapping[str, Any]) -> tuple[str, dict[str, Any], str]:
    """Return the default formulation of a pair in `dim` dimensions, its options, and the reason for the choice.

    The returned options are those of the user, `options`, and those that the choice adds. The reason is a clause that
    follows "because".
    """
    for name in ("multipliers", *(STANDARD_OPTIONS if dim == 2 else ())):
        if name in options:
            return "mortar", dict(options), f"the pair has the option '{name}'"
    reason = "these are accurate on any two surfaces and cost little with every linear solver"
    return "mortar", {**options, "multipliers": "dual"}, reason


def default_against_obstacle(
    dim: int, facet_types: Collection[str], of_simplices: bool, options: Mapping[str, Any]
) -> tuple[str, dict[str, Any], str]:
    """Return the default formulation of a side against a rigid obstacle, its options, and the reason for the choice.

    Parameters
    ----------
    dim : int
    facet_types : collection of str
        Element types of the facets of the side.
    of_simplices : bool
        Whether all facets belong to linear triangles or tetrahedra.
    options : mapping
        Options given by the user.
    """
    if facet_types and "integration" not in options:
        if of_simplices and all(elements.get(name).linear == name for name in facet_types):
            reason = "the pressures of continuous contact oscillate on linear triangles and tetrahedra"
            return "node_to_segment", dict(options), reason
        if dim == 3 and all(all_nodes_carry_pressure(name) for name in facet_types):
            return "node_to_segment", dict(options), "continuous contact costs many times as much in three dimensions"
        if dim == 3 and options.get("friction") and not any(name in options for name in STANDARD_OPTIONS):
            reason = "multigrid cannot eliminate continuous contact with friction in three dimensions"
            return "mortar", {**options, "multipliers": "dual"}, reason
    return "continuous", dict(options), "it also covers the region between nodes"
