"""Python code that runs in a process of its own."""

import os
import subprocess
import sys


def printed(code, *arguments, folder=None, given=None, **environment):
    """Return what code prints in a new process, with further variables in its environment and `given` on standard input."""
    command, variables = (
        [sys.executable, "-c", code, *arguments],
        os.environ | {k: str(v) for k, v in environment.items()},
    )
    done = subprocess.run(command, input=given, capture_output=True, text=True, check=True, env=variables, cwd=folder)
    return done.stdout
