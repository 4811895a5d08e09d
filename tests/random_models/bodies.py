"""Bodies for random models: graded, crowned, bent, rotated and translated blocks and boxes."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

import fastcontact as fc

Array = NDArray[np.float64]
Random = np.random.Generator
FLAT = ("tri3", "quad4", "tri6", "quad8", "quad9")
SOLIDS = ("hex8", "tet4", "hex20", "hex27", "tet10", "wedge6", "wedge15", "wedge18", "pyramid5", "pyramid13")
# Sides of a body in any dimension; LEFT and FRONT are those where it slides along a plane of symmetry.
IN_SPACE = {"ZMIN": "BOTTOM", "ZMAX": "TOP", "XMIN": "LEFT", "XMAX": "RIGHT", "YMIN": "FRONT", "YMAX": "BACK"}


@dataclass(frozen=True)
class Placement:
    """Where bodies that are described by lengths along, (across) and up come to lie.

    Attributes
    ----------
    dim : int
    radius : float, optional
        Radius of the arc around which what lies at the height 0 is bent; None: not at all [length].
    upright : bool
        Along becomes y and up becomes x: layers of tubes in axisymmetry.
    Q, shift : ndarray (dim, dim), ndarray (dim,)
        Turn and shift of the whole.
    """

    dim: int
    radius: float | None = None
    upright: bool = False
    Q: Array = field(default_factory=lambda: np.eye(3))
    shift: Array = field(default_factory=lambda: np.zeros(3))

    def places(self, local: Array) -> Array:
        """Return where points (n, dim) given by lengths along, (across) and up lie."""
        x = local.copy()
        if self.radius is not None:
            angle, r = local[:, 0] / self.radius, self.radius + local[:, -1]
            x[:, 0], x[:, -1] = r * np.sin(angle), r * np.cos(angle) - self.radius
        if self.upright:
            x = x[:, ::-1].copy()
        return x @ self.Q[: self.dim, : self.dim].T + self.shift[: self.dim]

    def direction(self, *along: float) -> Array:
        """Return the direction (dim,) of a local vector at the origin."""
        vector = np.array(along, float)
        if self.upright:
            vector = vector[::-1]
        return self.Q[: self.dim, : self.dim] @ vector

    @property
    def flips(self) -> bool:
        """Whether it turns cells inside out."""
        return self.upright


@dataclass(frozen=True)
class Body:
    """A layer: its extent along, (across) and up, its faces, its cells.

    Attributes
    ----------
    name : str
    element : str
    low, high : ndarray (dim,)
        Corners [length].
    cells : tuple of int
    under, over : callable
        What is added to the height of its lower and upper face, by the lengths along (and across) (n, dim - 1) [length].
    grading : tuple of float
        Exponents of the positions along and up.
    distortion : float
        Of inner nodes, in the plane.
    """

    name: str
    element: str
    low: Array
    high: Array
    cells: tuple[int, ...]
    under: Callable[[Array], Array]
    over: Callable[[Array], Array]
    grading: tuple[float, float] = (1.0, 1.0)
    distortion: float = 0.0

    def mesh(self, at: Placement) -> fc.Mesh:
        """Return its mesh; groups are its name, and its sides with the name before them."""
        dim = len(self.low)
        if dim == 2:
            mesh = fc.generate.block((1.0, 1.0), self.cells, self.element, name=self.name, distortion=self.distortion)
        else:
            mesh = fc.generate.renamed(
                fc.generate.box((1.0, 1.0, 1.0), self.cells, self.element, name=self.name), IN_SPACE
            )
        unit = mesh.points.copy()
        unit[:, 0], up = unit[:, 0] ** self.grading[0], unit[:, -1] ** self.grading[1]
        x = self.low + (self.high - self.low) * unit
        flat = x[:, :-1]
        bottom, top = self.low[-1] + self.under(flat), self.high[-1] + self.over(flat)
        x[:, -1] = bottom + (top - bottom) * up
        mesh = mesh.replace(points=at.places(x))
        if at.flips:
            cells = {kind: block[:, fc.mesh.elements.get(kind).reversed] for kind, block in mesh.cells.items()}
            mesh = mesh.replace(cells=cells)
        return fc.generate.renamed(mesh, {g: f"{self.name}_{g}" for g in mesh.group_names if g != self.name})


def flat(x: Array) -> Array:
    """Return no height."""
    return np.zeros(len(x))


def rotation(random: Random, dim: int) -> Array:
    """Return a random rotation (3, 3), of the plane x, y in two dimensions."""
    if dim == 2:
        angle = random.uniform(0, 2 * np.pi)
        Q = np.eye(3)
        Q[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        return Q
    q = random.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
