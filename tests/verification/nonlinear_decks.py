"""Decks of nonlinear bodies, and what CalculiX 2.20 finds for them, kept in ``data/reference/calculix_nonlinear.json``.

``PYTHONPATH=.:tests python tests/verification/nonlinear_decks.py`` runs CalculiX (``ccx``) on all and writes the file.
"""

import json
import re
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from calculix import TYPES, deck_of, run
from models import united

import fastcontact as fc
from fastcontact.mesh import elements

FILE = Path(__file__).parents[2] / "data/reference/calculix_nonlinear.json"
ELEMENTS = {
    "C3D8": "hex8", "C3D10": "tet10", "C3D15": "wedge15", "C3D20": "hex20", "CPE8": "quad8", "CPS8": "quad8", "CAX8": "quad8",
}  # fmt: skip
LAWS = {
    "isotropic": "*ELASTIC\n200., .3\n*PLASTIC\n1., 0.\n1.5, .05\n2., .5\n3., 2.\n",
    # Nearly rigid elastically: CalculiX yields by the Cauchy stress, fastcontact by the Kirchhoff stress, J times it.
    "stiff": "*ELASTIC\n20000., .3\n*PLASTIC\n1., 0.\n11., 1.\n",
    "kinematic": "*ELASTIC\n2000., .3\n*PLASTIC, HARDENING=KINEMATIC\n1., 0.\n101., 1.\n",
    "perfect": "*ELASTIC\n200., .3\n*PLASTIC\n1., 0.\n",
    "neo-Hookean": "*HYPERELASTIC, NEO HOOKE\n.5, .2\n",
    "Mooney-Rivlin": "*HYPERELASTIC, MOONEY-RIVLIN\n.3, .2, .2\n",
    "Yeoh": "*HYPERELASTIC, YEOH\n.5, -.02, .01, .2, 0., 0.\n",
    "Ogden": "*HYPERELASTIC, OGDEN, N=2\n.6, 2.5, .3, -1.5, .2, 0.\n",
    "Saint Venant-Kirchhoff": "*ELASTIC\n3., .3\n",
}


@dataclass(frozen=True)
class Case:
    """A deck: its text, the nodes and cells that are compared, and the sets whose forces are."""

    text: str
    looked: list[int]
    cells: list[int]
    sets: tuple[str, ...]


def spread(mesh: fc.Mesh, most: int = 10) -> list[int]:
    """Return nodes from all over a mesh."""
    return sorted(set(np.linspace(0, mesh.n_points - 1, most).round().astype(int).tolist()))


def deck(mesh, kind, laws, rest, bodies=("BLOCK",), sets=(), surfaces=(), steps=(), nlgeom=True, cells=(0,)) -> Case:
    """Return the deck of a mesh, with a law for each body; steps are keywords and the number of increments."""
    # Thin, so that CalculiX's solid cells are nearly in plane stress.
    thickness = "0.02," if kind == "CPS8" else "1.,"
    types = {**TYPES, ELEMENTS[kind]: kind, **({"wedge15": kind} if kind == "C3D15" else {})}
    text = deck_of(mesh, bodies, sets, surfaces, types)
    for body, law in zip(bodies, laws, strict=True):
        text += f"*MATERIAL, NAME=M_{body}\n{LAWS[law]}*SOLID SECTION, ELSET={body}, MATERIAL=M_{body}\n{thickness}\n"
    looked = spread(mesh)
    text += "*NSET, NSET=LOOKED\n" + "".join(f"{node + 1}\n" for node in looked)
    text += "*ELSET, ELSET=CELLS\n" + "".join(f"{cell + 1}\n" for cell in cells) + rest
    asked = "*NODE PRINT, NSET=LOOKED, FREQUENCY=1000\nU\n*EL PRINT, ELSET=CELLS, FREQUENCY=1000\nS\n"
    asked += "".join(f"*NODE PRINT, NSET={name}, TOTALS=ONLY, FREQUENCY=1000\nRF\n" for name in sets[:2])
    for step, count in steps:
        flag = ", NLGEOM" if nlgeom else ""
        text += f"*STEP{flag}, INC=1000\n*STATIC, DIRECT\n{1.0 / count:.12g}, 1.\n{step}{asked}*END STEP\n"
    return Case(text, looked, list(cells), tuple(sets[:2]))


def block(kind: str, law: str, moves, nlgeom=True, count: int = 10) -> Case:
    """Return a block whose bottom is held, and whose top moves sideways and up."""
    solid = kind.startswith("C3D")
    if solid:
        mesh = fc.generate.box((1.0, 1.0, 1.0), (2, 2, 2), element=ELEMENTS[kind], name="BLOCK")
        low, high, up = "ZMIN", "ZMAX", 3
    else:
        mesh = fc.generate.block((2.0, 1.0), (4, 2), ELEMENTS[kind], origin=(float(kind[:3] == "CAX"), 0.0))
        low, high, up = "BOTTOM", "TOP", 2
    held = f"*BOUNDARY\n{low}, 1, {up}\n" + (f"{high}, 2\n" if solid else "")
    steps = [(f"*BOUNDARY\n{high}, 1, 1, {x}\n{high}, {up}, {up}, {y}\n", count) for x, y in moves]
    return deck(mesh, kind, [law], held, sets=(high, low), steps=steps, nlgeom=nlgeom)


def strip(kind: str, law: str, load: str) -> Case:
    """Return a slender strip that a force or a pressure bends by large rotations."""
    if kind.startswith("C3D"):
        mesh, side, face = (
            fc.generate.box((10.0, 1.0, 0.2), (20, 1, 1), element=ELEMENTS[kind], name="BLOCK"),
            "XMIN",
            "ZMAX",
        )
        end, up = "XMAX", 3
    else:
        mesh, side, face, end, up = fc.generate.block((10.0, 0.2), (20, 1), ELEMENTS[kind]), "LEFT", "TOP", "RIGHT", 2
    share = -2e-4 / len(mesh.points_of(end))
    loads = {"force": f"*CLOAD\n{end}, {up}, {share:.8g}\n", "pressure": f"*DSLOAD\nS_{face}, P, 2.E-5\n"}
    held = f"*BOUNDARY\n{side}, 1, {up}\n"
    return deck(mesh, kind, [law], held, sets=(side, end), surfaces=(face,), steps=[(loads[load], 10)], cells=(2,))


def tube(law: str, pressures, nlgeom: bool) -> Case:
    """Return the wall of a tube in plane strain under pressure inside."""
    mesh = fc.generate.block((1.0, 0.2), (8, 1), "quad8", origin=(1.0, 0.0))
    held = "*BOUNDARY\nBOTTOM, 2\nTOP, 2\n"
    steps = [(f"*DSLOAD\nS_LEFT, P, {pressure}\n", 10) for pressure in pressures]
    return deck(mesh, "CAX8", [law], held, sets=("TOP", "BOTTOM"), surfaces=("LEFT",), steps=steps, nlgeom=nlgeom)


def pressed(kind: str, laws, depth: float, n: int = 1, nlgeom=True, count: int = 10) -> Case:
    """Return a narrow round block, or ring, pressed on a wide one of another mesh; `n` divides the cells.

    The ring is off the axis: CalculiX 2.20 has no contact elements on facets that touch the axis, and these penetrate.
    """
    low = fc.generate.block((2.0, 1.0), (8 * n, 4 * n), ELEMENTS[kind], name="BLOCK")
    high = fc.generate.block((1.2, 0.6), (6 * n, 3 * n), ELEMENTS[kind], origin=(0.4, 1.0), name="BLOCK")
    round_end = high.points.copy()
    round_end[:, 1] += ((round_end[:, 0] - 1.0) / 2.0) ** 2 * (1.6 - round_end[:, 1]) / 0.6
    mesh = united(L_=low, U_=high.replace(points=round_end))
    rest = "*SURFACE INTERACTION, NAME=I\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n1.E4\n"
    rest += "*CONTACT PAIR, INTERACTION=I, TYPE=SURFACE TO SURFACE\nS_U_BOTTOM, S_L_TOP\n*BOUNDARY\nL_BOTTOM, 1, 2\n"
    steps = [(f"*BOUNDARY\nU_TOP, 1, 1, 0.\nU_TOP, 2, 2, {-depth}\n", count)]
    sets, surfaces = ("U_TOP", "L_BOTTOM"), ("L_TOP", "U_BOTTOM")
    return deck(mesh, kind, laws, rest, ("L_BLOCK", "U_BLOCK"), sets, surfaces, steps, nlgeom, cells=(27,))


SMALL = [(0.01, 0.02), (-0.01, 0.0)]
# Small: kinematic hardening has small strains here. Without NLGEOM, CalculiX 2.20 yields at less than the yield stress.
CYCLE = [(0.001, 0.002), (-0.001, -0.002), (0.001, 0.002)]
FINITE = [(0.2, 0.3), (0.1, -0.2)]
# In one step, of 20 increments: in both programs, errors of plastic flow are proportional to their size.
ONE_WAY = [(0.1, 0.15)]
CASES = {
    **{f"isotropic, {kind}": (block, kind, "isotropic", SMALL, False) for kind in ("C3D8", "C3D10", "C3D20", "CPE8", "CAX8")},
    **{f"kinematic, {kind}": (block, kind, "kinematic", CYCLE) for kind in ("C3D20", "CPE8", "CAX8")},
    **{f"isotropic at finite strains, {kind}": (block, kind, "stiff", ONE_WAY, True, 20)
       for kind in ("C3D20", "CPE8", "CAX8")},
    **{f"neo-Hookean, {kind}": (block, kind, "neo-Hookean", FINITE)
       for kind in ("C3D8", "C3D10", "C3D15", "C3D20", "CPE8", "CPS8", "CAX8")},
    **{f"{law}, {kind}": (block, kind, law, FINITE)
       for law in ("Mooney-Rivlin", "Yeoh", "Ogden") for kind in ("C3D20", "CPE8", "CPS8", "CAX8")},
    **{f"Saint Venant-Kirchhoff, {kind}": (block, kind, "Saint Venant-Kirchhoff", [(0.1, 0.05)])
       for kind in ("C3D20", "CPE8", "CPS8", "CAX8")},
    **{f"strip bent by a {load}, {kind}": (strip, kind, "Saint Venant-Kirchhoff", load)
       for load in ("force", "pressure") for kind in ("C3D20", "CPE8")},
    "tube that yields": (tube, "perfect", (0.6, 0.7, 0.0), False),
    "rubber tube": (tube, "neo-Hookean", (0.3,), True),
    "rubber on rubber, CPE8": (pressed, "CPE8", ("neo-Hookean", "Ogden"), 0.2),
    "rubber on rubber, CAX8": (pressed, "CAX8", ("Mooney-Rivlin", "Yeoh"), 0.2),
    # On fine meshes: plastic flow keeps what the edge of the contact does while it moves across the facets.
    **{f"steel on steel, {kind}": (pressed, kind, ("isotropic", "isotropic"), 0.05, 4, False, 20)
       for kind in ("CPE8", "CAX8")},
}  # fmt: skip


def case(name: str) -> Case:
    """Return a deck by its name."""
    make, *arguments = CASES[name]
    return make(*arguments)


def gauss_order(kind: str) -> np.ndarray:
    """Return the integration points of ours in the order of CalculiX, of a layer of plane cells."""
    ours = elements.get(ELEMENTS[kind]).quadrature[0]
    line = np.polynomial.legendre.leggauss(round(len(ours) ** (1.0 / ours.shape[1])))[0]
    theirs = np.stack(np.meshgrid(*[line] * ours.shape[1], indexing="ij"), axis=-1).reshape(-1, ours.shape[1])[:, ::-1]
    near = np.linalg.norm(theirs[:, None] - ours[None], axis=2)
    assert near.min(axis=1).max() < 1e-9
    return near.argmin(axis=1)


def has_points(kind: str) -> bool:
    """Return whether integration points of an element are a tensor product of lines in both programs."""
    return kind not in ("C3D10", "C3D15")


def read_dat(text: str, kind: str) -> list[dict]:
    """Return of each step the displacements, the forces of sets and the stresses at points that a .dat file has."""
    steps: dict[float, dict] = {}
    table: list = []
    for line in text.splitlines():
        head = re.match(r"\s*(displacements|stresses|total force).*for set (\w+) and time\s+(\S+)", line)
        numbers = re.fullmatch(r"\s*([-+.\dE\s]+)", line) if line.strip() else None
        if head:
            step = steps.setdefault(round(float(head[3]), 6), {"displacements": [], "stresses": [], "forces": []})
            table = step["forces" if head[1] == "total force" else head[1]]
        elif numbers:
            table.append([float(x) for x in numbers[1].split()])
    dim = 3 if kind.startswith("C3D") else 2
    found = []
    for time, step in sorted(steps.items()):
        assert time == round(time)
        stress = np.array([row[2:] for row in step["stresses"]])[:, [0, 1, 2, 3, 5, 4]]
        if dim == 2:
            stress = stress[9:18, :4]
        found.append(
            {
                "displacement": [row[1 : 1 + dim] for row in step["displacements"]],
                # Of a wedge of two degrees only the force along the axis is that of the ring.
                "force": [[180.0 * row[1]] if kind == "CAX8" else row[:dim] for row in step["forces"]],
                "stress": stress[::4].tolist() if has_points(kind) else [],
            }
        )
    return found


def kind_of(name: str) -> str:
    """Return the element type of a case."""
    return next((part for part in CASES[name][1:] if part in ELEMENTS), "CAX8")


def by_calculix(name: str) -> list[dict]:
    """Return what CalculiX finds."""
    given = case(name)
    with tempfile.TemporaryDirectory() as folder:
        # CalculiX replaces further compressibility constants that are zero by its own.
        text = given.text.replace("0., 0.\n*SOLID", "1.E12, 1.E12\n*SOLID").replace(
            "-1.5, .2, 0.\n", "-1.5, .2, 1.E12\n"
        )
        return read_dat(run(text, Path(folder), 1200), kind_of(name))


def here(name: str) -> list[dict]:
    """Return what fastcontact finds for the same deck."""
    from fastcontact.elasticity.nonlinear_bodies import NonlinearBodies

    given, kind = case(name), kind_of(name)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "deck.inp"
        path.write_text(given.text, encoding="utf-8")
        read = fc.read_deck(path)
    model, found = read.model, []
    # The same discretisation: CalculiX does not project the dilatation.
    model.materials[:] = [
        (replace(law, volumetric="plain") if isinstance(law, fc.ElasticPlastic) else law, group)
        for law, group in model.materials
    ]
    bodies = NonlinearBodies(model.mesh, model.kinematics, model.strain, model.material_field())
    for step in read.solve_steps():  # which keep the history
        if step.load_factor != round(step.load_factor):
            continue
        element, along = ELEMENTS[kind], slice(1, 2) if kind == "CAX8" else slice(None)
        history = step.restart["history"] if step.restart and step.restart.get("history") else bodies.initial_history
        stress = bodies.at(step.displacement, history, tangent=False).stress[element]
        order = gauss_order(kind)[::4] if has_points(kind) else []
        found.append(
            {
                "displacement": step.displacement[given.looked],
                "force": np.array(
                    [step.reaction[model.mesh.points_of(name)].sum(axis=0)[along] for name in given.sets]
                ),
                "stress": stress[given.cells[0]][order] if has_points(kind) else np.zeros((0, 4)),
            }
        )
    return found


if __name__ == "__main__":
    FILE.write_text(json.dumps({name: by_calculix(name) for name in CASES}), encoding="utf-8")
