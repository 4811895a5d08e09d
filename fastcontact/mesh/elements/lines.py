"""Lines on [-1, 1]. The nodes are the two ends and the midpoint."""

import numpy as np

from fastcontact.mesh.elements._element import AnyArray, Element, quadratic, with_midpoints
from fastcontact.mesh.quadrature import gauss_line


def shape(xi: AnyArray) -> AnyArray:
    """Return the shape functions (m, 2) [-] of the linear line at `xi` (m, 1) [-]."""
    s = xi[:, 0]
    return np.stack([(1 - s) / 2, (1 + s) / 2], axis=1)


def shape_3(xi: AnyArray) -> AnyArray:
    """Return the shape functions (m, 3) [-] of the quadratic line at `xi` (m, 1) [-]."""
    s = xi[:, 0]
    return np.stack([s * (s - 1) / 2, s * (s + 1) / 2, 1 - s * s], axis=1)


LINE2 = Element(
    "line2", np.array([[-1.0], [1.0]]), edges=((0, 1),), facets=((0,), (1,)), shape=shape, quadrature=gauss_line(2),
    meshio="line", med="SE2", vtk=3, quadratic="line3",
)  # fmt: skip
LINE3 = quadratic(
    "line3", LINE2, (with_midpoints(LINE2), shape_3), quadrature=gauss_line(3), meshio="line3", med="SE3", vtk=21
)  # fmt: skip
ELEMENTS = LINE2, LINE3
