"""The element loops for the dimension of a mesh: the one place that chooses between two and three dimensions."""

from types import ModuleType

from fastcontact.kernels import solid2d, solid3d


def loops(dim: int) -> ModuleType:
    """Return the module with `add_stiffness`, `stress`, `largest_rotation` and `add_internal_force` for `dim` coordinates."""
    return {2: solid2d, 3: solid3d}[dim]
