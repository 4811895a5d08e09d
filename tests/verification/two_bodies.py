"""Pairs of small bodies for tests of contact options: blocks, boxes, rings."""

import numpy as np
import pytest
from models import elastic_model, supported, united, with_contact

import fastcontact as fc
from fastcontact.mesh.generate import block, box, renamed, union

YOUNG, POISSON = 1000.0, 0.3
EVERY = [("node_to_segment", {}), ("continuous", {}), ("mortar", {}), ("mortar", {"multipliers": "dual"})]
each = pytest.mark.parametrize(("formulation", "options"), EVERY, ids=["node", "continuous", "mortar", "dual"])
SIDES = {"plane": ("CONT_UPPER", "CONT_LOWER"), "space": ("U_ZMIN", "L_ZMAX")}


def blocks(element="quad4", lower=(3, 2), upper=(3, 2), apart=0.0):
    """Two blocks of 10 by 5 on each other along y = 0, the upper one lifted."""
    mesh = fc.generate.block_on_block(divisions_lower=lower, divisions_upper=upper, element=element)
    points = mesh.points.copy()
    points[mesh.points_of("UPPER"), 1] += apart
    return mesh.replace(points=points)


def boxes(element="hex8", lower=(2, 3, 2), upper=(2, 3, 2), apart=0.0, upper_element=None):
    """Two boxes of 10 by 10 by 5 on each other along z = 0, the upper one lifted; groups as of `box`, after L_ or U_."""
    low = box((10.0, 10.0, 5.0), lower, element, (0.0, 0.0, -5.0))
    return united(L_=low, U_=box((10.0, 10.0, 5.0), upper, upper_element or element, (0.0, 0.0, apart)))


def held(mesh, kinematics="plane_strain", approach=0.02):
    """The lower body stands, the upper one goes down by `approach`; both slide along their left sides."""
    model = elastic_model(mesh, kinematics, E=YOUNG, nu=POISSON)
    if kinematics == "3d":
        for side in "LU":
            supported(model, **{f"{side}_XMIN": "x", f"{side}_YMIN": "y"})
        supported(model, L_ZMIN="z", U_ZMAX={"z": -approach})
    else:
        supported(model, LOWER_LEFT="x", UPPER_LEFT="x", LOWER_BOTTOM="y", UPPER_TOP={"y": -approach})
    return model


def touching(model, formulation, swap=False, **options):
    """Let the two bodies touch; return the model."""
    secondary, primary = SIDES["space" if model.mesh.dim == 3 else "plane"][:: -1 if swap else 1]
    return with_contact(model, "pair", secondary, primary, formulation=formulation, **options)


def ring(element, inner, outer, divisions, name):
    """A quarter of a ring in polar cells: groups name, name_INNER, name_OUTER, and XAXIS, YAXIS on the cuts."""
    flat = block((1.0, 1.0), divisions, element, name=name)
    angle, radius = 0.5 * np.pi * (1.0 - flat.points[:, 0]), inner + (outer - inner) * flat.points[:, 1]
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    points[np.abs(points) < 1e-14 * outer] = 0.0
    sides = {"BOTTOM": f"{name}_INNER", "TOP": f"{name}_OUTER", "LEFT": "YAXIS", "RIGHT": "XAXIS"}
    return renamed(flat.replace(points=points), lambda group: sides.get(group, group if group == name else None))


def rings(element, inner=(1.0, 2.0), outer=(2.0, 3.0), divisions=((6, 3), (6, 3))):
    """Two quarters of rings around each other, SHAFT and HUB."""
    return union(ring(element, *inner, divisions[0], "SHAFT"), ring(element, *outer, divisions[1], "HUB"))


def arcs(element, cells, angle, start=0.0, height=0.2):
    """Sectors of two rings, A from the radius 1 to 2 and B from 2 to 3, of cells (across, along) or (across, along, up).

    Groups are those of `block` or `box` after A or B: x becomes the radius, y the angle.
    """
    parts = {}
    for name, inside, divisions in zip("AB", (1.0, 2.0), cells, strict=True):
        make, size = (block, (1.0, 1.0)) if len(divisions) == 2 else (box, (1.0, 1.0, height))
        mesh = make(size, divisions, element)
        r, t = inside + mesh.points[:, 0], start + angle * mesh.points[:, 1]
        parts[name] = mesh.replace(points=np.column_stack([r * np.cos(t), r * np.sin(t), mesh.points[:, 2:]]))
    return united(**parts)
