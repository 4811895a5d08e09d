"""Thirteen-node pyramid: corners, then mid nodes of the base's edges and of the rising ones; 27 integration points.

Rational shape functions (Bedrosian, Int. J. Numer. Meth. Engng 35, 1992). The conical product rule integrates their
gradients exactly, on curved cells too, so that patch tests are passed; code_aster uses 10 points.
"""

import numpy as np

from fastcontact.mesh.elements import pyramid5
from fastcontact.mesh.elements._element import Array, Element
from fastcontact.mesh.elements.pyramid5 import X, Y, collapsed
from fastcontact.mesh.quadrature import conical_pyramid

FIRST, SECOND = np.array(pyramid5.EDGES).T
NODES = np.vstack([pyramid5.NODES, (pyramid5.NODES[FIRST] + pyramid5.NODES[SECOND]) / 2])
# The sides of the base run along x at y = -1, along y at x = 1, along x at y = 1, along y at x = -1.
SIDES = np.array([-1.0, 1.0, 1.0, -1.0])
ALONG_X = np.array([True, False, True, False])


def shape(xi: Array) -> Array:
    """Shape functions (m, 13) [-] at `xi` (m, 3) [-]."""
    (a, b, t), z = collapsed(xi), xi[:, 2:3]
    corner = pyramid5.shape(xi)[:, :4] * (xi[:, 0:1] * X + xi[:, 1:2] * Y - 1)
    base = t * t / 2 * np.where(ALONG_X, (1 - a * a) * (1 + SIDES * b), (1 - b * b) * (1 + SIDES * a))
    return np.column_stack([corner, z * (2 * z - 1), base, 4 * z * pyramid5.shape(xi)[:, :4]])


def gradient(xi: Array) -> Array:
    """Derivatives (m, 13, 3) [-] at `xi` (m, 3) [-]."""
    (a, b, t), z = collapsed(xi), xi[:, 2:3]
    N, dN = pyramid5.shape(xi)[:, :4, None], pyramid5.gradient(xi)[:, :4]
    outward = (xi[:, 0:1] * X + xi[:, 1:2] * Y - 1)[:, :, None]
    corner = dN * outward + N * np.column_stack([X, Y, np.zeros(4)])
    apex = np.zeros((len(xi), 1, 3))
    apex[:, 0, 2] = 4 * z[:, 0] - 1
    base = np.where(ALONG_X[:, None], _side(a, b, t, (0, 1)), _side(b, a, t, (1, 0)))
    rising = 4 * (dN * z[:, :, None] + N * np.array([0.0, 0.0, 1.0]))
    return np.concatenate([corner, apex, base, rising], axis=1)


def _side(a: Array, b: Array, t: Array, axes: tuple[int, int]) -> Array:
    """Derivatives (m, 4, 3) of t^2 (1 - a^2) (1 + S b) / 2 for the four S of `SIDES`; `axes` of a and b."""
    functions = np.empty((len(a), 4, 3))
    functions[:, :, axes[0]] = -a * t * (1 + SIDES * b)
    functions[:, :, axes[1]] = t * (1 - a * a) * SIDES / 2
    functions[:, :, 2] = (1 - a * a) * t * SIDES * b / 2 - t * (1 + SIDES * b)
    return functions


ELEMENT = Element(
    name="pyramid13", nodes=NODES, edges=pyramid5.EDGES,
    facets=(
        (0, 3, 2, 1, 8, 7, 6, 5), (0, 1, 4, 5, 10, 9), (1, 2, 4, 6, 11, 10), (2, 3, 4, 7, 12, 11), (3, 0, 4, 8, 9, 12),
    ),
    shape=shape, gradient=gradient, quadrature=conical_pyramid(3), meshio="pyramid13", med="P13", vtk=27,
    linear="pyramid5", quadratic="pyramid13", corner_shape=pyramid5.shape, dilatation=0,
)  # fmt: skip
