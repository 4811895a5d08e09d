"""Hanging nodes on facets of their own body are found in every dimension and order."""

import numpy as np
import pytest
from models import elastic_model, last_step, united

import fastcontact as fc
from fastcontact import cli
from fastcontact.mesh.generate import block, box
from fastcontact.mesh.hanging_nodes import hanging_nodes
from fastcontact.model.hanging_nodes import hanging_nodes_warning

pytestmark = pytest.mark.pairwise


def joined(lower, upper):
    return fc.generate.merge_points(united(L_=lower, U_=upper), 1e-9)


def plates(element, coarse, fine):
    return joined(
        block((10.0, 5.0), (coarse, 2), element, (0.0, -10.0)), block((10.0, 5.0), (fine, 2), element, (0.0, -5.0))
    )


def cubes(element, coarse, fine):
    return joined(box((1.0,) * 3, (coarse,) * 3, element), box((1.0,) * 3, (fine,) * 3, element, (0.0, 0.0, 1.0)))


def hanging(mesh):
    return np.unique(hanging_nodes(mesh)[0]).tolist()


def not_shared(mesh, along, at):
    """Nodes of the plane where both halves meet that only one of them has."""
    ours, theirs = (set(mesh.points_of(group).tolist()) for group in along)
    plane = np.flatnonzero(mesh.points[:, -1] == at).tolist()
    return [node for node in plane if (node in ours) != (node in theirs)]


@pytest.mark.parametrize("element", ["tri3", "quad4", "tri6", "quad8", "quad9"])
@pytest.mark.parametrize(("coarse", "fine"), [(4, 4), (4, 8), (4, 12), (8, 4), (4, 5), (4, 6)])
def test_plates(element, coarse, fine):
    mesh = plates(element, coarse, fine)
    expected = not_shared(mesh, ("L_BLOCK", "U_BLOCK"), -5.0)
    if element.startswith(("tri6", "quad8", "quad9")):  # a node at the middle of a quadratic facet belongs to it
        assert bool(hanging(mesh)) == (coarse != fine)
        assert set(hanging(mesh)) <= set(np.flatnonzero(mesh.points[:, 1] == -5.0).tolist())
    else:
        assert hanging(mesh) == expected
        assert bool(expected) == (coarse != fine)


@pytest.mark.parametrize("element", ["tet4", "hex8", "wedge6", "pyramid5", "tet10", "hex20"])
@pytest.mark.parametrize("fine", [1, 2, 3])
def test_cubes(element, fine):
    mesh = cubes(element, 1, fine)
    assert bool(hanging(mesh)) == (fine > 1)
    if element in ("tet4", "hex8", "wedge6"):
        assert hanging(mesh) == not_shared(mesh, ("L_BOX", "U_BOX"), 1.0)


@pytest.mark.parametrize("R", [50.0, 10.0, 5.0])
@pytest.mark.parametrize("element", ["quad4", "quad8"])
@pytest.mark.parametrize("fine", [4, 8])
def test_arcs_of_other_facets_leave_each_other_and_tear_all_the_same(fine, element, R):
    flat = plates(element, 4, fine)
    radius, angle = R + flat.points[:, 1] + 5.0, flat.points[:, 0] / R
    mesh = flat.replace(points=np.column_stack([radius * np.sin(angle), radius * np.cos(angle)]))
    mesh, _ = fc.topology.oriented(mesh)
    assert bool(hanging(mesh)) == (fine == 8)


def test_a_quadratic_facet_on_a_linear_one():
    mesh = joined(block((1.0, 1.0), (2, 1), "quad4"), block((1.0, 1.0), (2, 1), "quad8", (0.0, 1.0)))
    assert hanging(mesh) == not_shared(mesh, ("L_BLOCK", "U_BLOCK"), 1.0)


@pytest.mark.parametrize(
    "mesh",
    [
        fc.generate.half_spheres("tri6", size=10.0),
        fc.generate.block_on_block(),
        fc.generate.cylinder_on_block(),
        fc.generate.rings(),
        fc.generate.sphere_on_block(),
        fc.generate.refined(fc.generate.half_spheres(size=20.0)),
    ],
    ids=["half-spheres", "block-on-block", "cylinder-on-block", "rings", "sphere-on-block", "refined"],
)
def test_meshes_that_fit_have_none(mesh):
    assert not hanging(mesh)


def slit(opening):
    """A plate with a slit from its middle to its right side, whose lower and upper nodes do not lie opposite."""
    lower, upper = block((10.0, 5.0), (8, 2), origin=(0.0, -5.0)), block((10.0, 5.0), (8, 2))
    points = upper.points.copy()
    on_lip = (points[:, 1] == 0.0) & (points[:, 0] > 5.0)
    points[on_lip, 1] += 1e-6 + opening
    points[on_lip & (points[:, 0] < 10.0), 0] += 0.6
    return joined(lower, upper.replace(points=points))


def test_a_slit_is_none_where_it_is_open_or_a_contact_or_relation_joins_its_sides():
    assert hanging(slit(0.0))
    mesh = slit(0.0)
    assert not [node for node in hanging(slit(0.2)) if mesh.points[node, 0] > 6.5]
    facets = mesh.cells["line2"]
    inside = {}
    for name, group in (("LOW", "L_TOP"), ("HIGH", "U_BOTTOM")):
        numbers = mesh.cell_groups[group]
        inside[name] = numbers[mesh.points[facets[numbers - mesh.offsets["line2"]], 0].min(axis=1) > 6.0]
    mesh = mesh.with_groups(cells=inside)
    model = elastic_model(mesh, "plane_strain")
    before = hanging_nodes_warning(model)
    model.add_contact("slit", secondary="LOW", primary="HIGH")
    after = hanging_nodes_warning(model)
    count = [int(text.split()[0]) if text else 0 for text in (before, after)]
    assert count[1] < count[0]
    related = elastic_model(mesh, "plane_strain")
    for node in hanging(mesh):
        related.relate([(node, "y", 1.0), (0, "y", -1.0)])
    assert not hanging_nodes_warning(related)


@pytest.mark.parametrize("fine", [4, 8])
def test_the_warning_comes_before_the_solution_and_a_mesh_that_fits_is_silent(fine):
    mesh = plates("quad4", 4, fine)
    model = elastic_model(mesh, "plane_strain", E=2e5, L_BOTTOM="xy")
    model.add_traction("U_TOP", y=100.0)
    step, texts = last_step(model)
    assert list(step.warnings) == texts
    if fine == 4:
        assert not texts
    else:
        first = hanging(mesh)[0]
        assert texts[0].startswith(
            f"4 nodes lie on facets of their own body that they do not belong to (first: point {first} at"
        )
    assert fc.quality(mesh).hanging_nodes == "".join(texts[:1])


CASE = """kinematics = "plane_strain"
[mesh]
file = "plates.med"
[[material]]
E = 2e5
nu = 0.3
"""


@pytest.mark.parametrize("name", ["plates.med", "case.toml"])
@pytest.mark.parametrize("fine", [4, 8])
def test_info_shows_the_warning(name, fine, tmp_path, capsys):
    fc.write_mesh(tmp_path / "plates.med", plates("quad4", 4, fine))
    (tmp_path / "case.toml").write_text(CASE)
    assert cli.main(["info", str(tmp_path / name)]) == 0
    shown = capsys.readouterr().out
    assert ("warning: 4 nodes lie on facets of their own body that they do not" in shown) == (fine == 8)


@pytest.mark.parametrize("thickness", [1.0, 0.1, 0.01])
@pytest.mark.parametrize("element", ["tri3", "quad4", "tri6", "quad8", "quad9"])
def test_nodes_across_a_thin_curved_sheet_do_not_hang(element, thickness):
    flat = block((20.0, thickness), (4, 1), element)
    radius, angle = 8.0 + flat.points[:, 1], flat.points[:, 0] / 8.0
    mesh, _ = fc.topology.oriented(
        flat.replace(points=np.column_stack([radius * np.sin(angle), radius * np.cos(angle)]))
    )
    assert not hanging(mesh)
    if element.startswith("tri"):
        return
    sheet = box((10.0, 10.0, thickness), (4, 4, 1), {"quad4": "hex8", "quad8": "hex20"}.get(element, "hex27"))
    assert not hanging(sheet)


def test_bodies_in_contact_hang_on_nothing():
    assert not hanging(fc.generate.block_on_block(divisions_lower=(3, 2), divisions_upper=(7, 2)))
