"""The formulation that a pair gets without asking for one."""

import logging

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.contact.default_formulation import default_formulation
from fastcontact.contact.surface import surface
from fastcontact.mesh.generate import box, half_spheres, renamed, union


def chosen(mesh, secondary, primary):
    both = {
        default_formulation(surface(mesh, a), surface(mesh, b), mesh.points)[0]
        for a, b in ((secondary, primary), (primary, secondary))
    }
    assert len(both) == 1, "which side is secondary must not matter"
    return both.pop()


@pytest.mark.parametrize(("element", "upper", "expected"), [
    ("quad4", (8, 4), "node_to_segment"), ("tri3", (8, 2), "node_to_segment"), ("quad4", (7, 4), "mortar"),
    ("tri3", (16, 4), "mortar"), ("quad8", (8, 4), "mortar"), ("tri6", (5, 4), "mortar"), ("quad9", (8, 4), "mortar"),
])  # fmt: skip
def test_blocks(element, upper, expected):
    mesh = fc.generate.block_on_block(element, divisions_upper=upper)
    assert chosen(mesh, "CONT_UPPER", "CONT_LOWER") == expected


@pytest.mark.parametrize(("element", "expected"), [
    ("tri3", "node_to_segment"), ("quad4", "node_to_segment"), ("tri6", "mortar"), ("quad8", "mortar"),
])  # fmt: skip
def test_half_spheres_are_mirror_images(element, expected):
    """Their gap grows away from the axis: only where they nearly touch can nodes lie opposite to each other."""
    assert chosen(half_spheres(element), "CONT1", "CONT2") == expected


def test_a_cylinder_on_a_block_does_not_match():
    assert chosen(fc.generate.cylinder_on_block("quad4"), "CONT_CYLINDER", "CONT_BLOCK") == "mortar"


@pytest.mark.parametrize(("element", "divisions", "expected"), [
    ("hex8", (2, 3, 1), "node_to_segment"), ("tet4", (2, 3, 2), "node_to_segment"), ("hex8", (3, 2, 1), "mortar"),
    ("hex20", (2, 3, 1), "mortar"), ("tet10", (2, 3, 1), "mortar"),
])  # fmt: skip
def test_boxes(element, divisions, expected):
    parts = [box((1.0, 1.0, 1.0), d, element, (0.0, 0.0, z)) for d, z in (((2, 3, 1), -1.0), (divisions, 0.0))]
    mesh = union(*(renamed(p, {n: f"{side}_{n}" for n in p.group_names}) for p, side in zip(parts, "LU", strict=True)))
    assert chosen(mesh, "U_ZMIN", "L_ZMAX") == expected


def test_it_does_not_depend_on_units_or_place():
    for scale, turn in ((1e-9, 0.0), (1.0, 1.1), (1e3, 2.5)):
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        for upper, expected in (((8, 4), "node_to_segment"), ((7, 4), "mortar")):
            mesh = fc.generate.block_on_block("quad4", divisions_upper=upper)
            mesh = mesh.replace(points=scale * mesh.points @ rotation.T)
            assert chosen(mesh, "CONT_UPPER", "CONT_LOWER") == expected


def test_the_choice_is_seen_in_the_model_and_in_the_log(caplog):
    model = fc.Model(fc.generate.block_on_block("quad4"), "plane_strain")
    with caplog.at_level(logging.INFO, "fastcontact"):
        model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER")
        asked = fc.Model(model.mesh, "plane_strain")
        asked.add_contact("other", secondary="CONT_UPPER", primary="CONT_LOWER", formulation="node_to_segment")
    assert "pair: CONT_UPPER on CONT_LOWER, mortar" in repr(model)
    assert "other: CONT_UPPER on CONT_LOWER, node_to_segment" in repr(asked)
    assert caplog.messages == [
        "contact 'pair': formulation mortar, since the nodes of the two sides do not lie opposite to each other"
    ]
