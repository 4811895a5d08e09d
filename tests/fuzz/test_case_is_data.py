"""Case files are data: no text in them is evaluated, expanded, imported or run."""

import itertools
import os
import sys
import tomllib

import fuzz_toml
import pytest

import fastcontact as fc
from fastcontact._tools.toml_text import dump
from fastcontact.cases.case import read_case

# Texts that mean something to Python, to a shell, to templates, to YAML, to a path.
CODE = [
    "__import__('os').mkdir('ran')",
    "{0.__class__.__mro__}",
    "{{ 7 * 7 }}",
    "%(name)s",
    "${HOME}/ran",
    "~/ran",
    "$(touch ran)",
    "`touch ran`",
    "; touch ran",
    "!!python/object/apply:os.mkdir ['ran']",
    "lambda x: x",
    "os.mkdir",
    "file:///etc/hostname",
]
WATCHED = (
    "exec", "compile", "import", "os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "os.mkdir", "os.remove",
    "os.rename", "socket.connect", "urllib.Request", "ctypes.dlopen", "pickle.find_class", "os.putenv",
)  # fmt: skip


class Heard:
    """What the interpreter did while it is on."""

    def __init__(self):
        self.on, self.events = False, []
        sys.addaudithook(self._hear)

    def _hear(self, event, arguments):
        writes = event == "open" and isinstance(arguments[1], str) and set(arguments[1]) & set("wax+")
        if self.on and (event in WATCHED or writes):
            self.events.append((event, str(arguments)[:200]))


CASE = """
title = "tiny"
kinematics = "axisymmetric"
units = { length = "mm", force = "N", pressure = "MPa" }
mesh = { generator = "half-spheres", element = "quad4", arc_sizes = [9.0, 15.0], radial_sizes = [9.0, 15.0], segments = 2 }
material = [{ groups = ["SPHHAU", "SPHBAS"], E = 20000.0, nu = 0.3 }]
support = [{ group = "A1A2", x = 0.0 }, { group = "A2B2", y = -1.0, ramp = [[0, 0], [1, 1]] }, { group = "A1B1", y = 1 }]
couple = [{ group = "A2B2", component = "y" }]
contact = { hertz = { secondary = "CONT1", primary = "CONT2", formulation = "continuous", friction = 0.1 } }
ramp = { steps = 1 }
solve = { linear_solver = "direct" }
probes = { C1 = "C1" }
theory = { hertz = { kind = "hertz_point", E1 = 2e4, nu1 = 0.3, R1 = 50.0, E2 = 2e4, nu2 = 0.3, R2 = 50.0, approach = 2.0 } }
check = [{ name = "one", quantity = "C1.stress.yy", theory = "hertz", tolerance = 0.05 }]
study = { parameters = { size = { "mesh.size" = "1.5*value^0.5" } }, quantities = ["C1.stress.yy"] }
"""


def text_of(data):
    return dump(data)


def changed(texts):
    """Yield the case with one of the texts, in turns, in the place of each value and of each key; and that text."""
    turns = itertools.cycle(texts)
    for number in range(len(list(fuzz_toml._places(tomllib.loads(CASE))))):
        for as_key in (False, True):
            data, code = tomllib.loads(CASE), next(turns)
            holder, name = list(fuzz_toml._places(data))[number]
            if as_key and isinstance(holder, dict):
                holder[code] = holder.pop(name)
            else:
                holder[name] = code
            yield data, code


def read(path, data):
    path.write_text(text_of(data), encoding="utf-8")
    try:
        return read_case(path)
    except fc.FastcontactError:
        return None


@pytest.fixture(scope="module")
def heard(tmp_path_factory):
    found = Heard()
    for data, _ in changed(["plain"]):  # what reading needs is imported and compiled now
        read(tmp_path_factory.getbasetemp() / "plain.toml", data)
    return found


@pytest.mark.parametrize(
    "first", [pytest.param(k, marks=() if k == 9 else pytest.mark.slow) for k in range(0, len(CODE), 3)]
)
def test_no_text_at_any_place_is_more_than_a_text(tmp_path, monkeypatch, heard, first):
    monkeypatch.chdir(tmp_path)
    path, taken = tmp_path / "changed.toml", 0
    for data, code in changed(CODE[first:] + CODE[:first]):
        path.write_text(text_of(data), encoding="utf-8")
        heard.events, heard.on = [], True
        try:
            found = read_case(path)
        except fc.FastcontactError:
            found = None
        finally:
            heard.on = False
        assert heard.events == [], code
        if found is not None:
            taken += 1
            assert found.title == data.get("title", "changed")
    assert taken > 5  # titles, units and names of pairs may be anything
    assert os.listdir(tmp_path) == ["changed.toml"]


def test_the_hook_hears_what_it_shall(heard):
    heard.events, heard.on = [], True
    eval("1 + 1")
    heard.on = False
    assert {event for event, _ in heard.events} >= {"compile", "exec"}


@pytest.mark.parametrize("place", ["/dev/zero", "/dev/stdin", ".", "/etc/hostname", "../..", "missing.med", "", "a\0b"])
@pytest.mark.parametrize("key", ["mesh", "obstacle"])
def test_a_mesh_file_that_is_none_is_refused(tmp_path, place, key):
    data = tomllib.loads(CASE)
    if key == "mesh":
        data["mesh"] = {"file": place}
    else:
        data["obstacle"] = {"table": {"secondary": "CONT1", "shape": {"kind": "mesh", "file": place, "group": "CONT2"}}}
    path = tmp_path / "place.toml"
    path.write_text(text_of(data), encoding="utf-8")
    with pytest.raises(fc.FastcontactError):
        read_case(path)


def test_no_module_of_the_package_evaluates_text(root):
    """Neither eval nor exec nor pickle stands in the package, and yaml is not read.

    Compiled kernels alone are pickled, as Numba does it, in a folder that others cannot write.
    """
    import ast

    for path in {*(root / "fastcontact").rglob("*.py")} - {root / "fastcontact" / "_jit" / "cache.py"}:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in ("eval", "exec", "compile", "__import__"), path
            names = [alias.name for alias in node.names] if isinstance(node, (ast.Import, ast.ImportFrom)) else []
            module = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not {"pickle", "marshal", "shelve", "yaml", "dill"} & {n.split(".")[0] for n in (*names, *module)}, (
                path
            )


def test_the_name_of_a_pair_does_not_become_a_path(tmp_path):
    """Pairs, probes and titles are named by the case; what is written has the names given on the command line only."""
    from fastcontact import cli

    data, name = tomllib.loads(CASE), "../../ran"
    for table in ("contact", "theory"):
        data[table] = {name: data[table]["hertz"]}
    data["probes"] = {name: "C1"}
    data["title"] = name
    del data["check"], data["couple"], data["study"]
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    (inner / "case.toml").write_text(text_of(data), encoding="utf-8")
    output, summary = inner / "out.vtkhdf", inner / "out.json"
    assert cli.main(["run", str(inner / "case.toml"), "-o", str(output), "--json", str(summary), "-q"]) == 0
    with fc.open_results(output) as results:
        assert results[-1].contact[name].force.any()
    assert {path.name for path in tmp_path.rglob("*") if path.is_file()} == {"case.toml", "out.vtkhdf", "out.json"}
