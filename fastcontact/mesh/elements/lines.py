"""Lines on [-1, 1]. The nodes are the two ends and the midpoint."""

import numpy as np

from fastcontact.mesh.elements._element import Element, polynomial, quadratic, with_middles
from fastcontact.mesh.quadrature import gauss_line

NODES, shape, gradient = polynomial(np.array([[-1.0], [1.0]]), lambda i: i <= 1)

LINE2 = Element(
    "line2", NODES, edges=((0, 1),), facets=((0,), (1,)), shape=shape, gradient=gradient, quadrature=gauss_line(2),
    meshio="line", med="SE2", vtk=3, quadratic="line3",
)  # fmt: skip
LINE3 = quadratic(
    "line3", LINE2, polynomial(with_middles(LINE2), lambda i: True), quadrature=gauss_line(3), meshio="line3", med="SE3",
    vtk=21,
)  # fmt: skip
ELEMENTS = LINE2, LINE3
