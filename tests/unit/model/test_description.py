"""The text description of a model."""

import numpy as np

import fastcontact as fc


def blocks():
    model = fc.Model(fc.generate.block_on_block(), kinematics="plane_strain")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3), groups=["LOWER"])
    model.add_material(fc.LinearElastic(E=2000.0, nu=0.499), groups=["UPPER"])
    model.fix("LOWER_BOTTOM", "xy")
    model.prescribe("UPPER_TOP", y=-0.1, ramp=[(0.0, 0.0), (1.0, 1.0)])
    return model


def test_every_part_is_told():
    model = blocks()
    model.add_pressure("UPPER_LEFT", lambda x: x[:, 1])
    model.add_traction("UPPER_RIGHT", x=3.0)
    model.add_spring("UPPER", y=2.0)
    model.couple("UPPER_TOP", "x")
    model.add_contact(
        "joint", secondary="CONT_UPPER", primary="CONT_LOWER", formulation="mortar", friction=0.25, clearance=0.1
    )
    lines = model.describe().splitlines()
    assert lines[0].startswith(
        "A model in plane strain (forces are those for a depth of 1) of 73 points, 50 quad4: 146"
    )
    told = "\n".join(lines[1:])
    for text in (
        "Material: E = 1000, nu = 0.3 in 'LOWER'.",
        "Material: E = 2000, nu = 0.499 in 'UPPER', with a mean dilatation against locking.",
        "Support: x = 0, y = 0 on 'LOWER_BOTTOM' (9 points).",
        "Support: y = -0.1 on 'UPPER_TOP' (7 points), with a separate history.",
        "Load: the pressure on 'UPPER_LEFT': a function of position.",
        "Load: the traction on 'UPPER_RIGHT': x = 3.",
        "Relation: couple('UPPER_TOP', 'x').",
        "Spring: on 'UPPER'.",
        "Contact 'joint': 'CONT_UPPER' (7 points) on 'CONT_LOWER', mortar, with friction 0.25 "
        "(further options: clearance).",
    ):
        assert text in told


def test_units_are_told_where_they_are_known():
    model = blocks()
    assert "Units" not in model.describe()
    model.units = {"length": "mm", "force": "-", "pressure": "MPa"}
    assert "Units: length in mm, pressure in MPa." in model.describe()


def test_what_is_missing_is_told():
    told = fc.Model(fc.generate.box(), kinematics="3d").describe()
    assert "three dimensions" in told
    assert "Material: none yet." in told
    assert "Support: none." in told
    assert "Contact: none." in told


def test_axis_obstacle_and_kinds():
    model = fc.Model(fc.generate.half_spheres(size=25.0), kinematics="axisymmetric")
    model.add_contact("glue", secondary="CONT1", primary="CONT2", kind="tied")
    model.add_obstacle("floor", secondary="A2B2", obstacle=fc.obstacles.HalfSpace((0.0, 60.0), (0.0, -1.0)))
    told = model.describe()
    assert "points on the axis, by symmetry" in told
    assert "mortar with dual multipliers, tied" in told
    assert "on a rigid obstacle, node_to_segment, without friction" in told


def test_a_number_of_steps_solves_so_many():
    model = blocks()
    model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER")
    model.fix("UPPER_TOP", "x")
    by_number, by_ramp = fc.solve(model, 2), fc.solve(model, fc.linear_ramp(2))
    by_array = fc.solve(model, [0.5, 1.0])
    assert [step.load_factor for step in by_number] == [0.5, 1.0]
    for steps in (by_number, by_array):
        assert all((a.displacement == b.displacement).all() for a, b in zip(steps, by_ramp, strict=True))


def test_every_material_load_and_connection_is_told():
    mesh = fc.generate.with_reference_points(fc.generate.block(), {"REF": (0.0, 2.0)})
    model = fc.Model(mesh, "plane_strain")
    told = {
        "Material: E = (1, 2, 3), nu = (0.1, 0.1, 0.1)": fc.Orthotropic(
            (1.0, 2.0, 3.0), (0.1,) * 3, (1.0,) * 3, density=1.0
        ),
        "Material: D with the diagonal": fc.Anisotropic(np.eye(6), density=1.0),
        "nu = 0.3 in all solid cells, with incompatible modes.": fc.LinearElastic(1.0, 0.3, incompatible_modes=True),
    }
    for text, material in told.items():
        model.materials.clear()
        model.add_material(material)
        assert text in model.describe()
    model.add_temperature(5.0, reference=1.0)
    model.add_temperature(np.zeros(mesh.n_points), "BLOCK", ramp=[(0.0, 0.0), (1.0, 1.0)])
    model.add_gravity(y=-1.0)
    model.add_centrifugal(3.0)
    model.add_moment("REF", z=1.5)
    model.add_coupling("REF", "TOP")
    model.add_hydrostatic_pressure("LEFT", weight=1.0, level=2.0)
    lines = model.describe()
    for text in (
        "Temperature: 5 over 1 in all solid cells.",
        "Temperature: a number for each point over 0 in 'BLOCK', with a separate history.",
        "gravity",
        "Load: the centrifugal force",
        "Load: the moment on 'REF': z = 1.5.",
        "Load: the pressure on 'LEFT': a function of position.",
        "Relation: the coupling of 'REF' with 'TOP'.",
    ):
        assert text in lines, text
    assert "coupling" in model._repr_html_()
