"""Removal of hidden surfaces of triangles in parallel projection."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array, Indices, Mask

# Distance behind a triangle, relative to the total size, up to which a point is taken to lie on the triangle.
ON_IT = 1e-4


class Screen:
    """Triangles sorted by their position on the screen.

    Parameters
    ----------
    triangles : ndarray (n, 3, 3)
        Corners of the triangles [length].
    eye : ndarray (3,)
        Unit vector towards the viewer [-].
    """

    def __init__(self, triangles: Array, eye: Array) -> None:
        self.axes = across(eye)
        flat = triangles @ self.axes.T
        self.corners, self.origin = flat[..., :2], flat[..., :2].reshape(-1, 2).min(axis=0)
        self.depth = flat[..., 2]
        size = np.ptp(flat.reshape(-1, 3), axis=0).max()
        self.tolerance = ON_IT * size
        self.n_bins = int(np.clip(np.sqrt(len(flat)), 1, 256))
        self.bin = 1.0001 * max(np.ptp(flat[..., :2].reshape(-1, 2), axis=0).max(), 1e-300) / self.n_bins
        self._sort()

    def _sort(self) -> None:
        """List the triangles of each square of the screen, in the order of the squares."""
        low, high = self._square(self.corners.min(axis=1)), self._square(self.corners.max(axis=1))
        across, up = (high - low + 1).T
        count = across * up
        number, within = _counted(count)
        column, row = within % across[number], within // across[number]
        square = (low[number, 0] + column) * self.n_bins + low[number, 1] + row
        order = np.argsort(square, kind="stable")
        self.members = number[order]
        self.starts = np.searchsorted(square[order], np.arange(self.n_bins**2 + 1))

    def _square(self, points: Array) -> Indices:
        return np.clip(((points - self.origin) / self.bin).astype(np.int64), 0, self.n_bins - 1)

    def hidden(self, places: Array) -> Mask:
        """Return whether each position (..., 3) [length] is hidden behind a triangle."""
        flat = places.reshape(-1, 3) @ self.axes.T
        column, row = self._square(flat[:, :2]).T
        square = column * self.n_bins + row
        first, count = self.starts[square], self.starts[square + 1] - self.starts[square]
        index, within = _counted(count)
        triangle = self.members[first[index] + within]
        behind = self._behind(flat[index], triangle)
        return np.asarray(np.bincount(index[behind], minlength=len(flat)).astype(bool).reshape(places.shape[:-1]))

    def _behind(self, flat: Array, triangle: Indices) -> Mask:
        """Return whether each point (n, 3) in screen coordinates [length] lies behind its triangle (n,)."""
        a, b, c = np.moveaxis(self.corners[triangle], 1, 0)
        area = _cross(b - a, c - a)
        area = np.where(area == 0.0, np.inf, area)
        p = flat[:, :2]
        weights = np.stack([_cross(b - p, c - p), _cross(c - p, a - p), _cross(a - p, b - p)], axis=1) / area[:, None]
        depth = (weights * self.depth[triangle]).sum(axis=1)
        return np.asarray((weights > 0.0).all(axis=1) & (depth > flat[:, 2] + self.tolerance))


def _counted(count: Indices) -> tuple[Indices, Indices]:
    """Return, for entries with `count` (n,) members each, the entry of each member and its number within the entry."""
    return np.repeat(np.arange(len(count)), count), np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)


def across(eye: Array) -> Array:
    """Return three orthonormal vectors (3, 3) [-]: two normal to the line of sight, and the vector to the viewer."""
    helper = np.eye(3)[int(np.argmin(np.abs(eye)))]
    first = np.cross(helper, eye)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(eye, first), eye])


def seen_along(direction: Array, aligned: float) -> tuple[Array, tuple[str, str] | None]:
    """Return two axes (2, 3) [-] for a view along a unit vector (3,) [-].

    If the magnitude of a component of the vector is at least `aligned`, they are the other coordinate axes and their names
    are returned; otherwise they are normal to the vector and the names are None.
    """
    along = int(np.argmax(np.abs(direction)))
    if abs(direction[along]) < aligned:
        return across(direction)[:2], None
    first, second = [axis for axis in range(3) if axis != along]
    return np.eye(3)[[first, second]], ("xyz"[first], "xyz"[second])


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
