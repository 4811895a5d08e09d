"""Runs of a study: in parallel, on Dask and MPI, killed and continued, their keys in the store."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.cli import main
from fastcontact.studies import execute, job
from fastcontact.studies.fit import fit_limit
from fastcontact.studies.report import percent
from fastcontact.studies.settings import Combination, combinations, recipe, settings


def test_no_worker_is_left_half_started(monkeypatch):
    """A signal that comes while a process starts is heard when it has."""
    begun = []

    def start(self):
        signal.raise_signal(signal.SIGTERM)
        begun.append(self)

    def heard(number, frame):
        raise KeyboardInterrupt

    monkeypatch.setattr(execute.SpawnProcess, "start", start)
    before = signal.signal(signal.SIGTERM, heard)
    try:
        with pytest.raises(KeyboardInterrupt):
            execute.RecordingContext().Process(target=print).start()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert len(begun) == 1


def deadly(job, threads):
    if job.label == "deadly":
        os.kill(os.getpid(), signal.SIGKILL)
    return {"label": job.label, "threads": threads}


@pytest.fixture
def jobs(monkeypatch):
    monkeypatch.setattr(execute, "execute_run", deadly)
    return [SimpleNamespace(label=name, size=size) for name, size in (("first", 1), ("deadly", 3), ("last", 2))]


def test_a_run_that_kills_its_worker_is_reported_and_the_others_end(jobs):
    found = dict(execute.run_on_processes(2, jobs, [0, 1, 2]))
    assert sorted(found) == [0, 1, 2]
    assert found[0] == {"label": "first", "threads": 1}
    assert found[2] == {"label": "last", "threads": 1}
    assert found[1]["kind"] == "BrokenProcessPool"
    assert found[1]["error"].startswith("its worker process was killed")


def test_what_has_not_begun_is_called_off_where_a_study_stops(jobs):
    class Slow(Executor):
        def __init__(self):
            self.futures = []

        def submit(self, function, *arguments):
            self.futures.append(Future())
            if len(self.futures) == 1:
                self.futures[0].set_exception(KeyboardInterrupt())
            return self.futures[-1]

    executor = Slow()
    with pytest.raises(KeyboardInterrupt):
        list(execute.run_on_executor(executor, jobs, [0, 1, 2]))
    assert [future.cancelled() for future in executor.futures] == [False, True, True]


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
def test_a_killed_sweep_redoes_no_finished_run(root, tmp_path):
    store, target = tmp_path / "store", tmp_path / "sweep.json"
    command = [sys.executable, "-m", "fastcontact", "sweep", str(root / "data/cases/forma04c.toml")]
    command += ["--set", "approach=0.1:4:8", "--level", "0", "--workers", "2", "--store", str(store), "-q"]
    command += ["--json", str(target)]
    first = subprocess.Popen(command, start_new_session=True)
    deadline = time.monotonic() + 120
    while len(finished(store)) < 3 and first.poll() is None and time.monotonic() < deadline:
        time.sleep(0.005)
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    kept = finished(store)
    assert len(kept) >= 3
    assert not target.exists() or len(kept) == 8
    assert main([*command[3:], "--workers", "1"]) == 0
    after = finished(store)
    assert len(after) == 8
    assert {name: after[name] for name in kept} == kept
    forces = [point["force"] for point in json.loads(target.read_text())["points"]]
    assert len(forces) == 8
    assert forces == sorted(forces)


def finished(store):
    """Whole results in a store, with the instant they were written; names with a dot are still being written."""
    return {path.name: path.stat().st_mtime_ns for path in store.glob("[!.]*.json")} if store.is_dir() else {}


@pytest.fixture(scope="module")
def chosen(root):
    return settings(read_case(root / "data/cases/forma04b.toml"))


def of(base=None, **data):
    return job.Job(label="a run", name="case", marks={}, data=data, pair="c", recipe={"refinements": 1}, base=base)


def test_the_key_tells_what_the_numbers_depend_on():
    mesh = fc.generate.half_spheres("tri3", size=20.0)
    moved = replace(mesh, points=mesh.points + 1e-12)
    keys = [of(material=1).key, of(material=2).key, of(mesh, material=1).key, of(moved, material=1).key]
    assert len(set(keys)) == 4
    assert of(mesh, material=1, title="another").key == keys[2]


def test_the_key_tells_the_contents_of_every_file_that_a_run_reads(tmp_path):
    """Fields, temperatures, obstacles, and the data file of an XDMF mesh."""
    names = ("field.vtu", "warm.vtu", "warmer.vtu", "wall.xdmf", "wall.h5")
    for name in names:
        (tmp_path / name).write_text("one", encoding="utf-8")
    item = '<Xdmf><DataItem Format="HDF">wall.h5:/points</DataItem></Xdmf>'
    (tmp_path / "wall.xdmf").write_text(item, encoding="utf-8")
    data = {
        "material": [{"E": {"file": "field.vtu", "field": "E"}}],
        "temperature": [{"file": ["warm.vtu", "warmer.vtu"]}],
        "obstacle": {"wall": {"shape": {"file": "wall.xdmf"}}},
    }
    keys = [replace(of(**data), folder=tmp_path).key]
    for name in names:
        (tmp_path / name).write_text((tmp_path / name).read_text(encoding="utf-8") + " ", encoding="utf-8")
        keys.append(replace(of(**data), folder=tmp_path).key)
    (tmp_path / "wall.h5").unlink()
    keys.append(replace(of(**data), folder=tmp_path).key)
    assert len(set(keys)) == len(keys)


def test_options_that_another_formulation_does_not_have_are_dropped(chosen):
    own = {**chosen.data["contact"]["hertz"], "integration": "simpson"}
    chosen = replace(chosen, data={**chosen.data, "contact": {"hertz": own}})
    assert own["formulation"] == "continuous"
    mortar = job.case_data(chosen, Combination("tri6", "mortar"))["contact"]["hertz"]
    assert mortar["formulation"] == "mortar"
    assert "integration" not in mortar
    assert job.case_data(chosen, Combination("tri6", None))["contact"]["hertz"] == own


@pytest.mark.parametrize(
    ("ramp", "steps", "fewer"),
    [({"steps": 20}, 2, {"steps": 2}), ({"instants": [0.1, 0.5, 2.0]}, 4, {"instants": [0.5, 1.0, 1.5, 2.0]})],
)
def test_fewer_load_steps_end_where_the_ramp_does(chosen, ramp, steps, fewer):
    changed = replace(chosen, data={**chosen.data, "ramp": ramp}, load_steps=steps)
    assert job.case_data(changed, Combination("tri6", None))["ramp"] == fewer


def test_a_run_that_goes_wrong_in_any_way_is_a_result(monkeypatch):
    def wrong(_):
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr(job.Job, "evaluate", wrong)
    found = job.execute_run(of())
    assert found["kind"] == "ZeroDivisionError"
    assert found["error"].startswith("by nothing (wrong, line ")


def test_all_stands_for_every_element_on_the_same_corners_and_every_formulation(tmp_path):
    fc.write_mesh(tmp_path / "m.med", fc.generate.half_spheres("tri3", size=20.0))
    (tmp_path / "own.toml").write_text(
        'kinematics = "axisymmetric"\n[mesh]\nfile = "m.med"\n[[material]]\nE = 20000.0\nnu = 0.3\n'
        '[contact.c]\nsecondary = "CONT1"\nprimary = "CONT2"\n'
    )
    found = combinations(settings(read_case(tmp_path / "own.toml")), ["all"], ["all"])
    assert {member.element for member in found} == {"tri3", "tri6"}
    assert {member.formulation for member in found} == {"node_to_segment", "continuous", "mortar"}
    assert len(found) == 6


def test_a_cylinder_without_sizes_starts_from_a_hundredth_of_its_radius(root):
    case = read_case(root / "data/cases/cylinder-on-block.toml")
    own = replace(settings(case), generator="cylinder-on-block", arguments={"": {"R": 2.0}})
    arguments = recipe(own, "quad4", 2)["arguments"]
    assert arguments["size"] == pytest.approx(2.0 / 10 / 4)
    assert arguments["contact_size"] == pytest.approx(2.0 / 100 / 4)


def test_a_quantity_that_does_not_change_is_its_own_limit():
    limit = fit_limit([4.0, 2.0, 1.0], [3.0, 3.0, 3.0])
    assert limit.value == 3.0
    assert 0.0 < limit.uncertainty < 1e-10
    assert np.isnan(limit.order)
    assert limit.converging


def test_a_limit_known_well_is_told_with_more_digits():
    assert percent(0.0400513, 1e-4) == "+4.005 %"
    assert percent(0.0400513, 1e-6) == "+4.0051 %"


@pytest.mark.slow
def test_a_dask_scheduler_by_its_address(case, tmp_path):
    """One value on one worker; `docs/howto/cluster.md` holds the bits of several against those of processes here."""
    distributed = pytest.importorskip("distributed", reason="needs Dask: pip install 'fastcontact[dask]'")
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        options = ["--json", str(tmp_path / "sweep.json"), "-q", "--executor", cluster.scheduler_address]
        assert main(["sweep", str(case), "--set", "approach=0.4", "--level", "0", *options]) == 0
    (point,) = json.loads((tmp_path / "sweep.json").read_text())["points"]
    (expected,) = fc.parameter_sweep(case, {"approach": [0.4]}, level=0, workers=1).points
    assert point["force"] == pytest.approx(expected.values["force"], rel=1e-13)


# More processes than processors, and perhaps as the administrator: Open MPI wants to be told.
ALLOWED = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
}


@pytest.fixture
def mpiexec():
    pytest.importorskip("mpi4py", reason="needs mpi4py: pip install 'fastcontact[mpi]'")
    places = os.pathsep.join([os.path.dirname(sys.executable), os.environ.get("PATH", "")])
    found = shutil.which("mpiexec", path=places)
    if found is None:
        pytest.skip("needs mpiexec: pip install 'fastcontact[mpi]'")
    return found


DYING = """
import os, signal, sys
from fastcontact.studies import execute

def dies(job, threads=None):
    os.kill(os.getpid(), signal.SIGKILL)

if __name__ == "__main__":
    execute.execute_run = dies
    from fastcontact.cli import main
    sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
def test_an_mpi_process_that_dies_ends_the_study(case, tmp_path, mpiexec):
    script = tmp_path / "dying.py"
    script.write_text(DYING)
    command = [mpiexec, "-n", "3", sys.executable, "-m", "mpi4py.futures", str(script), "sweep", str(case)]
    command += ["--set", "approach=1:2:10", "--level", "0", "--executor", "mpi", "--json", str(tmp_path / "x.json")]
    done = subprocess.run(command, env={**os.environ, **ALLOWED}, capture_output=True, text=True, timeout=120)
    assert done.returncode != 0
    assert "signal 9" in done.stderr
    assert not (tmp_path / "x.json").exists()


@pytest.mark.slow
def test_without_mpiexec_a_study_ends(case, tmp_path, mpiexec):
    """Some libraries of MPI can start processes by themselves; where they cannot, the study does not wait for ever."""
    command = [sys.executable, "-m", "fastcontact", "sweep", str(case), "--set", "approach=1,2", "--level", "0"]
    command += ["--executor", "mpi", "-q"]
    done = subprocess.run(command, env={**os.environ, **ALLOWED}, capture_output=True, text=True, timeout=240)
    assert done.returncode in (0, 1), done.stderr
    assert "Traceback" not in done.stderr
    assert done.returncode == 0 or "error: --executor mpi has no processes, or lost one (" in done.stderr


class LosingPool(ThreadPoolExecutor):
    """Like the pool of mpi4py when a process is lost: answers so often, then the thread that waits for answers fails."""

    answers, delay = 2, 0.0

    def submit(self, *task):
        LosingPool.answers -= 1
        if LosingPool.answers >= 0:
            return super().submit(*task)
        threading.Thread(target=self._fail).start()
        return Future()

    def _fail(self):
        time.sleep(LosingPool.delay)
        raise RuntimeError("MPI_ERR_PROC_FAILED: process\nfailure")


@pytest.mark.parametrize(("answers", "delay"), [(0, 0.0), (1, 0.0), (3, 0.0), (0, 0.5), (3, 0.5)])
def test_a_process_that_is_lost_while_the_launcher_goes_on(case, monkeypatch, capsys, answers, delay):
    """Before the study waits for an answer, and while it does."""
    monkeypatch.setattr(LosingPool, "answers", answers)
    monkeypatch.setattr(LosingPool, "delay", delay)
    futures = SimpleNamespace(MPIPoolExecutor=LosingPool)
    monkeypatch.setitem(sys.modules, "mpi4py", SimpleNamespace(futures=futures))
    monkeypatch.setitem(sys.modules, "mpi4py.futures", futures)
    hook, handler = threading.excepthook, signal.signal(signal.SIGINT, signal.default_int_handler)
    command = ["sweep", str(case), "--set", "approach=1,2,3,4", "--level", "0", "--executor", "mpi"]
    try:
        assert main(command) == 1
    finally:
        signal.signal(signal.SIGINT, handler)
    assert capsys.readouterr().err == (
        "error: --executor mpi has no processes, or lost one (MPI_ERR_PROC_FAILED: process failure): start with 'mpiexec "
        "-n N python -m mpi4py.futures -m fastcontact ...'\n"
    )
    assert threading.excepthook is hook


def test_threads_keep_the_environment_of_the_process(case, monkeypatch):
    """What is compiled meanwhile reads it: one thread there would be one for the rest of the process."""
    seen = []
    monkeypatch.setattr(
        "fastcontact.studies.execute.execute_run", lambda job, threads: seen.append(dict(os.environ)) or {"error": ""}
    )
    before = dict(os.environ)
    with ThreadPoolExecutor(1) as pool:
        assert list(execute.run_on_executor(pool, [SimpleNamespace(size=1)], [0])) == [(0, {"error": ""})]
    assert seen == [before]
