"""Mesh generators with named groups, and operations on meshes.

A generator is a function of plain numbers, strings and tuples that returns a `Mesh`. The generators in ``GENERATORS`` are
available in case files and on the command line. An argument out of range raises MeshError.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from fastcontact.errors import module_access
from fastcontact.mesh.generate._refine import circles, linearised, refined
from fastcontact.mesh.generate._sphere import sphere_octant, sphere_on_block
from fastcontact.mesh.generate.blocks import block, block_on_block, cylinder_on_block
from fastcontact.mesh.generate.box import box
from fastcontact.mesh.generate.cut import cut
from fastcontact.mesh.generate.forest import Forest
from fastcontact.mesh.generate.half_planes import crowned_blocks, graded_block, punched_block
from fastcontact.mesh.generate.half_spheres import half_spheres, quarter_disc, rings
from fastcontact.mesh.generate.quadratic import Circle, to_quadratic
from fastcontact.mesh.generate.transform import (
    merge_points,
    mirrored,
    renamed,
    transformed,
    union,
    with_reference_points,
)
from fastcontact.mesh.mesh import Mesh

_GENERATORS = (
    half_spheres, quarter_disc, block, block_on_block, cylinder_on_block, box, graded_block, sphere_on_block, sphere_octant,
    punched_block, crowned_blocks, rings,
)  # fmt: skip
GENERATORS: dict[str, Callable[..., Mesh]] = {make.__name__.replace("_", "-"): make for make in _GENERATORS}

__all__ = [
    "GENERATORS", "Circle", "Forest", "block", "block_on_block", "box", "circles", "crowned_blocks",
    "cut", "cylinder_on_block", "graded_block", "half_spheres", "linearised", "merge_points", "mirrored", "punched_block",
    "quarter_disc", "refined", "renamed", "rings", "sphere_octant", "sphere_on_block", "to_quadratic", "transformed",
    "union", "with_reference_points",
]  # fmt: skip


if not TYPE_CHECKING:  # not for type checkers, which report unknown names themselves
    __getattr__, __dir__ = module_access("fastcontact.generate", __all__)
