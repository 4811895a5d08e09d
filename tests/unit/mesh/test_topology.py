"""Inverted cells are reoriented; a folded mesh is refused, since reorientation would hide the fold."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fastcontact import topology
from fastcontact.errors import MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.generate import block, box
from fastcontact.mesh.quality import check_cells

NAMES = ["tri3", "tri6", "quad4", "quad8", "quad9", "tet4", "tet10", "hex8", "hex20", "wedge6", "pyramid5"]


def made(name):
    if elements.get(name).dim == 2:
        return block((1.0, 1.0), (3, 3), name)
    return box((1.0, 1.0, 1.0), (3, 3, 3), name)


@pytest.mark.parametrize("name", [name for name in NAMES if name in elements.ELEMENTS])
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 1.0))
@settings(max_examples=10, deadline=None)
def test_any_cells_turned_are_turned_back(name, seed, share):
    mesh = made(name)
    block_ = mesh.cells[name].copy()
    wrong = np.random.default_rng(seed).random(len(block_)) < share
    block_[wrong] = block_[wrong][:, elements.get(name).reversed]
    found, turned = topology.oriented(mesh.replace(cells={**mesh.cells, name: block_}))
    assert turned == wrong.sum()
    check_cells(found)
    assert (np.sort(found.cells[name], axis=1) == np.sort(mesh.cells[name], axis=1)).all()


@pytest.mark.parametrize("name", ["tri3", "tri6", "quad4", "quad8", "tet4", "tet10"])
def test_a_folded_mesh_is_refused_with_the_cells_and_the_place(name):
    mesh = made(name)
    points = mesh.points.copy()
    inner = int(np.argmin(np.linalg.norm(points - 1 / 3, axis=1)))
    points[inner] += (0.45, 0.33, 0.4)[: mesh.dim]
    with pytest.raises(
        MeshError, match=r"cells \d+ and \d+ lie on the same side of the facet between them, near"
    ) as error:
        topology.oriented(mesh.replace(points=points))
    first, second = (int(word) for word in str(error.value).split()[1:4:2])
    rows = [number - mesh.offsets[name] for number in (first, second)]
    assert len(np.intersect1d(*mesh.cells[name][rows])) >= mesh.dim
