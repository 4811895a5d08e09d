"""Rare mistakes in case files and studies: changes of the FORMA04 A case, commands, and calls."""
# ruff: noqa: E501 (messages stay in one piece)

import errno
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np

import fastcontact as fc
from fastcontact.cases.case import build_case, read_case
from fastcontact.cases.checks import Check, check_target
from fastcontact.cli import _study
from fastcontact.cli._main import parser
from fastcontact.cli._outputs import write_text
from fastcontact.studies import execute, fit
from fastcontact.studies.case_parameters import law_value
from fastcontact.studies.settings import combinations, make_mesh, settings

CASES = [
    ("mesh is a word", '[mesh]\nfile = "forma04a.med"', 'mesh = "forma04a.med"', r"of 'mesh' must be of type dict|'mesh' must be a table"),
    ("probes are a table of tables", 'C1 = "C1"', "C1 = {a = 1}", r"case\.toml"),
    ("entry of supports is a word", '[[support]]\ngroup = "A1A2"\nx = 0.0', 'support = ["A1A2"]\n', r"case\.toml"),
    ("theory without kind", 'kind = "hertz_point"\n', "", r"'theory\.hertz' needs the key 'kind', one of "),
    ("radius in words", "R1 = 50.0", 'R1 = "fifty"', r"'theory\.hertz': R1 is 'fifty': it must be a finite number"),
    ("motion of an obstacle is a number", "[probes]", '[obstacle.ball]\nsecondary = "CONT1"\nmotion = 3.0\nshape = { kind = "sphere", centre = [0.0, 0.0], R = 1.0 }\n[probes]', r"'obstacle\.ball\.motion' must be a table of numbers by name, not the float 3\.0"),
    ("radius of an obstacle is a list", "[probes]", '[obstacle.ball]\nsecondary = "CONT1"\nshape = { kind = "sphere", centre = [0.0, 0.0], R = [1.0] }\n[probes]', r"the value of 'obstacle\.ball\.shape\.R' must be a number, not the tuple \(1\.0,\)"),
    ("target of a check is zero", 'theory = "hertz"\ntolerance', 'theory = "hertz"\nof = "beyond"\ntolerance', r"unknown number of the theory in check\[0\]\.of 'beyond'"),
    ("unknown pair of a study", "[study]", '[study]\ncontact = "herz"', r"unknown contact pair in study\.contact 'herz': did you mean 'hertz'\?"),
    ("unknown formulation in options of a study", "[study.options.node_to_segment]", "[study.options.node_to_segmnt]", r"unknown formulation in study\.options 'node_to_segmnt': did you mean 'node_to_segment'\?"),
    ("meshes of a study without maker", 'generator = "half-spheres"', "", r"study\.\w+ needs 'study\.generator', the generator to which it applies"),
    ("combination of one word", '"tri3 node_to_segment"', '"tri3"', r"an entry of study\.combinations must name an element and a formulation, not 'tri3'"),
    ("combination with an unknown formulation", '"tri3 node_to_segment"', '"tri3 node_to_segmnt"', r"unknown contact formulation 'node_to_segmnt': did you mean 'node_to_segment'\?"),
    ("unknown maker of a study", 'generator = "half-spheres"', 'generator = "half-sphere"', r"unknown study\.generator 'half-sphere': did you mean 'half-spheres'"),
    ("unknown argument of a maker", "[study.triangles]", "[study.triangles]\nsiz = 3.0", r"unknown key 'study\.triangles\.siz': did you mean 'study\.triangles\.size'"),
    ("curve without radius", "[study]", '[study]\ncurves = [{ group = "CONT1", centre = [0.0, 50.0] }]', r"study\.curves\[0\] must be \{ group = 'NAME', centre = \[x, y\], radius = R \}"),
    ("element that the study has no sizes for", '"tri3 node_to_segment"', '"hex8 node_to_segment"', r"there are no meshes of hex8 in this study: give the arguments of level 0 in \[study\.triangles\]"),
]  # fmt: skip

COMMANDS = [
    ("nothing to export", ["export", "run.vtkhdf"], r"nothing to export: give --med FILE or --xdmf FILE"),
    ("two elements for adaptive meshes", ["converge", "case.toml", "--adaptive", "--elements", "tri3,quad4"], r"adaptive refinement takes one element, not 2: tri3,quad4"),
    ("unknown place to run", ["converge", "case.toml", "--executor", "grid"], r"--executor 'grid' must be processes, mpi, or the address of a Dask scheduler"),
    ("no worker", ["converge", "case.toml", "--levels", "1", "--workers", "0"], r"workers = 0 is not allowed: the number of processes must be at least 1"),
]  # fmt: skip


def solid_case():
    case = read_case("forma04a")
    object.__setattr__(case, "mesh", fc.generate.box())
    return case


def changed_settings(**study):
    case = read_case("forma04a")
    data = {"mesh": {"generator": "half-spheres"}, "study": study}
    return settings(case, data)


def without(patch, package, module, name):
    import sys

    for missing in (package, f"{package}.{module}"):
        patch.setitem(sys.modules, missing, None)
    with _study.executor(name):
        pass


def no_worker_starts(patch):
    from concurrent.futures.process import BrokenProcessPool

    class Pool:
        def __init__(self, *_, **__):
            pass

        def submit(self, *_):
            raise BrokenProcessPool

        def shutdown(self, **_):
            pass

        end = shutdown

    patch.setattr(execute, "Workers", Pool)
    with execute.process_pool(1):
        pass


def protected_text(patch):
    def refuse(*_, **__):
        raise OSError(errno.EROFS, "Read-only file system")

    patch.setattr(Path, "write_text", refuse)
    write_text("a.json", "{}")


def file_for_a_store(patch):
    def refuse(*_, **__):
        raise OSError(errno.EEXIST, "File exists")

    patch.setattr(Path, "mkdir", refuse)
    execute.Store("runs")


def case_of(**parts):
    return build_case({"mesh": {"generator": "half-spheres"}, "kinematics": "axisymmetric", **parts}, name="case")


def unknown_quantity():
    fc.convergence_study("forma04a", 1, ["tri3"], ["node_to_segment"], quantities=["forse"], workers=1)


def interrupted(patch, command):
    def stop(*_, **__):
        raise KeyboardInterrupt

    patch.setattr(f"fastcontact.studies.runs.{command}", stop)
    name = {"convergence_study": ["converge"], "parameter_sweep": ["sweep", "--set", "approach=1"]}[command]
    options = parser(name[0]).parse_args([name[0], "forma04a", *name[1:]])
    options.run(options)


CALLS = [
    ("materials that are no tables", lambda: case_of(material=[1]), fc.errors.CaseError, r"'material' must be a list of tables: write \[\[material\]\] above each"),
    ("a contact without name", lambda: case_of(material=[{"E": 1.0, "nu": 0.3}], contact={"secondary": "CONT1"}), fc.errors.CaseError, r"'contact' needs a name for each pair: write \[contact\.NAME\] above its keys instead of 'secondary'"),
    ("a check of what is zero", lambda: check_target("check[0]", Check("a", "b.force", 0.1, "hertz", of="zero"), SimpleNamespace(zero=0.0)), fc.errors.CaseError, r"check\[0\]: the theory's zero is 0, so the relative deviation is undefined"),
    ("an unknown quantity of a study", unknown_quantity, fc.errors.CaseError, r"unknown quantity 'forse': did you mean 'force'"),
    ("a study that is interrupted", lambda patch: interrupted(patch, "convergence_study"), fc.errors.FastcontactError, r"stopped; with --store DIR the same command would continue where it stopped"),
    ("a sweep that is interrupted", lambda patch: interrupted(patch, "parameter_sweep"), fc.errors.FastcontactError, r"stopped; with --store DIR the same command would continue where it stopped"),
    ("formulations without contact", lambda: combinations(replace(settings(read_case("forma04a")), pair=None), None, ["mortar"]), fc.errors.CaseError, r"this case has no contact pair, so there are no formulations to compare"),
    ("a law beyond all numbers", lambda: law_value("value^400", 1e300, "study.parameters.a"), fc.errors.CaseError, r"study\.parameters\.a = 'value\^400' is too large a number for 1e\+300"),
    ("adaptive meshes in space", lambda: fc.adaptive_study(solid_case(), tolerance=0.1), fc.errors.CaseError, r"adaptive refinement is for triangles and quadrangles in two dimensions; this case is in 3D"),
    ("sizes without values", lambda: fit.fit_limit([1.0, 0.5], [1.0]), fc.errors.CaseError, r"mesh sizes and values must be lists of equal length, not \(2,\) and \(1,\)"),
    ("a limit of two meshes", lambda: fit.fit_limit([1.0, 0.5], [1.0, 2.0]), fc.errors.CaseError, r"a limit needs the values of at least 3 meshes, not 2: compute more levels"),
    ("one size twice", lambda: fit.fit_limit([1.0, 0.5, 0.5], [1.0, 2.0, 3.0]), fc.errors.CaseError, r"the mesh sizes must be positive and all different, not \[1\.0, 0\.5, 0\.5\]"),
    ("refining nothing", lambda: make_mesh({"refinements": 1, "element": None, "curves": None}, None), fc.errors.FastcontactError, r"the refinement of a mesh needs the initial mesh"),
    ("a maker without sizes", lambda: changed_settings(generator="block"), fc.errors.CaseError, r"'study\.generator' needs the arguments of level 0 in \[study\.triangles\] or \[study\.quadrangles\]"),
    ("Dask is not installed", lambda patch: without(patch, "dask", "distributed", "tcp://localhost:1"), fc.errors.CaseError, r"--executor tcp://localhost:1 needs Dask .*: pip install distributed"),
    ("mpi4py is not installed", lambda patch: without(patch, "mpi4py", "futures", "mpi"), fc.errors.CaseError, r"--executor mpi needs mpi4py .*: pip install mpi4py"),
    ("no worker starts", no_worker_starts, fc.errors.FastcontactError, r"no worker process could start: in a script, put the call of the study under if __name__ == '__main__':"),
    ("a text on a read-only disk", protected_text, fc.errors.FileError, r"'a\.json' cannot be written \(Read-only file system\)"),
    ("a file where the store should be", file_for_a_store, fc.errors.FileError, r"the folder 'runs' cannot be created: File exists; choose another folder"),
    ("refining solids in space", lambda: fc.generate.refined(fc.generate.box()), fc.MeshError, r"cells of hex8 cannot be refined: only lines, triangles and quadrangles are divided here"),
    ("a curve elsewhere", lambda: fc.generate.refined(fc.generate.block((1.0, 1.0), (2, 2)), curves=[fc.generate.Circle((50.0, 50.0), 1.0)]), fc.MeshError, r"no outer facet has all its nodes on .*: check its centre and radius"),
    ("a negative tolerance of merging", lambda: fc.generate.merge_points(fc.generate.half_spheres(size=20.0), -1.0), fc.MeshError, r"tolerance = -1 is out of range: it must be at least 0"),
    ("a tolerance that is no number", lambda: fc.generate.merge_points(fc.generate.half_spheres(size=20.0), np.nan), fc.MeshError, r"tolerance must be a finite number, not nan"),
]  # fmt: skip
