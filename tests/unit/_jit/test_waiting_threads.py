"""Waiting threads of other libraries sleep, unless the user selects otherwise."""

import os
import subprocess
import sys

import pytest

NAME = "OPENBLAS_THREAD_TIMEOUT"


@pytest.mark.parametrize(("given", "found"), [({}, "4"), ({NAME: "20"}, "20")])
def test_waiting_threads_sleep_unless_told_otherwise(given, found):
    environment = {name: value for name, value in os.environ.items() if name != NAME} | given
    asked = f"import os, fastcontact; print(os.environ['{NAME}'])"
    done = subprocess.run([sys.executable, "-c", asked], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == found
