"""Closed-form solutions of contact mechanics.

Each module contains a theory, or a group of related ones, as frozen result classes and functions that return instances of
them. `THEORIES` contains the functions that case files can name. Most normal contacts have `radius` (the half-width in plane
problems), `force`, `pressure_max` and `pressure(distance)`. Units are those of the caller; forces of plane problems are per
unit length.

Positions are numbers or arrays of any shape (...), and results have the same shape, followed by the components of
vectors and tensors. ModelError is raised if a number is out of range, or if not exactly one load is given where one is
required.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from fastcontact.analytic._cattaneo_mindlin import (
    BlockSliding,
    CattaneoMindlinLine,
    CattaneoMindlinSphere,
    block_sliding,
    cattaneo_mindlin_line,
    cattaneo_mindlin_sphere,
)
from fastcontact.analytic._finite_spheres import FiniteHalfSpheres, finite_half_spheres
from fastcontact.analytic._half_space import VonMisesMaximum
from fastcontact.analytic._inputs import Bodies
from fastcontact.analytic._lame import (
    LameShell,
    PressFit,
    press_fit_cylinders,
    press_fit_spheres,
    thick_cylinder,
    thick_sphere,
)
from fastcontact.analytic._manufactured import HertzBox, hertz_box
from fastcontact.analytic._persson import PerssonPin, persson_limit_angle, persson_pin
from fastcontact.analytic._punches import (
    FlatPunch,
    FlatPunch2D,
    PowerLawPunch,
    bonded_stiffness_ratio,
    cone_punch,
    flat_punch,
    flat_punch_2d,
    paraboloid_punch,
    power_law_punch,
    spence_stick_ratio,
)
from fastcontact.analytic._receding import RecedingLayer, receding_layer
from fastcontact.analytic.hertz_elliptical import HertzElliptical, hertz_elliptical
from fastcontact.analytic.hertz_line import HertzLine, hertz_line
from fastcontact.analytic.hertz_point import HertzPoint, hertz_point
from fastcontact.errors import getattr_and_dir

THEORIES: dict[str, Callable[..., Any]] = {
    factory.__name__: factory
    for factory in (
        block_sliding, cattaneo_mindlin_line, cattaneo_mindlin_sphere, cone_punch, finite_half_spheres, flat_punch,
        flat_punch_2d, hertz_box, hertz_elliptical, hertz_line, hertz_point, paraboloid_punch, persson_pin,
        power_law_punch, press_fit_cylinders, press_fit_spheres, receding_layer, thick_cylinder, thick_sphere,
    )
}  # fmt: skip

__all__ = [
    "THEORIES", "BlockSliding", "Bodies", "CattaneoMindlinLine", "CattaneoMindlinSphere", "FiniteHalfSpheres",
    "FlatPunch", "FlatPunch2D", "HertzBox", "HertzElliptical", "HertzLine", "HertzPoint", "LameShell", "PerssonPin",
    "PowerLawPunch", "PressFit", "RecedingLayer", "VonMisesMaximum", "block_sliding", "bonded_stiffness_ratio",
    "cattaneo_mindlin_line", "cattaneo_mindlin_sphere", "cone_punch", "finite_half_spheres", "flat_punch",
    "flat_punch_2d", "hertz_box", "hertz_elliptical", "hertz_line", "hertz_point", "paraboloid_punch",
    "persson_limit_angle", "persson_pin", "power_law_punch", "press_fit_cylinders", "press_fit_spheres",
    "receding_layer", "spence_stick_ratio", "thick_cylinder", "thick_sphere",
]  # fmt: skip


if not TYPE_CHECKING:  # type checkers see the imports above
    __getattr__, __dir__ = getattr_and_dir("fastcontact.analytic", __all__)
