# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Dispatch to the element loops of two or three dimensions."""

from types import ModuleType

from fastcontact.elasticity import element_2d_kernels, element_3d_kernels


def loops(dim: int) -> ModuleType:
    """Return the module with `add_stiffness`, `stress`, `largest_rotation` and `add_internal_force` for `dim` coordinates."""
    return {2: element_2d_kernels, 3: element_3d_kernels}[dim]
