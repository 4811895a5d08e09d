"""Whole processes with cached kernels, in units of ``import numpy``: imports and the training case."""

import subprocess
import sys
import tempfile
from pathlib import Path

SIZES = (1,)
CASE = Path(__file__).resolve().parents[2] / "data" / "cases" / "forma04a.toml"


def works(size):
    def process(*arguments):
        subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)

    def case():
        with tempfile.TemporaryDirectory() as folder:
            process("-m", "fastcontact", "run", str(CASE), "-q", "-o", f"{folder}/result.vtkhdf")

    return size, {
        "import fastcontact": lambda: process("-c", "import fastcontact"),
        "run forma04a": case,
        "import numba": lambda: process("-c", "import numba"),
        "import numpy": lambda: process("-c", "import numpy"),
    }
