"""Waiting threads of other libraries sleep, unless the user selects otherwise."""

import os
import subprocess
import sys

import pytest

ASKED = "import os, fastcontact; print(os.environ['OMP_WAIT_POLICY'], os.environ['OPENBLAS_THREAD_TIMEOUT'])"
NAMES = ("OMP_WAIT_POLICY", "OPENBLAS_THREAD_TIMEOUT")


@pytest.mark.parametrize(
    ("given", "found"), [({}, "passive 4"), (dict(zip(NAMES, ("active", "20"), strict=True)), "active 20")]
)
def test_waiting_threads_sleep_unless_told_otherwise(given, found):
    environment = {name: value for name, value in os.environ.items() if name not in NAMES} | given
    done = subprocess.run([sys.executable, "-c", ASKED], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == found
