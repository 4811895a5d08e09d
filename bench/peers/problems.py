"""The problems for all programs, as plain arrays in one file, so that all programs use the same mesh.

``python problems.py NAME DOFS PROBLEM.npz`` writes one and prints the number of its displacement components.

``points`` (n, dim) [length], ``cells`` (m, 4 or 8) in VTK's order, ``E`` [pressure], ``nu``, ``approach`` [length] at full
load, and by name: ``nodes_*``, point numbers; ``facets_*`` (k, 2 or 4) of the contact surfaces; ``POLE``, the point of
first contact.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np

import fastcontact as fc

E, NU, R = 20_000.0, 0.3, 50.0


def nodes(mesh: fc.Mesh, group: str) -> Any:
    """Return the points of a cell group, ascending."""
    return np.unique(np.concatenate([facets.ravel() for facets in facets_of(mesh, group)]))


def facets_of(mesh: fc.Mesh, group: str) -> list[Any]:
    return [mesh.cells[name][rows] for name, rows in mesh.split(mesh.cell_groups[group]).items()]


def quadrangles(maker: Callable[..., fc.Mesh], dofs: int) -> fc.Mesh:
    """Return FORMA04's graded quadrangles, all sizes scaled to give about `dofs` unknowns."""

    def scaled(factor: float) -> fc.Mesh:
        return maker(
            "quad4", R=R, arc_sizes=(1.5 * factor, 3.0 * factor), radial_sizes=(1.5 * factor, 4.5 * factor),
            segments=max(2, round(6 / factor)),
        )  # fmt: skip

    return near(scaled, (2 * scaled(1.0).n_points / dofs) ** 0.5, dofs)


def near(make: Callable[[float], fc.Mesh], size: float, dofs: int) -> fc.Mesh:
    """Return a mesh with `dofs` unknowns to 3 %, or the last of six attempts."""
    for _ in range(6):
        mesh = make(size)
        ratio = mesh.dim * mesh.n_points / dofs
        if abs(ratio - 1.0) < 0.03:
            break
        size *= ratio ** (1 / mesh.dim)
    return mesh


def forma04(dofs: int) -> dict[str, Any]:
    """Two half-spheres pressed together by 4 mm: `y` of the flat edges goes by -2 and +2."""
    mesh = quadrangles(fc.generate.half_spheres, dofs)
    upper = np.zeros(len(mesh.cells["quad4"]), bool)
    upper[mesh.split(mesh.cell_groups["SPHHAU"])["quad4"]] = True
    found = {"cells": mesh.cells["quad4"], "upper": upper, "approach": 4.0, "POLE": mesh.point("C1")}
    for group in ("A1A2", "A1B1", "A2B2"):
        found[f"nodes_{group}"] = nodes(mesh, group)
    for group in ("CONT1", "CONT2"):
        found[f"facets_{group}"] = facets_of(mesh, group)[0]
    return {"points": mesh.points, **found}


def half(dofs: int) -> dict[str, Any]:
    """The upper of the two half-spheres on a rigid plane at y = 0, which is the same problem by symmetry."""
    mesh = quadrangles(lambda *a, **k: fc.generate.quarter_disc(*a, body="upper", **k), dofs)
    return {
        "points": mesh.points, "cells": mesh.cells["quad4"], "approach": 2.0, "POLE": mesh.point("C2"),
        "nodes_A1A2": nodes(mesh, "A1A2"), "nodes_A2B2": nodes(mesh, "A2B2"), "facets_CONT2": facets_of(mesh, "CONT2")[0],
    }  # fmt: skip


def octant(dofs: int) -> dict[str, Any]:
    """A quarter of a half-sphere on a rigid plane at y = 0 in three dimensions, finest at the contact."""

    def scaled(size: float) -> fc.Mesh:
        return fc.generate.sphere_octant("hex8", R=R, size=size, contact_size=size / 3, contact_radius=10.0)

    mesh = near(scaled, 3.0 * (114_036 / dofs) ** (1 / 3), dofs)
    found = {"cells": mesh.cells["hex8"], "approach": 2.0, "POLE": mesh.point("POLE_SPHERE")}
    for group in ("SYMMETRY_X", "SYMMETRY_Z", "SPHERE_TOP"):
        found[f"nodes_{group}"] = nodes(mesh, group)
    return {"points": mesh.points, "facets_CONT_SPHERE": facets_of(mesh, "CONT_SPHERE")[0], **found}


PROBLEMS = {"forma04": forma04, "half": half, "octant": octant}


def main(name: str, dofs: str, path: str) -> None:
    found = PROBLEMS[name](int(dofs))
    np.savez(path, E=E, nu=NU, R=R, problem=name, **found)
    print(found["points"].size)


if __name__ == "__main__":
    main(*sys.argv[1:])
