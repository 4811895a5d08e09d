"""Run a deck with CalculiX, if it is installed, and read the displacements and forces of all nodes."""

import os
import re
import shutil
import subprocess

import numpy as np
import pytest

from fastcontact.cases.decks.element_types import element_type
from fastcontact.mesh import elements

CCX = shutil.which("ccx")
needs_calculix = pytest.mark.skipif(
    CCX is None, reason="CalculiX (ccx, in Debian the package calculix-ccx) is not installed"
)
PRINTED = {"displacements": "U", "forces": "RF", "temperatures": "NT"}
END_OF_STEP = re.compile(r"^\*end\s*step.*$", re.IGNORECASE | re.MULTILINE)
FIRST_STEP = re.compile(r"^\*step\b.*$", re.IGNORECASE | re.MULTILINE)


def solved(path, folder, numbers, limit=120.0, asked="U, RF"):
    """Run a copy of the deck `path` in `folder` with prints of the nodes `numbers` added to every step.

    Returns by pseudo-time the displacements and the forces of nodes, or what is `asked` for:
    ``{time: {"U": {node: (3,)}, "RF": ...}}``. Forces are internal ones: what loads put on the same nodes is in them.
    """
    text = path.read_text(encoding="utf-8")
    listed = "\n".join(",".join(map(str, numbers[k : k + 12])) for k in range(0, len(numbers), 12))
    text = FIRST_STEP.sub(lambda found: f"*NSET, NSET=COMPARED\n{listed}\n{found[0]}", text, count=1)
    text = END_OF_STEP.sub(lambda found: f"*NODE PRINT, NSET=COMPARED\n{asked}\n{found[0]}", text)
    for beside in path.parent.glob("*.inc"):
        shutil.copy(beside, folder)
    return printed(run(text, folder, limit))


def run(text, folder, limit):
    """Run a deck in `folder`; return what CalculiX prints for the user."""
    (folder / "run.inp").write_text(text, encoding="utf-8")
    command, environment = [CCX, "run"], {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=limit)
    assert "Job finished" in done.stdout, done.stdout[-2000:]
    return (folder / "run.dat").read_text(encoding="utf-8")


def frequencies(folder):
    """Return the frequencies (n,) that the last step of the deck which `solved` has run in `folder` prints, per time."""
    table = (folder / "run.dat").read_text(encoding="utf-8").split("E I G E N V A L U E   O U T P U T")[1]
    rows = re.findall(r"^ +\d+ +\S+ +\S+ +(\S+) +\S+ *$", table.split("P A R T")[0], re.MULTILINE)
    return np.array(rows, float)


def printed(text):
    """Return what `solved` does from the text of a ``.dat`` file."""
    found, table = {}, None
    for line in text.splitlines():
        head = re.match(r"\s*(displacements|forces|temperatures)( \(.*\))? for set COMPARED and time\s+(\S+)", line)
        if head:
            table = found.setdefault(float(head[3]), {}).setdefault(PRINTED[head[1]], {})
        elif table is not None and re.match(r"\s*\d+(\s+\S+){1,3}\s*$", line):
            node, *values = line.split()
            table[int(node)] = np.array(values, float)
        elif line.strip():
            table = None
    return found


TYPES = {"hex8": "C3D8", "hex20": "C3D20", "tet4": "C3D4", "tet10": "C3D10", "quad4": "CPE4", "quad8": "CPE8"}


def deck_of(mesh, bodies, sets=(), surfaces=(), types=TYPES):
    """Return the head of a deck: nodes, elements of `bodies`, node sets and element surfaces of groups of the mesh."""
    lines = ["*NODE", *(f"{n}, " + ", ".join(f"{x:.12g}" for x in point) for n, point in enumerate(mesh.points, 1))]
    cells = {}
    for body in bodies:
        for name, rows in mesh.split(mesh.cell_groups[body]).items():
            lines.append(f"*ELEMENT, TYPE={types[name]}, ELSET={body}")
            faces = [list(elements.get(name).facets[facet]) for facet in element_type(types[name]).faces]
            for row in rows:
                number = len(cells) + 1
                cells[number] = (faces, mesh.cells[name][row])
                entries = [str(number), *(str(n + 1) for n in mesh.cells[name][row])]
                lines += wrapped(entries)
    for name in sets:
        lines += [f"*NSET, NSET={name}", *wrapped([str(n + 1) for n in mesh.points_of(name)], last=True)]
    for name in surfaces:
        on = set(mesh.points_of(name).tolist())
        lines.append(f"*SURFACE, NAME=S_{name}, TYPE=ELEMENT")
        for number, (faces, nodes) in cells.items():
            lines += [f"{number}, S{k}" for k, face in enumerate(faces, 1) if on.issuperset(nodes[face].tolist())]
    return "\n".join(lines) + "\n"


def wrapped(entries, last=False):
    """Return entries as data lines of ten; all but the last line end with a comma, unless each stands for itself."""
    parts = [", ".join(entries[k : k + 10]) for k in range(0, len(entries), 10)]
    return parts if last else [part + "," for part in parts[:-1]] + parts[-1:]
