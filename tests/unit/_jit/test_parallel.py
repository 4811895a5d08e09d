"""Work shared by threads: the same bits for any number of threads; waiting threads of libraries sleep."""

import os
import subprocess
import sys
import threading

import numpy as np
import pytest
from models import elastic_model
from scipy.sparse import bsr_array

import fastcontact as fc
from fastcontact._jit import decorators as _jit
from fastcontact._jit import parallel
from fastcontact.elasticity import constrained_system, stiffness


@pytest.fixture
def threads(monkeypatch):
    def use(count):
        monkeypatch.setattr(parallel, "SINGLE_THREAD_WORK", 0)
        monkeypatch.setattr(_jit, "threads", lambda: count)

    return use


@pytest.mark.parametrize("count", [1, 2, 7, 40])
def test_every_point_has_an_owner_that_sees_all_its_cells(threads, count):
    threads(count)
    cells = np.random.default_rng(count).integers(0, 50, (40, 4)).astype(np.int32)
    owner, parts = stiffness.owners(cells, 60)
    assert len(parts) == count
    begins = [*(low for low, _ in parts), len(cells)]
    for point in range(50):
        having = np.flatnonzero((cells == point).any(axis=1))
        if len(having):
            low, high = parts[owner[point]]
            assert low <= having[0] <= having[-1] < high
            assert having[0] < begins[owner[point] + 1]  # nobody has an earlier one


@pytest.mark.parametrize("count", [2, 7])
def test_patterns_and_supports_taken_out_are_those_of_one_thread(threads, count):
    mesh = fc.generate.box((1.0, 1.0, 1.0), (4, 3, 5), "hex8")
    supported = np.random.default_rng(0).random(3 * mesh.n_points) < 0.2
    data = np.random.default_rng(1).normal(size=(len(stiffness.sparsity(mesh).indices), 3, 3))
    found = []
    for number in (1, count):
        threads(number)
        pattern = stiffness.sparsity(mesh)
        K = bsr_array((data.copy(), pattern.indices, pattern.indptr))
        left, taken = constrained_system.separate_supports(K, supported)
        found.append((pattern.indptr, pattern.indices, pattern.slots["hex8"], left.data, taken.indptr, taken.data))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("element", ["hex8", "tet4"])
def test_parts_work_on_equally_many_cells(threads, element):
    mesh = fc.generate.box((1.0, 1.0, 1.0), (24, 24, 24), element)
    cells = mesh.cells[element]
    for count in (2, 3):
        threads(count)
        owner, parts = stiffness.owners(cells, mesh.n_points)
        work = [np.any(owner[cells] == part, axis=1).sum() for part in range(count)]
        assert max(work) < 1.01 * min(work)
        assert all(
            np.any(owner[cells[low:high]] == part, axis=1).sum() == work[part] for part, (low, high) in enumerate(parts)
        )


def test_a_fifth_of_the_cells_is_worthwhile_with_five_times_the_nodes(monkeypatch):
    monkeypatch.setattr(_jit, "threads", lambda: 2)
    little = parallel.SINGLE_THREAD_WORK // (5 * parallel.NODES_PER_CELL)
    assert len(parallel.portions(little, 5 * parallel.NODES_PER_CELL)) == 1
    assert len(parallel.portions(little + 1, 5 * parallel.NODES_PER_CELL)) == 2


def test_rows_are_spread_over_threads_and_an_error_in_one_of_them_is_raised(threads):
    threads(3)
    ranges, idents = [], set()

    def rows(low, high, wrong):
        ranges.append((low, high))
        idents.add(threading.get_ident())
        if low <= wrong < high:
            raise ValueError(wrong)
        barrier.wait(10.0)

    barrier = threading.Barrier(3)
    parallel.parallel_for(rows, 10, 1, -1)
    assert sorted(ranges) == [(0, 3), (3, 6), (6, 10)]
    assert len(idents) == 3
    barrier = threading.Barrier(2)
    for wrong in (0, 9):
        with pytest.raises(ValueError, match=str(wrong)):
            parallel.parallel_for(rows, 10, 1, wrong)
    ranges.clear()
    barrier = threading.Barrier(1)
    parallel.parallel_for(rows, 10, 0, -1)
    assert ranges == [(0, 10)]


@pytest.mark.parametrize("element", ["tri3", "tri6", "quad4", "quad8", "tet4", "tet10", "hex8", "hex20", "wedge6"])
def test_assembly_and_recovery_give_the_same_bits_for_any_number_of_threads(threads, element):
    solid = element[:3] in ("tet", "hex", "wed")
    mesh = (
        fc.generate.box((1.0, 2.0, 1.0), (3, 2, 2), element)
        if solid
        else fc.generate.block((1.0, 2.0), (4, 3), element)
    )
    random = np.random.default_rng(7)
    mesh = mesh.replace(points=mesh.points + 0.02 * random.random(mesh.points.shape))
    kinematics = "3d" if solid else "axisymmetric"
    moduli, material = elastic_model(mesh, kinematics, E=1.0).material_numbers()
    u = random.random(mesh.points.shape)
    found = []
    for count in (1, 2, 3, 5):
        threads(count)
        K = stiffness.stiffness(mesh, kinematics, moduli, material)
        stress = fc.recovery.stress_at_points(mesh, kinematics, moduli, material, u)
        nodal = fc.recovery.nodal_stress(mesh, kinematics, moduli, material, u)
        found.append((K.data.tobytes(), stress[element].tobytes(), nodal.tobytes()))
    assert len(set(found)) == 1


def test_every_node_belongs_to_one_part_of_a_nodal_average(threads):
    cells = fc.generate.box((1.0, 1.0, 1.0), (24, 24, 24), "hex8").cells["hex8"]
    for count in (1, 2, 4):
        threads(count)
        average = fc.recovery.NodalAverage(25**3, 6)
        parts = average._node_ranges(cells)
        assert len(parts) == count
        assert [k for low, high in parts for k in range(low, high)] == list(range(25**3))
        work = [((cells >= low) & (cells < high)).sum() for low, high in parts]
        assert max(work) < 1.3 * min(work)
        assert average._node_ranges(cells[:0]) == [(0, 25**3)]


@pytest.mark.parametrize("batch", [0, 1000, 10**9])
def test_nodal_stresses_are_the_average_whatever_is_computed_at_a_time(batch, monkeypatch):
    monkeypatch.setattr(fc.recovery, "BATCH", batch)
    model = elastic_model(fc.generate.block_on_block("quad4"), "plane_strain", E=1.0)
    mesh, (moduli, material) = model.mesh, model.material_numbers()
    u = np.random.default_rng(3).random(mesh.points.shape)
    given = (mesh, "plane_strain", moduli, material, u)
    expected = fc.recovery.nodal_average(mesh, fc.recovery.stress_at_points(*given))
    np.testing.assert_array_equal(fc.recovery.nodal_stress(*given), expected)


def test_a_degenerate_cell_is_named_by_its_lowest_number_whatever_the_threads(threads):
    mesh = fc.generate.block((1.0, 1.0), (6, 6), "quad4")
    points = mesh.points.copy()
    block = mesh.cells["quad4"]
    # Two cells inside out: whichever thread ends first, the first one is told.
    for cell in (4, 31):
        a, b = block[cell][0], block[cell][2]
        points[a], points[b] = points[b].copy(), points[a].copy()
    bad = mesh.replace(points=points)
    material = {"quad4": np.zeros(36, np.int32)}
    moduli = fc.LinearElastic(E=1.0, nu=0.3).moduli("plane_strain")[None]
    texts = []
    for count in (1, 4):
        threads(count)
        with pytest.raises(fc.MeshError, match="not positive") as caught:
            stiffness.stiffness(bad, "plane_strain", moduli, material)
        texts.append(str(caught.value))
    assert texts[0] == texts[1]


NAME = "OPENBLAS_THREAD_TIMEOUT"


@pytest.mark.parametrize(("given", "found"), [({}, "4"), ({NAME: "20"}, "20")])
def test_waiting_threads_sleep_unless_told_otherwise(given, found):
    environment = {name: value for name, value in os.environ.items() if name != NAME} | given
    asked = f"import os, fastcontact; print(os.environ['{NAME}'])"
    done = subprocess.run([sys.executable, "-c", asked], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == found
