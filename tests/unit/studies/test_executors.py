"""Sweeps on Dask and MPI: addresses, and lost processes; `docs/howto/cluster.md` compares the numbers of all executors."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from types import SimpleNamespace

import pytest

from fastcontact.cli import main
from fastcontact.studies import execute
from fastcontact.studies.sweep import parameter_sweep


@pytest.fixture(scope="module")
def case(root):
    return root / "data/cases/forma04c.toml"


@pytest.mark.slow
def test_a_dask_scheduler_by_its_address(case, tmp_path):
    """One value on one worker; `docs/howto/cluster.md` holds the bits of several against those of processes here."""
    distributed = pytest.importorskip("distributed", reason="needs Dask: pip install 'fastcontact[dask]'")
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        options = ["--json", str(tmp_path / "sweep.json"), "-q", "--executor", cluster.scheduler_address]
        assert main(["sweep", str(case), "--set", "approach=0.4", "--level", "0", *options]) == 0
    (point,) = json.loads((tmp_path / "sweep.json").read_text())["points"]
    (expected,) = parameter_sweep(case, {"approach": [0.4]}, level=0, workers=1).points
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
    execute.run = dies
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
        "fastcontact.studies.execute.run", lambda job, threads: seen.append(dict(os.environ)) or {"error": ""}
    )
    before = dict(os.environ)
    with ThreadPoolExecutor(1) as pool:
        assert list(execute.on_executor(pool, [SimpleNamespace(size=1)], [0])) == [(0, {"error": ""})]
    assert seen == [before]
