"""Start Python in another mode: environment variables for threads, cache folder, compilation."""

import ctypes
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE = 24, 1


def start(
    script: str, *arguments: str, before: Callable[[], None] | None = None, **environment: str | None
) -> subprocess.Popen[str]:
    """Start a script of this folder; an environment variable that is None is taken away."""
    merged = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    return subprocess.Popen(
        [sys.executable, str(HERE / script), *arguments],
        env={name: value for name, value in merged.items() if value is not None},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=before,
    )


def finished(process: subprocess.Popen[str], seconds: float = 300.0) -> tuple[str, str]:
    """Return what a process that must end well wrote to its output and to its error stream."""
    try:
        output, errors = process.communicate(timeout=seconds)
    finally:
        process.kill()
    assert process.returncode == 0, errors
    return output, errors


def obeying_permissions() -> None:
    """Let this process be refused what the permissions of a file forbid, also where it runs as root."""
    ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0)
