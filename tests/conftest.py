"""Shared fixtures: locations of validation cases, and small models."""

import atexit
import functools
import gc
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import settings
from models import pressed_spheres
from pairwise import mark_the_rest

import fastcontact as fc
from fastcontact._jit import ahead, cache, decorators, interpreting
from fastcontact.linear import choice as linear

ROOT = Path(__file__).resolve().parent.parent
SHARED = ROOT.parent / "shared"
# The kernel that takes longest to compile, which the table of usual kernels does not contain.
NONLINEAR = """
import fastcontact as fc
from fastcontact.elasticity.nonlinear_bodies import NonlinearBodies

model = fc.Model(fc.generate.block(), "plane_strain", strain="finite")
model.add_material(fc.NeoHookean(E=1.0, nu=0.3))
bodies = NonlinearBodies(model.mesh, "plane_strain", "finite", model.material_field())
bodies.at(0.0 * model.mesh.points, bodies.initial_history)
"""

# The same examples in every run, so that no change fails by chance; `--hypothesis-profile=long` looks further.
settings.register_profile("fixed", max_examples=12, derandomize=True, deadline=None)
settings.register_profile("long", max_examples=2000, deadline=None)
settings.load_profile("fixed")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let other folders of code_aster's cases be tried."""
    parser.addoption("--linear-solver", help="what the choice 'auto' stands for in this run: direct, cholmod, amg, ...")
    parser.addoption(
        "--cases", type=Path, action="append", help="another folder of validation specs (JSON) with meshes (MED)"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Hear Ctrl-C, also where the tests run in background; under another linear solver results come whichever way."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput"):
        prepare_workers(whole=config.args_source is pytest.Config.ArgsSource.TESTPATHS)
    ahead.MAX_HELPERS = 0  # processes that compile ahead of a run would do so for each worker
    interpreting.MAX_SECONDS = -1.0  # what is tested are compiled kernels
    if config.getoption("--linear-solver"):
        config.addinivalue_line("filterwarnings", "ignore:multigrid gave up")


def prepare_workers(whole: bool) -> None:
    """Give each worker one processor; where all tests run on an empty cache, compile kernels that all workers need."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    folder = cache.cache_folder()
    if whole and folder and decorators.jit_enabled() and not any(folder.glob("*.nbc")):
        nonlinear = subprocess.Popen([sys.executable, "-c", NONLINEAR], cwd=ROOT)
        atexit.register(nonlinear.kill)
        for process in (*ahead.start((), decorators.threads()), nonlinear):
            process.wait()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """See `pairwise`; before marks are chosen from. Also mark the tests in ``long_tests.txt``."""
    mark_the_rest(items)
    long_tests = set((ROOT / "tests/long_tests.txt").read_text().splitlines())
    for item in items:
        if item.nodeid in long_tests:
            item.add_marker("long")


@pytest.fixture(autouse=True)
def signals():
    """Give signals back to Python after each test; gmsh takes them, and a broken pipe would then end the tests."""
    yield
    for number in (signal.SIGINT, *([signal.SIGPIPE] if hasattr(signal, "SIGPIPE") else [])):
        signal.signal(number, signal.getsignal(number))


@pytest.fixture(scope="session", autouse=True)
def linear_solver(request: pytest.FixtureRequest):
    """The linear solver that ``--linear-solver`` names, in place of the automatic choice; iterative ones to round-off.

    Every test that leaves the choice open must pass with every solver.
    """
    name = request.config.getoption("--linear-solver")
    if name is None:
        yield
        return
    make = linear.make

    def given(asked: str, **options):
        if asked == "auto":
            options["tolerance"] = min(options.get("tolerance", 1e-10), 1e-13)
        return make(name if asked == "auto" else asked, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(linear, "make", given)
        yield


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Look for garbage when all tests are collected, not while they are, and not among what they consist of."""
    make_meshes_once()
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def make_meshes_once() -> None:
    """Make each mesh of a costly generator once for all tests of a process: meshes do not change."""

    def once(make):
        made = functools.lru_cache(maxsize=None, typed=True)(make)

        @functools.wraps(make)
        def find(*arguments, **options):
            try:
                return made(*arguments, **options)
            except TypeError:  # lists and arrays are not kept; what is wrong is told anew
                return make(*arguments, **options)

        return find

    for name in ("half_spheres", "sphere_on_block", "cylinder_on_block", "rings", "quarter_disc", "graded_block"):
        make = once(getattr(fc.generate, name))
        setattr(fc.generate, name, make)
        fc.generate.GENERATORS[name.replace("_", "-")] = make  # case files and commands look there


@pytest.fixture
def meshio_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let meshio read in this process; starting one of its own for each file is tested in `test_hostile_files`."""
    from fastcontact.mesh.files import meshio_files, meshio_process

    monkeypatch.setattr(meshio_files, "read_in_process", meshio_process.plain_content)


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout."""
    return ROOT


@pytest.fixture(scope="session")
def cases() -> Path:
    """The folder of validation meshes beside the checkout."""
    folder = SHARED / "cases"
    if not folder.is_dir():
        pytest.skip(f"the validation meshes are not there: {folder}")
    return folder


@pytest.fixture(scope="session")
def code_aster(cases: Path) -> Path:
    """The folder of code_aster's fields beside the checkout."""
    folder = SHARED / "reference" / "code_aster"
    if not folder.is_dir():
        pytest.skip(f"code_aster's fields are not there: {folder}")
    return folder


@pytest.fixture(scope="session")
def forma04():
    """A function that sets up the training case on a mesh."""

    def make(mesh: fc.Mesh, formulation: str = "node_to_segment", *, contact: bool = True, **options) -> fc.Model:
        return pressed_spheres(mesh, name="hertz" if contact else None, formulation=formulation, **options)

    return make


@pytest.fixture(scope="session")
def solved_case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the training case of two steps, `case.toml`, its mesh `coarse.med`, and its results `old.vtkhdf`.

    It is for all tests of a process: work on copies.
    """
    from fastcontact.cli import main

    folder = tmp_path_factory.mktemp("solved")
    case = folder / "case.toml"
    mesh = ["mesh", "half-spheres", "--element", "tri3", "--size", "6", "-o", str(folder / "coarse.med"), "-q"]
    assert main(mesh) == 0
    assert main(["cases", "--copy", "forma04a", "-o", str(case), "-q"]) == 0
    (folder / "forma04a.med").unlink()
    text = case.read_text(encoding="utf-8").replace("forma04a.med", "coarse.med")
    case.write_text(text.replace("steps = 20", "steps = 2"), encoding="utf-8")
    assert main(["run", str(case), "-o", str(folder / "old.vtkhdf"), "-q"]) == 0
    return folder


@pytest.fixture
def small_disk(tmp_path: Path):
    """A folder with room for a megabyte."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if os.name != "posix" or os.geteuid() != 0 or shutil.which("mount") is None:
        pytest.skip("only root may mount a small file system")
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(folder)], capture_output=True)
    if mounted.returncode:
        pytest.skip(f"no small file system here: {mounted.stderr.decode().strip()}")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.fixture
def gmsh():
    """The module, initialised."""
    try:
        import gmsh
    except (ImportError, OSError) as error:  # it is installed, but a library of the system that it needs is not
        pytest.skip(f"gmsh cannot be imported: {error}")
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh
    gmsh.finalize()
