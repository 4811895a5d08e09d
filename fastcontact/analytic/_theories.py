"""The theories that case files can name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fastcontact import analytic
from fastcontact._tools.lazy import LazyDict

_NAMES = (
    "block_sliding", "cattaneo_mindlin_line", "cattaneo_mindlin_sphere", "cone_punch", "finite_half_spheres", "flat_punch",
    "flat_punch_2d", "hertz_box", "hertz_elliptical", "hertz_line", "hertz_point", "paraboloid_punch", "persson_pin",
    "power_law_punch", "press_fit_cylinders", "press_fit_spheres", "receding_layer", "thick_cylinder", "thick_sphere",
)  # fmt: skip
THEORIES: LazyDict[Callable[..., Any]] = LazyDict(_NAMES, lambda name: getattr(analytic, name))
