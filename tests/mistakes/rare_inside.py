"""Failures inside the library or of its environment, which must be reported: classes of errors and patterns."""
# ruff: noqa: E501 (messages stay in one piece)

import errno
import re
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import meshio
import numpy as np
from library import blocks, lifted, solved
from models import elastic_model, with_contact
from rare_files import refusing
from scipy.sparse import bsr_array, csr_array

import fastcontact as fc
from fastcontact._tools import hdf5
from fastcontact.analysis.floating_bodies import FloatingBodies
from fastcontact.cases.case import read_case
from fastcontact.cases.keys import call_with_keys
from fastcontact.cli import _study, bench, cases
from fastcontact.cli._outputs import check_outputs
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations import _cut_faces
from fastcontact.elasticity.constrained_system import System
from fastcontact.linear.elimination import pivot_order
from fastcontact.linear.multigrid import solver
from fastcontact.linear.solvers import amg
from fastcontact.linear.solvers.direct import Direct
from fastcontact.mesh.files import aster_mail, med, meshio_content
from fastcontact.mesh.generate import _triangulate
from fastcontact.mesh.generate.transform import renamed
from fastcontact.results import reader
from fastcontact.studies import execute
from fastcontact.studies import report as render
from fastcontact.studies import settings as levels
from fastcontact.studies.settings import Combination, recipe, settings

REPEATED = re.escape(str(pivot_order.DependenceError()))


def pair_of(size):
    first, second = size
    return float(first), float(second)


def without_cells(folder):
    (folder / "a.mail").write_text("TITRE\nFINSF\nCOOR_2D\n N1 0 0\nFINSF\nFIN\n")
    fc.read_mesh(folder / "a.mail")


def arrays_apart():
    mesh = meshio.Mesh(np.eye(3), [("triangle", [[0, 1, 2]])])
    mesh.cell_data = {"gmsh:physical": []}
    fc.from_meshio(mesh)


def out_of_balance(patch):
    patch.setattr(System, "balance", lambda self, forces, round_off=None: (forces, 1e9))
    solved(blocks())


def not_slack(patch):
    settle = FloatingBodies.settle
    patch.setattr(FloatingBodies, "settle", lambda *given: replace(settle(*given), slack=False))
    model = lifted()
    model.loads.clear()
    model.add_force("UPPER_TOP", y=-10.0)
    solved(model, criteria=fc.Criteria(max_halvings=0))


def no_checkout(patch, folder):
    patch.setattr(bench, "__file__", str(folder / "package" / "cli" / "bench.py"))
    bench.suite("subjects")


def no_matplotlib_for_outputs(patch):
    patch.setitem(sys.modules, "matplotlib.backend_bases", None)
    check_outputs("case.toml", [], ["a.png"])


def no_matplotlib_for_studies(patch):
    patch.setitem(sys.modules, "matplotlib.backends.backend_agg", None)
    render.panels((1, 1), (4.0, 3.0), "")


def no_scheduler(patch):
    modules = SimpleNamespace(Client=refusing(errno.ECONNREFUSED))
    patch.setitem(sys.modules, "dask", SimpleNamespace(distributed=modules))
    patch.setitem(sys.modules, "dask.distributed", modules)
    with _study.executor("tcp://localhost:1"):
        pass


def drawn_on_a_full_disk(patch):
    patch.setattr(Path, "mkdir", refusing(errno.ENOSPC))
    bench.suite("command").draw("pictures", {"a": [{"n_dofs": 1}, {"n_dofs": 2}]})


def copied_to_a_full_disk(patch, folder):
    case = folder / "a.toml"
    case.write_text("title = 'a'\n")
    patch.setattr(Path, "write_bytes", refusing(errno.ENOSPC))
    cases.copy_case(case, folder / "b.toml")


def distorted_facets(patch):
    patch.setattr(_cut_faces._cut_faces_kernels, "integrate", lambda *given: given[-1].fill(True))
    lower, upper = fc.generate.box(divisions=(2, 2, 2)), fc.generate.box(divisions=(2, 2, 2), origin=(0.0, 0.0, 1.0))
    mesh = fc.generate.union(renamed(lower, lambda name: f"A_{name}"), renamed(upper, lambda name: f"B_{name}"))
    model = with_contact(elastic_model(mesh, "3d", E=1.0, nu=0.3), "pair", "B_ZMIN", "A_ZMAX", formulation="mortar")
    model.bind(model.contact[0]).constraints(Configuration.undeformed(mesh.points))


def stuck(patch):
    patch.setattr(solver, "MAX_ITERATIONS", 0)
    patch.setattr(amg, "MAX_FACTORISED_DOFS", {2: 0})
    solved(blocks(), linear_solver="amg")


def indefinite():
    K = bsr_array(np.array([[1.0, 2.0], [2.0, 1.0]]), blocksize=(1, 1))
    Direct(tolerance=1e-10)._factorise(K, np.array([1]))


def no_triangulation(patch):
    patch.setattr(_triangulate, "_attempt", lambda *_: None)
    fc.generate.half_spheres(size=21.0)  # of no other test: the suite makes each mesh once


def no_finer_meshes(patch):
    patch.delitem(levels.RULES, "rings")  # a maker that is new
    chosen = settings(read_case("forma04a"))
    recipe(replace(chosen, generator="rings", arguments={"quadrangles": {}}), "quad4", 1)


def not_makeable():
    chosen = settings(read_case("forma04a"))
    recipe(replace(chosen, generator=None, arguments={}, case_combination=Combination("quad4", None)), "tri3", 1)


def failing(jobs, rows, *_):
    return [(row, {"error": "the mesh is folded", "kind": "MeshError"}) for row in rows]


def no_level(patch):
    patch.setattr(execute, "_results_of", failing)
    fc.convergence_study("forma04a", 1, ["tri3"], ["node_to_segment"])


def no_point(patch):
    patch.setattr(execute, "_results_of", failing)
    fc.parameter_sweep("forma04a", {"approach": [1.0]})


def packed_beyond_its_size(folder, patch):
    with h5py.File(folder / "a.h5", "w") as file:
        file.create_dataset("a", data=np.random.default_rng(1).random(2000), chunks=(10,), compression="gzip")
    patch.setattr(hdf5, "PLAUSIBLE_BYTES", -(10**6))
    with hdf5.open_hdf5(folder / "a.h5"):
        pass


def name_too_long(folder):
    fc.ResultWriter(folder / ("a" * 300 + ".vtkhdf"), fc.generate.box())


def profile_beyond_the_mesh(folder):
    with h5py.File(folder / "a.h5", "w") as file:
        file["PROFILS/P/PFL"] = np.array([1, 9])
        file["NOE/P/CO"] = np.array([0.5, 1.5])
        med._read_instant(file, file["NOE"], 4, 1)


def parts_that_do_not_fit(folder, patch):
    fc.write_mesh(folder / "a.vtk", fc.generate.box())

    def fail(*_):
        raise TypeError("of another kind")

    patch.setattr(meshio_content, "build_mesh", fail)
    fc.read_mesh(folder / "a.vtk")


def unreadable(folder, patch):
    (folder / "a.vtkhdf").touch()
    patch.setattr(reader.os, "access", lambda *_, **__: False)
    fc.open_results(folder / "a.vtkhdf")


def repeated_equations(patch):
    patch.setattr(pivot_order, "LARGEST_DENSE", 0)
    pivot_order.matched_pivots(csr_array(np.array([[1.0, 0.0], [2.0, 0.0]])))


CALLS = [
    ("values of points beyond the mesh", profile_beyond_the_mesh, fc.errors.FileError, r"profile 'P' refers to point 9 of 4: write the file again"),
    ("parts of a file that do not fit", parts_that_do_not_fit, fc.errors.FileError, r"the parts of '.*a\.vtk' are inconsistent: check the file, or convert it to \.med"),
    ("a result that may not be read", unreadable, fc.errors.FileError, r"a\.vtkhdf' is not readable: ask its owner for read permission"),
    ("equations on the same unknown", repeated_equations, pivot_order.DependenceError, REPEATED),
    ("equations that are equal", lambda: pivot_order.block_inverse(csr_array(np.ones((2, 2)))), pivot_order.DependenceError, REPEATED),
    ("more equations than unknowns", lambda: pivot_order.matched_pivots(csr_array(np.ones((2, 1)))), pivot_order.DependenceError, REPEATED),
    ("equations that are nearly equal", lambda: pivot_order.block_inverse(csr_array([[1.0, 1.0], [1.0, 1.0 + 1e-14]])), pivot_order.DependenceError, REPEATED),
    ("forces out of balance", out_of_balance, fc.ConvergenceError, r"step 1: the out-of-balance force 1e\+09 stays above .* \(1e-06 of the largest force\): round-off prevents a smaller one if moduli or displacements differ by many orders of magnitude\. Replace a stiff body by a rigid obstacle"),
    ("springs that stay stretched", not_slack, fc.ConvergenceError, r"contact does not hold .*: after \d+ trial positions, a force of .* is still missing for equilibrium under a load of 10\. Add a support \(step 1 from 0 to 1; more load steps may help\)$"),
    ("benchmarks without checkout", no_checkout, fc.errors.FastcontactError, r"the benchmarks need the source checkout, and there is no '.*': install it with pip install -e"),
    ("outputs without matplotlib", no_matplotlib_for_outputs, fc.errors.FastcontactError, r"pictures need matplotlib: pip install 'fastcontact\[plot\]'"),
    ("pictures of studies without matplotlib", no_matplotlib_for_studies, fc.errors.FastcontactError, r"pictures need matplotlib: pip install 'fastcontact\[plot\]'"),
    ("no scheduler at the address", no_scheduler, fc.errors.CaseError, r"no Dask scheduler answers at --executor tcp://localhost:1: .*Connection refused"),
    ("pictures of benchmarks on a full disk", drawn_on_a_full_disk, fc.errors.FileError, r"cannot write the picture of 'a' in 'pictures': .*No space left on device"),
    ("a case copied to a full disk", copied_to_a_full_disk, fc.errors.FileError, r"b\.toml' cannot be written \(No space left on device\)"),
    ("facets that cannot be cut", distorted_facets, fc.ContactError, r"the facets near \[.*\] and \[.*\] are too distorted to be cut: improve the mesh there"),
    ("multigrid without iterations", stuck, fc.ConvergenceError, r"conjugate gradients stall at .* after 0 iterations.* linear_solver=.direct.*exceed the limit of 0"),
    ("a stiffness that is not positive definite", indefinite, fc.ModelError, r"the stiffness matrix is not positive definite: check the material and the cells"),
    ("no triangulation is found", no_triangulation, fc.MeshError, r"no triangulation with edges up to .* at the pole and .* far from it was found: change a size slightly, or let it grow"),
    ("triangles that leave a hole", lambda: _triangulate._check_count(np.zeros((3, 3), int), 10, 8), fc.MeshError, r"the triangulation has 3 triangles, but 10 are needed to fill the outline"),
    ("a maker of no known finer meshes", no_finer_meshes, fc.errors.CaseError, r"it is not known how the generator 'rings' makes finer meshes: name its arguments in \[study\] as halve = \[\.\.\.\] or double = \[\.\.\.\]"),
    ("an element on other corners", not_makeable, fc.errors.CaseError, r"meshes of tri3 cannot be made from the case's quad4: give a generator"),
    ("a study without a level", no_level, fc.MeshError, r"no level could be solved; .*: the mesh is folded"),
    ("a sweep without a point", no_point, fc.MeshError, r"no point of the sweep could be solved; .*: the mesh is folded"),
    ("packed data larger than unpacked", packed_beyond_its_size, fc.errors.FileError, r"is larger compressed than uncompressed: the file is damaged; write it again"),
    ("a file name beyond all limits", name_too_long, fc.errors.FileError, r"cannot be written \(File name too long\): name another file"),
    ("a table that a function cannot take", lambda: call_with_keys("mesh", pair_of, {"size": 3}), fc.errors.CaseError, r"'mesh': size = 3 are invalid \(cannot unpack"),
    ("a table with a text for numbers", lambda: call_with_keys("mesh", pair_of, {"size": "ab"}), fc.errors.CaseError, r"'mesh': size = 'ab' are invalid \(could not convert"),
    ("a size that is no number", lambda: fc.generate.quarter_disc(size="x"), fc.MeshError, r"^the argument size of quarter_disc must be a number or None, not the string 'x'$"),
    ("one size for two", lambda: fc.generate.block(1.0), fc.MeshError, r"^the argument size of block must be two numbers, not the float 1\.0$"),
    ("arrays of meshio that do not fit together", arrays_apart, fc.MeshError, r"the arrays of meshio's mesh do not fit together: list index out of range"),
    ("a .mail file without cells", without_cells, fc.MeshError, r"a\.mail': the mesh has no cells: nothing can be computed on points alone"),
    ("a .mail file that is gone", lambda: aster_mail.read(Path("gone.mail")), fc.errors.FileError, r"cannot read 'gone\.mail': .*No such file"),
    ("a picture of no steps", lambda: fc.plot.history([], "pair"), fc.FastcontactError, r"there are no steps to draw"),
    ("a picture of another contact", lambda: fc.plot.history(solved(blocks()), "pear"), fc.FastcontactError, r"unknown contact pair 'pear'.*did you mean 'pair'"),
]  # fmt: skip
