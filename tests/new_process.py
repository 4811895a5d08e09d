"""Python code that runs in a process of its own."""

import os
import subprocess
import sys


def printed(code, *arguments, folder=None, given=None, timeout=None, **environment):
    """Return what code prints in a new process within `timeout` seconds.

    Its environment has further variables, and its standard input is `given`.
    """
    how = {"env": os.environ | {name: str(value) for name, value in environment.items()}, "cwd": folder, "input": given}
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=timeout, **how).stdout
