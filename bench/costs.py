"""CPU time of operations that must be fast for all inputs: `python bench/costs.py`; exit code 1 if a limit is exceeded.

The first operation is the reading of hostile case files and decks, for which a naive search takes quadratic time. The second
is the check of a mesh, whose time is divided by that of the assembly of its stiffness (2.5 for hexahedra in an earlier
version).
"""

import contextlib
import sys
import tempfile
from pathlib import Path
from time import process_time

import numpy as np

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.elasticity.stiffness import stiffness
from fastcontact.mesh.quality import check_cells

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests/unit/mesh/files"))
from hostile_texts import DECKS, TEXTS

MAX_SECONDS, MAX_ASSEMBLIES = 2.0, 0.6


def cost(function, times=5):
    """Return the shortest CPU time [s] of several calls, after a first call that compiles."""
    seconds = []
    for _ in range(1 + times):
        start = process_time()
        with contextlib.suppress(fc.CaseError):
            function()
        seconds.append(process_time() - start)
    return min(seconds[1:])


def main():
    """Print a line for each operation and return the exit code."""
    costs = {}
    with tempfile.TemporaryDirectory() as folder:
        for texts, suffix, read in ((TEXTS, "toml", read_case), (DECKS, "inp", fc.read_deck)):
            for name, text in texts.items():
                path = Path(folder, f"a.{suffix}")
                path.write_text(text, encoding="utf-8")
                costs[f"{suffix}: {name}"] = cost(lambda path=path, read=read: read(path), 1), MAX_SECONDS
    mesh = fc.generate.box((1.0, 1.0, 1.0), (18, 18, 18), "hex8")
    moduli = fc.LinearElastic(E=1.0, nu=0.3).moduli("3d")[None]
    material = {"hex8": np.zeros(len(mesh.cells["hex8"]), np.int32)}
    assembly = cost(lambda: stiffness(mesh, "3d", moduli, material))
    costs["check of a mesh over its assembly"] = cost(lambda: check_cells(mesh)) / assembly, MAX_ASSEMBLIES
    for name, (value, limit) in costs.items():
        print(f"{value:8.3f} of {limit:g}  {name}")
    return int(any(value > limit for value, limit in costs.values()))


if __name__ == "__main__":
    sys.exit(main())
