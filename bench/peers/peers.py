"""The programs that solve the problems: where they are searched, how they are started, and with how many threads."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent


@dataclass(frozen=True)
class Peer:
    """A program.

    Parameters
    ----------
    name, label : str
        By which it is asked for, and what the table calls it.
    script : str
        Takes PROBLEM.npz, the number of steps and ANSWER.json, by an interpreter that knows `module`.
    problems : tuple of str
        What it solves.
    module : str
        An interpreter that imports it will do.
    interpreters : tuple of str
        Where to look, in this order.
    program : str, optional
        An executable that the script starts and that must be there.
    install : str
        How a user gets it.
    options : tuple of str
        Further arguments of the script.
    parallel : bool
        Whether a second thread does any work; the others get one thread, which costs them least.
    """

    name: str
    label: str
    script: str
    problems: tuple[str, ...]
    module: str
    interpreters: tuple[str, ...]
    install: str
    program: str | None = None
    options: tuple[str, ...] = ()
    parallel: bool = False

    def interpreter(self, asked: str | None = None) -> str | None:
        """Return the first interpreter that has what the script needs, or None: the peer is absent."""
        if self.program is not None and shutil.which(self.program) is None:
            return None
        candidates: Sequence[str] = self.interpreters if asked is None else (asked,)
        return next((path for path in candidates if shutil.which(path) and self._imports(path)), None)

    def _imports(self, path: str) -> bool:
        command = [path, "-c", f"import importlib.util as u; raise SystemExit(not u.find_spec({self.module!r}))"]
        return subprocess.run(command, capture_output=True, cwd=HERE.parent).returncode == 0

    def command(self, interpreter: str, problem: Path, steps: int, answer: Path) -> list[str]:
        """Return the whole process that is measured."""
        return [interpreter, str(HERE / self.script), str(problem), str(steps), str(answer), *self.options]


SYSTEM, OWN = "/usr/bin/python3", sys.executable
PEERS = (
    Peer("fastcontact", "fastcontact", "fastcontact_api.py", ("forma04", "half", "octant"), "fastcontact", (OWN,),
         "pip install -e .", parallel=True),
    Peer("again", "the same again", "fastcontact_api.py", ("forma04", "half", "octant"), "fastcontact", (OWN,),
         "pip install -e .", options=("again",), parallel=True),
    Peer("multigrid", "with multigrid", "fastcontact_api.py", ("half",), "fastcontact", (OWN,), "pip install -e .",
         options=("amg",), parallel=True),
    Peer("getfem", "GetFEM", "getfem_bricks.py", ("forma04",), "getfem", (SYSTEM, OWN), "apt-get install python3-getfem"),
    Peer("getfem-deformed", "GetFEM, deformed", "getfem_bricks.py", ("forma04",), "getfem", (SYSTEM, OWN),
         "apt-get install python3-getfem", options=("deformed",)),
    Peer("calculix", "CalculiX", "calculix_deck.py", ("forma04",), "numpy", (OWN,), "apt-get install calculix-ccx",
         program="ccx"),
    Peer("kratos", "Kratos", "kratos_mortar.py", ("forma04",), "KratosMultiphysics.ContactStructuralMechanicsApplication",
         (OWN, SYSTEM), "pip install KratosContactStructuralMechanicsApplication"),
    Peer("dolfinx", "dolfinx", "dolfinx_active_set.py", ("half", "octant"), "dolfinx", (SYSTEM, OWN),
         "apt-get install python3-dolfinx"),
)  # fmt: skip
