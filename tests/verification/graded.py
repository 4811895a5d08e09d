"""Shared helpers: blocks with given grid lines, fine where bodies touch."""

import numpy as np

from fastcontact.mesh.generate import block


def lines(size, fine, extent, growth=1.25):
    """Places from 0 to `extent`: segments of length `size` up to `fine`, then each longer than the last by `growth`."""
    equal = np.linspace(0.0, fine, round(fine / size) + 1)
    growing = size * np.cumsum(growth ** np.arange(1, 200))
    last = np.searchsorted(growing, extent - fine)
    return np.concatenate([equal, fine + growing[: last + 1] * (extent - fine) / growing[last]])


def graded_block(x, y, element, name="BLOCK"):
    """`generate.block` with its groups, the grid lines at x and y."""
    mesh = block((len(x) - 1.0, len(y) - 1.0), (len(x) - 1, len(y) - 1), element, name=name)
    at = [np.interp(mesh.points[:, k], np.arange(len(lines)), lines) for k, lines in enumerate((x, y))]
    return mesh.replace(points=np.column_stack(at))
