"""Rigid obstacles.

An obstacle returns signed distances, positive outside, and outward normals in its own frame. For shapes given by a height
(paraboloid, cone, a function of position), the distance is approximated by the distance along the last coordinate axis,
multiplied by the cosine of the slope angle. The sign of this approximation is exact, and its value is accurate to first
order near the surface. This suffices, because the pairing is repeated until the points lie on the surface.

Coordinates are (x, y) in 2D, where x is the radius in axisymmetry, and (x, y, z) in 3D. The axis of a shape is along the last
coordinate.
"""

from __future__ import annotations

from fastcontact._tools.lazy import lazy_names

__getattr__, __dir__, __all__ = lazy_names(__name__, "fastcontact.obstacles")
