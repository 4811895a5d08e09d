"""Rigid obstacles.

An obstacle returns signed distances, positive outside, and outward normals in its own frame. For shapes given by a height
(paraboloid, cone, a function of position), the distance is approximated by the vertical distance times the cosine of the
slope. The sign of this approximation is exact, and its value is accurate to first order near the surface. This suffices,
because the pairing is repeated until the points lie on the surface.

Coordinates are (x, y) in 2D, where x is the radius in axisymmetry, and (x, y, z) in 3D. The axis of a shape is along the last
coordinate.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from fastcontact.arrays import Array
from fastcontact.contact.obstacles.meshed import MeshedSurface
from fastcontact.contact.obstacles.shapes import Cylinder, FlatPunch, HalfSpace, Height, Sphere, cone, paraboloid
from fastcontact.errors import module_access


class Obstacle(Protocol):
    """A rigid shape."""

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return the signed distance (n,) [length] of `points` (n, dim) [length], and the unit outward normals (n, dim) [-].

        The distance is infinite if a point cannot touch the obstacle.
        """


SHAPES: dict[str, Callable[..., Obstacle]] = {
    "half_space": HalfSpace,
    "sphere": Sphere,
    "cylinder": Cylinder,
    "paraboloid": paraboloid,
    "cone": cone,
    "flat_punch": FlatPunch,
}

__all__ = [
    "SHAPES",
    "Cylinder",
    "FlatPunch",
    "HalfSpace",
    "Height",
    "MeshedSurface",
    "Obstacle",
    "Sphere",
    "cone",
    "paraboloid",
]


if not TYPE_CHECKING:  # not for type checkers, which report unknown names themselves
    __getattr__, __dir__ = module_access("fastcontact.obstacles", __all__)
