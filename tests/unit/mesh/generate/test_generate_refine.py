"""Refined meshes: divided cells, new points on curves and in their groups."""

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.mesh.generate import circles, refined
from fastcontact.mesh.mesh import Mesh

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
MIDDLES = np.array([[0.5, 0.0], [1.0, 0.5], [0.5, 1.0], [0.0, 0.5]])


def one_cell(name):
    points = {
        "tri3": SQUARE[:3], "quad4": SQUARE, "quad8": np.vstack([SQUARE, MIDDLES]),
        "tri6": np.vstack([SQUARE[:3], MIDDLES[:2], [[0.5, 0.5]]]), "quad9": np.vstack([SQUARE, MIDDLES, [[0.5, 0.5]]]),
    }[name]  # fmt: skip
    bottom = [0, 1] if name in ("tri3", "quad4") else [0, 1, {"tri6": 3}.get(name, 4)]
    groups = {
        "corner": np.array([0]),
        "bottom": np.array(bottom),
        "all": np.arange(len(points)),
        "far": np.array([0, 2]),
    }
    return Mesh(points, {name: np.arange(len(points))[None]}, {}, groups)


@pytest.mark.parametrize("name", ["tri3", "tri6", "quad4", "quad8", "quad9"])
def test_new_points_join_the_groups_that_hold_all_of_their_edge(name):
    mesh = refined(one_cell(name))
    assert len(mesh.cells[name]) == 4
    assert mesh.point_groups["corner"].tolist() == [0]
    assert set(mesh.point_groups["all"]) == set(range(mesh.n_points))
    bottom = np.flatnonzero(mesh.points[:, 1] == 0.0)
    assert set(mesh.point_groups["bottom"]) == set(bottom)
    assert len(bottom) == (3 if name in ("tri3", "quad4") else 5)
    # The ends of a diagonal are no edge, but where a triangle has it as one.
    diagonal = np.flatnonzero(mesh.points[:, 0] == mesh.points[:, 1])
    expected = set(diagonal) if name == "tri3" else {0, 2}
    assert set(mesh.point_groups["far"]) == expected


@pytest.mark.parametrize("name", ["tri3", "tri6", "quad4", "quad9"])
def test_arcs_stay_round_and_areas_add_up(name):
    mesh = fc.generate.half_spheres(name, **({"size": 12.0} if name.startswith("tri") else {"segments": 3}))
    fine = refined(mesh, circles(mesh))
    for group, centre in (("CONT1", -50.0), ("CONT2", 50.0)):
        r = np.linalg.norm(fine.points[fine.points_of(group)] - [0.0, centre], axis=1)
        assert r == pytest.approx(50.0, rel=1e-12)
    assert sum(map(len, fine.solids.values())) == 4 * sum(map(len, mesh.solids.values()))
    assert len(fine.points_of("CONT1")) == 2 * len(mesh.points_of("CONT1")) - 1
