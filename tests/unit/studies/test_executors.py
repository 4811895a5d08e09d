"""The same sweep in processes of this machine, on a Dask cluster of two workers and under mpiexec: identical numbers."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from fastcontact.cli import main
from fastcontact.studies.sweep import parameter_sweep

APPROACHES = (0.4, 1.0, 4.0)


@pytest.fixture(scope="module")
def case(root):
    return root / "data/cases/forma04c.toml"


@pytest.fixture(scope="module")
def here(case):
    # In processes of their own, with one BLAS thread each as on a cluster: more of them sum in another order.
    return parameter_sweep(case, {"approach": APPROACHES}, level=0, workers=2)


def numbers(points):
    return [(point.n_dofs, point.values, point.profile) for point in points]


def test_two_dask_workers(case, here):
    distributed = pytest.importorskip("distributed", reason="needs Dask: pip install 'fastcontact[dask]'")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        found = parameter_sweep(case, {"approach": APPROACHES}, level=0, executor=client.get_executor())
    assert numbers(found.points) == numbers(here.points)


def test_a_dask_scheduler_by_its_address(case, here, tmp_path):
    distributed = pytest.importorskip("distributed", reason="needs Dask: pip install 'fastcontact[dask]'")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        values = "approach=" + ",".join(map(str, APPROACHES))
        options = [
            "--level",
            "0",
            "--json",
            str(tmp_path / "sweep.json"),
            "-q",
            "--executor",
            cluster.scheduler_address,
        ]
        assert main(["sweep", str(case), "--set", values, *options]) == 0
    points = json.loads((tmp_path / "sweep.json").read_text())["points"]
    assert [point["force"] for point in points] == [point.values["force"] for point in here.points]


def test_three_mpi_processes(case, here, tmp_path):
    pytest.importorskip("mpi4py", reason="needs mpi4py: pip install 'fastcontact[mpi]'")
    places = os.pathsep.join([os.path.dirname(sys.executable), os.environ.get("PATH", "")])
    mpiexec = shutil.which("mpiexec", path=places)
    if mpiexec is None:
        pytest.skip("needs mpiexec: pip install 'fastcontact[mpi]'")
    target = tmp_path / "sweep.json"
    values = "approach=" + ",".join(map(str, APPROACHES))
    command = [mpiexec, "-n", "3", sys.executable, "-m", "mpi4py.futures", "-m", "fastcontact", "sweep", str(case)]
    command += ["--set", values, "--level", "0", "--executor", "mpi", "--json", str(target), "-q"]
    # More processes than processors, and perhaps as the administrator: Open MPI wants to be told.
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    allowed |= {"PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe"}
    done = subprocess.run(command, env={**os.environ, **allowed}, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    points = json.loads(target.read_text())["points"]
    assert [point["force"] for point in points] == [point.values["force"] for point in here.points]
    assert [point["n_dofs"] for point in points] == [point.n_dofs for point in here.points]
