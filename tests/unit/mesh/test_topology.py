"""Topology: reoriented cells, folds, outer facets, and parts of bodies between hinges."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import body_of, elastic_model, united

import fastcontact as fc
from fastcontact.elasticity.stiffness import stiffness
from fastcontact.errors import MeshError
from fastcontact.mesh import elements, topology
from fastcontact.mesh.quality import check_cells
from fastcontact.model.rigid_motions import free_motions

NAMES = ["tri3", "tri6", "quad4", "quad8", "quad9", "tet4", "tet10", "hex8", "hex20", "wedge6", "pyramid5"]


def made(name):
    return body_of(name, (1.0, 1.0, 1.0), (3, 3, 3))


@pytest.mark.parametrize("name", NAMES)
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
    with pytest.raises(MeshError, match=r"cells \d+ and \d+ lie on the same side of the facet between them") as error:
        topology.oriented(mesh.replace(points=points))
    first, second = (int(word) for word in str(error.value).split()[1:4:2])
    rows = [number - mesh.offsets[name] for number in (first, second)]
    assert len(np.intersect1d(*mesh.cells[name][rows])) >= mesh.dim


@pytest.mark.parametrize("n_nodes", [2, 3, 4, 8])
@given(seed=st.integers(0, 2**32 - 1), n_points=st.integers(1, 9), n=st.integers(1, 40))
def test_pairs_of_equal_rows_connect_all_that_are_equal(n_nodes, seed, n_points, n):
    rows = np.random.default_rng(seed).integers(n_points, size=(n, n_nodes)).astype(np.int32)
    first, second = topology.equal_rows(rows)
    assert (rows[first] == rows[second]).all()
    keys = [tuple(row) for row in rows.tolist()]
    joined = [{row} for row in range(n)]
    for one, other in zip(first, second, strict=True):
        assert joined[one] is not joined[other]  # m rows are in m - 1 pairs
        joined[one] |= joined[other]
        for row in joined[other]:
            joined[row] = joined[one]
    assert [len(rows_alike) for rows_alike in joined] == [Counter(keys)[key] for key in keys]


def test_half_a_million_facets_round_one_node():
    # Were pairs of them compared, 1e11 would be: minutes.
    n = 500_000
    rim = np.arange(1, n + 1, dtype=np.int32)
    facets = np.column_stack([np.zeros(n, np.int32), np.concatenate([rim[: n // 2], rim[: n // 2]])])
    first, second = topology.equal_rows(facets)
    assert np.array_equal(np.sort(np.concatenate([first, second])), np.arange(n))


PLANE = ("tri3", "quad4", "tri6", "quad8")
SPACE = ("tet4", "hex8", "wedge6", "hex20")


def joined(element, *origins, merged=True):
    """Bodies of unit size at origins, merged where nodes coincide."""
    mesh = united(**{f"B{k}_": body_of(element, (1.0,) * 3, (1,) * 3, o) for k, o in enumerate(origins)})
    return fc.generate.merge_points(mesh, 1e-9) if merged else mesh


def zero_energy(mesh):
    """The number of motions without energy, from the stiffness matrix."""
    model = elastic_model(mesh, E=1.0)
    K = stiffness(mesh, model.kinematics, *model.material_numbers()).toarray()
    values = np.linalg.eigvalsh(K)
    return int((values < 1e-10 * values[-1]).sum())


CASES = [
    (PLANE, [(0.0, 0.0), (1.0, 1.0)], 2),
    (PLANE, [(0.0, 0.0), (1.0, 0.0)], 1),
    (PLANE, [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0), (3.0, 1.0)], 4),
    (PLANE, [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (1.0, -1.0)], 4),
    (PLANE, [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0)], 1),
    (PLANE, [(0.0, 0.0), (1.0, 1.0), (3.0, 3.0)], 3),
    (SPACE, [(0.0, 0.0, 0.0), (1.0, 1.0, 0.0)], 2),
    (SPACE, [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0)], 2),
    (SPACE, [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], 1),
    (SPACE, [(0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (2.0, 2.0, 1.0)], 3),
]


@pytest.mark.parametrize(
    ("element", "origins", "parts"), [(element, origins, parts) for kinds, origins, parts in CASES for element in kinds]
)
def test_motions_at_hinges_are_those_that_cost_no_energy(element, origins, parts):
    mesh = joined(element, *origins)
    assert fc.topology.rigid_parts(mesh).count == parts
    kinematics = "3d" if mesh.dim == 3 else "plane_strain"
    motions = free_motions(mesh, kinematics, np.zeros(mesh.points.shape, bool))
    assert len(motions) == zero_energy(mesh)
    K = stiffness(mesh, kinematics, *elastic_model(mesh, kinematics, E=1.0).material_numbers())
    assert np.abs(K @ motions.displacement).max() < 1e-12 * np.abs(K.diagonal()).max()
    assert np.linalg.matrix_rank(motions.displacement) == len(motions)


def test_three_bodies_in_a_triangle_hold_each_other():
    corners = np.array([[0, 0], [1, 0], [0.5, 0.5], [1, 0], [2, 0], [1.5, 0.5], [0.5, 0.5], [1.5, 0.5], [1, 1]], float)
    mesh = fc.generate.merge_points(fc.Mesh(corners, {"tri3": np.arange(9).reshape(3, 3)}), 1e-9)
    assert fc.topology.rigid_parts(mesh).count == 3
    assert len(free_motions(mesh, "plane_strain", np.zeros(mesh.points.shape, bool))) == zero_energy(mesh) == 3


def test_hinges_name_their_nodes_and_parts():
    mesh = joined("hex8", (0.0, 0.0, 0.0), (1.0, 1.0, 0.0))
    parts = fc.topology.rigid_parts(mesh)
    on_edge = np.flatnonzero((mesh.points[:, :2] == 1.0).all(axis=1))
    assert parts.hinge_node.tolist() == np.repeat(on_edge, 2).tolist()
    assert parts.hinge_part.tolist() == [0, 1, 0, 1]
    assert parts.hinges_of(0).tolist() == parts.hinges_of(1).tolist() == on_edge.tolist()
    assert parts.nodes_of(1).tolist() == mesh.points_of("B1_BOX").tolist()
    assert (parts.part[on_edge] == 0).all()


def test_bodies_apart_and_points_of_none_have_no_hinges():
    mesh = joined("quad4", (0.0, 0.0), (1.0, 1.0), merged=False)
    parts = fc.topology.rigid_parts(mesh.replace(points=np.vstack([mesh.points, [[9.0, 9.0]]])))
    assert parts.count == 2
    assert parts.part.tolist() == [0] * 4 + [1] * 4 + [-1]
    assert not len(parts.hinge_node)


def test_a_facet_between_elements_of_two_kinds_or_orders_joins():
    points = [[0, 0], [1, 0], [1, 1], [0, 1], [2, 0.5], [0.5, 0.0], [1, 0.5], [0.5, 1], [0, 0.5]]
    assert fc.topology.rigid_parts(fc.Mesh(points[:5], {"quad4": [[0, 1, 2, 3]], "tri3": [[1, 4, 2]]})).count == 1
    orders = fc.Mesh(points, {"quad8": [[0, 1, 2, 3, 5, 6, 7, 8]], "tri3": [[1, 4, 2]]})
    assert len(np.unique(fc.topology.cells_joined_by_facets(orders))) == 2
    assert fc.topology.rigid_parts(orders).count == 1  # two common nodes hold as well


def test_parts_do_not_depend_on_the_order_of_cells():
    mesh = joined("tet4", (0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (2.0, 0.0, 0.0))
    rng = np.random.default_rng(1)
    shuffled = mesh.replace(
        cells={name: rng.permutation(block) if name == "tet4" else block for name, block in mesh.cells.items()},
        cell_groups={},
    )
    ours, theirs = fc.topology.rigid_parts(mesh), fc.topology.rigid_parts(shuffled)
    assert ours.hinge_node.tolist() == theirs.hinge_node.tolist()
    pairs = np.unique(np.stack([ours.part, theirs.part]), axis=1)
    assert ours.count == theirs.count == 3
    assert pairs.shape[1] <= ours.count + len(np.unique(ours.hinge_node))
    assert fc.topology.bodies(mesh)[0] == 1
