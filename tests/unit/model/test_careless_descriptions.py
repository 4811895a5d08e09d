"""Careless input: reversed normals, groups of cells for forces, numbers without meaning."""

import numpy as np
import pytest
from models import elastic_model, supported

import fastcontact as fc


def bolt(**options):
    """Return a bar of length 10 that is held at both ends and cut across in its middle."""
    bar = fc.generate.box((1.0, 1.0, 10.0), (1, 1, 4), "hex8")
    bar = bar.with_facet_group("CUT", lambda x: abs(x[:, 2] - 5.0) < 1e-9, between=True)
    model = elastic_model(fc.generate.cut(bar, "CUT"), "3d", E=210e3, nu=0.0, ZMIN="xyz", ZMAX="xyz")
    model.add_pretension("bolt", "CUT", force=1000.0, **options)
    return model


def plate(kinematics="plane_stress"):
    model = fc.Model(fc.generate.block((1.0, 1.0), (2, 2)), kinematics)
    model.add_material(fc.LinearElastic(E=1e3, nu=0.3, expansion=1e-5))
    return model


@pytest.mark.parametrize("normal", [None, (0.0, 0.0, 2.0), (0.0, 0.0, -1.0), (0.0, 0.3, -1.0)])
def test_tension_is_tension_whichever_way_the_normal_points(normal):
    step = fc.solve(bolt(normal=normal), 1)[-1]
    assert step.pretension["bolt"]["force"] == pytest.approx(1000.0, rel=1e-9)
    assert step.stress[:, 2].mean() > 900.0


def test_a_section_cut_towards_the_other_side_is_in_tension_too():
    bar = fc.generate.box((1.0, 1.0, 2.0), (1, 1, 2), "hex8")
    bar = bar.with_facet_group("CUT", lambda x: abs(x[:, 2] - 1.0) < 1e-9, between=True)
    model = elastic_model(fc.generate.cut(bar, "CUT", normal=(0.0, 0.0, -1.0)), "3d", E=1.0, nu=0.0, ZMIN="xyz")
    model.fix("ZMAX", "xyz")
    model.add_pretension("bolt", "CUT", force=0.1)
    assert fc.solve(model, 1)[-1].stress[:, 2] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"normal": (1.0, 0.0, 0.0)}, "the normal of pretension 'bolt' deviates by 90 degrees from that of 'CUT'"),
        ({"locked_from": 0.0}, "its force never acts"),
        ({"locked_from": -1.0}, "its force never acts"),
    ],
)
def test_bolts_that_cannot_be_meant_are_refused(options, text):
    with pytest.raises(fc.errors.ModelError, match=text):
        fc.solve(bolt(**options), 1)


def test_one_section_has_one_pretension():
    model = bolt()
    with pytest.raises(fc.errors.ModelError, match="are in one section, which has one force"):
        model.add_pretension("other", "CUT", shortening=0.1)


def test_a_force_on_solid_cells_is_refused():
    with pytest.raises(fc.errors.ModelError, match="'BLOCK' is a group of solid cells"):
        plate().add_force("BLOCK", y=-1.0)
    model = plate()
    model.add_force("BLOCK", y=-1.0, distribute=False)
    assert model.load_vector(model.loads[0])[:, 1] == pytest.approx(-1.0)


def test_points_and_sectors_are_whole_numbers():
    for place in (1.5, 12.7):
        with pytest.raises(fc.errors.ModelError, match=f"point {place} is not in the mesh"):
            plate().add_spring(place, y=1.0)
    with pytest.raises(fc.errors.ModelError, match="two sectors at least, a whole number"):
        plate("plane_strain").add_cyclic_symmetry("LEFT", "BOTTOM", sectors=2.5)


@pytest.mark.parametrize("state", ["strain", "stress", "temperature"])
def test_large_strains_without_stress_are_told(state):
    model = plate()
    supported(model, LEFT="x", BOTTOM="y")
    if state == "strain":
        model.add_initial_strain(xx=-0.5)
    elif state == "stress":
        model.add_initial_stress(xx=500.0)
    else:
        model.add_temperature(5e4)
    with pytest.warns(
        fc.FastcontactWarning, match=r"temperatures and initial states cause strains of 0.5, beyond the 0.1"
    ):
        fc.solve(model, 1)


def test_small_ones_are_not():
    model = plate()
    supported(model, LEFT="x", BOTTOM="y")
    model.add_temperature(100.0)
    assert fc.solve(model, 1)[-1].warnings == ()


def test_numbers_of_other_kinds_are_numbers():
    for number in (np.float32(1000.0), np.array(1000.0), np.int64(1000)):
        assert fc.LinearElastic(E=number, nu=0.3).E == 1000.0
    with pytest.raises(fc.errors.ModelError, match="E = True must be a positive number"):
        fc.LinearElastic(E=True, nu=0.3)
    with pytest.raises(fc.errors.ModelError, match="must be a sequence of sequences of numbers"):
        fc.Tabulated("x", [(0.0, "1.0")])


@pytest.mark.parametrize("name", ["hex8", "quad4", "tet10"])
def test_a_cell_with_a_node_twice_is_refused(name):
    mesh = fc.generate.block(element=name) if name == "quad4" else fc.generate.box(element=name)
    nodes = mesh.cells[name].copy()
    nodes[1, 2] = nodes[1, 1]
    with pytest.raises(fc.errors.MeshError, match=rf"cell \d+ \({name} at .*has point {nodes[1, 1]} twice"):
        fc.Model(mesh.replace(cells={**mesh.cells, name: nodes}), "3d" if mesh.dim == 3 else "plane_strain")
