"""Nodes that alternate between two facets: the equilibrium at their common edge is found."""

import numpy as np
import pytest
from models import elastic_model, pressed_spheres, united

import fastcontact as fc


def spheres(**options):
    mesh = fc.generate.half_spheres(element="quad8", segments=16)
    model = pressed_spheres(mesh, 1.0, formulation="node_to_segment", **options)
    return fc.solve(model, 1)[-1]


def test_the_force_between_spheres_is_that_of_averaged_normals():
    with pytest.warns(fc.FastcontactWarning, match=r"alternated between two facets .* by \d\.\de-0\d of its largest"):
        faceted = spheres(normals="facet")
    averaged = spheres(normals="averaged")
    assert "rounded" in faceted.iterations["history"][-1]
    assert "rounded" not in averaged.iterations["history"][-1]
    assert faceted.contact["hertz"].force[1] == pytest.approx(averaged.contact["hertz"].force[1], rel=1e-7)
    assert faceted.contact["hertz"].pressure_max == pytest.approx(averaged.contact["hertz"].pressure_max, rel=1e-4)


def pressed(element, cells, swapped, friction):
    """A round block pressed on a hollow one, by node-to-segment contact with the normals of facets."""
    parts = {}
    for name, size, count, bend in (("LOW", 1.4, cells[0], 0.08), ("UP", 1.0, cells[1], 0.1)):
        lower = name == "LOW"
        mesh = fc.generate.box(
            (size, size, 0.7), (count, count, 2), element, (-size / 2, -size / 2, -0.7 if lower else 0.0), name=name
        )
        points = np.array(mesh.points)
        share = (points[:, 2] + 0.7) / 0.7 if lower else 1.0
        points[:, 2] += bend * share * (points[:, :2] ** 2).sum(axis=1)
        parts[f"{name}_"] = mesh.replace(points=points)
    model = elastic_model(united(**parts), "3d", LOW_ZMIN="xyz", UP_ZMAX={"x": 0.0, "y": 0.0, "z": -0.02})
    sides = ("LOW_ZMAX", "UP_ZMIN") if swapped else ("UP_ZMIN", "LOW_ZMAX")
    model.add_contact(
        "pair", secondary=sides[0], primary=sides[1], formulation="node_to_segment", normals="facet", friction=friction
    )
    return fc.solve(model, 1)[-1]


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")  # coarse facets deviate from their arcs
@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(("element", "cells", "friction"), [
    ("hex8", (6, 4), 0.0), ("hex8", (4, 6), 0.3), ("tet4", (5, 5), 0.0), ("tet4", (6, 4), 0.3),
])  # fmt: skip
def test_equilibrium_is_found_in_space(element, cells, friction, swapped):
    step = pressed(element, cells, swapped, friction)
    contact = step.contact["pair"]
    sizes = np.linalg.norm(contact.force)
    assert contact.active.any()
    # Both sides have the same force, which the supports of the lower block carry.
    assert np.abs(contact.force_vectors.sum(axis=0) + contact.primary_force_vectors.sum(axis=0)).max() < 1e-8 * sizes
    assert np.abs(step.reaction.sum(axis=0)).max() < 1e-7 * sizes
    assert contact.gap[contact.active] == pytest.approx(0.0, abs=2e-3 * 0.02)
