"""CalculiX: ``python3 calculix_deck.py PROBLEM.npz STEPS ANSWER.json`` writes a deck, runs ``ccx`` and reads its results.

Problem ``forma04``: CAX4, which CalculiX expands to hexahedra; surface-to-surface penalty contact, its only contact that
completes here: node-to-surface diverges, and mortar refuses the nodes of expanded elements. The stress on the axis is wrong,
but the next nodes along the arc and the force are correct.
"""

import json
import os
import subprocess
import sys

import numpy as np

PENALTY = 2500.0  # pressure by overclosure, in E / R; a tenth of it loses 0.6 % of the force


def table(file, numbers, rows, form):
    """Write rows of numbers, each after its own number."""
    np.savetxt(file, np.column_stack([numbers, rows]), fmt=["%d", *[form] * rows.shape[1]], delimiter=",")


def node_set(file, name, members):
    file.write(f"*NSET,NSET={name}\n")
    np.savetxt(file, members + 1, fmt="%d,")


def contact_surface(file, name, cells, facets):
    """Write an element surface: cell and number of its side for every facet."""
    sides = np.stack([cells, np.roll(cells, -1, axis=1)], axis=2)
    keys = {tuple(sorted(side)): (cell + 1, local + 1) for cell, local, side in near(sides, facets)}
    file.write(f"*SURFACE,NAME={name},TYPE=ELEMENT\n")
    for facet in facets:
        cell, local = keys[tuple(sorted(facet.tolist()))]
        file.write(f"{cell},S{local}\n")


def near(sides, facets):
    """Return cell, local number and nodes of the sides both whose nodes belong to the facets."""
    cells, locals_ = np.nonzero(np.isin(sides, facets).all(axis=2))
    return zip(cells.tolist(), locals_.tolist(), sides[cells, locals_].tolist(), strict=True)


def deck(given, steps, path):
    E, R, push = float(given["E"]), float(given["R"]), 0.5 * float(given["approach"])
    with open(path, "w") as file:
        file.write("*NODE,NSET=ALL\n")
        table(file, np.arange(1, len(given["points"]) + 1), given["points"], "%.16g")
        file.write("*ELEMENT,TYPE=CAX4,ELSET=SOLID\n")
        table(file, np.arange(1, len(given["cells"]) + 1), given["cells"] + 1, "%d")
        for name, key in (("AXIS", "A1A2"), ("BASE", "A1B1"), ("TOP", "A2B2")):
            node_set(file, name, given[f"nodes_{key}"])
        node_set(file, "POLE", np.array([int(given["POLE"])]))
        contact_surface(file, "LOWER", given["cells"], given["facets_CONT1"])
        contact_surface(file, "UPPER", given["cells"], given["facets_CONT2"])
        file.write(
            f"*MATERIAL,NAME=M\n*ELASTIC\n{E},{float(given['nu'])}\n*SOLID SECTION,ELSET=SOLID,MATERIAL=M\n"
            f"*SURFACE INTERACTION,NAME=I\n*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR\n{PENALTY * E / R}\n"
            "*CONTACT PAIR,INTERACTION=I,TYPE=SURFACE TO SURFACE\nLOWER,UPPER\n"
            f"*STEP,INC={steps}\n*STATIC,DIRECT\n{1 / steps},1.0\n"
            f"*BOUNDARY\nAXIS,1,1,0.0\nBASE,2,2,{push}\nTOP,2,2,{-push}\n"
            f"*NODE PRINT,NSET=BASE,TOTALS=ONLY,FREQUENCY={steps}\nRF\n"
            f"*EL FILE,NSET=POLE,FREQUENCY={steps}\nS\n*END STEP\n"
        )


def results(job, given):
    """Return the last total force and the stress yy at the pole."""
    with open(f"{job}.dat") as file:
        totals = [line.split() for line in file if line.strip()]
    force = float(totals[-1][1])
    stress, marked = None, False
    with open(f"{job}.frd") as file:
        for line in file:
            if line.startswith(" -4"):
                marked = line.split()[1] == "STRESS"
            elif marked and line.startswith(" -1") and int(line[3:13]) == int(given["POLE"]) + 1:
                stress = float(line[13 + 12 : 13 + 24])
    return force, stress


def main(problem, steps, answer):
    given, steps = np.load(problem), int(steps)
    job = os.path.splitext(answer)[0] + "_deck"
    deck(given, steps, f"{job}.inp")
    ran = subprocess.run(["ccx", job], capture_output=True, text=True)
    if ran.returncode or "Job finished" not in ran.stdout:
        raise SystemExit(next((line for line in ran.stdout.splitlines() if "ERROR" in line), ran.stdout[-500:]).strip())
    force, stress = results(job, given)  # of a wedge of two degrees
    told = subprocess.run(["ccx", "-v"], capture_output=True, text=True).stdout.split()
    found = {
        "version": told[-1],
        "contact": "penalty, surface to surface",
        "force": 180.0 * abs(force),
        "stress": stress,
        "iterations": ran.stdout.count(" iteration "),
    }
    with open(answer, "w") as out:
        json.dump(found, out)


if __name__ == "__main__":
    main(*sys.argv[1:])
