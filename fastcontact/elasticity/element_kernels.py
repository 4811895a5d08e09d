# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Dispatch to the element loops of two or three dimensions."""

from functools import cache
from types import ModuleType


@cache
def loops(dim: int) -> ModuleType:
    """Return the module with `add_stiffness`, `stress` and `add_internal_force` for `dim` coordinates."""
    if dim == 2:
        from fastcontact.elasticity import element_2d_kernels

        return element_2d_kernels
    from fastcontact.elasticity import element_3d_kernels

    return element_3d_kernels
