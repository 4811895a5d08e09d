"""Fluid penetration of a contact: a flat seal by statics, a front by pressure, pockets, friction, restarts."""

import numpy as np
import pytest
from models import elastic_model, supported, united
from refusals import refused

import fastcontact as fc

FORMULATIONS = (
    {}, {"formulation": "mortar", "multipliers": "standard"}, {"formulation": "continuous"},
    {"formulation": "node_to_segment"}, {"friction": 0.3}, {"formulation": "continuous", "friction": 0.3},
)  # fmt: skip
CONTINUOUS = FORMULATIONS[2]
E = 1000.0
# The top is pressed down in the first unit of time and held; then the pressure of the fluid is the time less one.
HELD, FLUID = ((0, 0), (1, 1), (100, 1)), ((0, 0), (1, 0), (101, 100))


def seal(element="quad4", push=-0.02, source="B BOTTOM_LEFT", **options):
    """Return two blocks of 2 (by 1) by 1 that are pressed together to a pressure of E push / 2."""
    solid = element.startswith(("hex", "tet"))
    if solid:
        size, divisions, names = (2.0, 1.0, 1.0), (4, 2, 1), ("ZMIN", "ZMAX", "xyz")
        bodies = [fc.generate.box(size, divisions, element, (0.0, 0.0, z), name="C") for z in (0.0, 1.0)]
        source = "B XMIN"
    else:
        names = ("BOTTOM", "TOP", "xy")
        bodies = [fc.generate.block((2.0, 1.0), (6, 2), element, (0.0, z), name="C") for z in (0.0, 1.0)]
    mesh = fc.generate.union(*(fc.generate.renamed(b, lambda g, n=n: f"{n} {g}") for b, n in zip(bodies, "AB")))
    model = elastic_model(mesh, "3d" if solid else "plane_strain", E=E, nu=0.0)
    bottom, top, axes = names
    supported(model, **{f"A {bottom}": axes, f"B {top}": dict.fromkeys(axes[:-1], 0.0)})
    model.prescribe(f"B {top}", **{axes[-1]: push}, ramp=HELD)
    model.add_contact("seal", secondary=f"B {bottom}", primary=f"A {top}", **options)
    model.add_fluid_pressure("seal", 1.0, source=source, ramp=FLUID)
    return model


@pytest.mark.filterwarnings("ignore:contact 'seal' is blown open")
@pytest.mark.parametrize(
    ("options", "element"),
    [(options, element) for options in FORMULATIONS for element in ("quad4", "quad8", "hex8")]
    + [(CONTINUOUS, "hex20"), (CONTINUOUS, "tet10"), ({}, "hex20")],
)
def test_a_flat_seal_opens_at_the_pressure_of_statics(options, element):
    """Tight at 99.9 % of the contact pressure of 10, open at 100.1 %; then the gap is (p - 10) 2 / E."""
    for step in fc.solve(seal(element, **options), fc.Ramp((1.0, 5.0, 10.99, 11.01, 14.0), ((0, 0), (30, 30)))):
        contact, fluid = step.contact["seal"], step.load_factor - 1.0
        if fluid < 10.0:
            assert not contact.fluid_pressure.any()
            assert np.abs(contact.pressure - 10.0).max() < 1e-6
        else:
            assert np.abs(contact.fluid_pressure - fluid).max() < 1e-12
            assert not contact.pressure.any()
            assert not contact.active.any()
            assert np.abs(contact.gap - 2.0 * (fluid - 10.0) / E).max() < 1e-8
        assert abs(contact.force[-1] - 2.0 * max(fluid, 10.0)) < 1e-5
        assert abs(step.work["imbalance"]) < 1e-6
    assert any("is blown open" in text for text in step.warnings)


def test_the_front_stops_where_the_contact_presses_more():
    """A push that grows from left to right, on a soft foundation of strips: fluid comes as far as it is stronger."""
    model = seal(push=lambda x: -0.004 - 0.01 * x[:, 0])
    step = fc.solve(model, fc.Ramp((1.0, 4.0, 7.0), ((0, 0), (30, 30))))
    dry, reaches = step[0].contact["seal"], []
    for later, fluid, resultants in zip(step[1:], (3.0, 6.0), fc.contact_resultants(model, step, "seal")[1:]):
        contact = later.contact["seal"]
        order = np.argsort(contact.coordinates[:, 0])
        wet = contact.fluid_pressure[order] > 0.0
        reaches.append(wet.sum())
        assert (np.diff(wet.astype(int)) <= 0).all()  # one front
        assert (contact.pressure[order][~wet] > fluid).all()
        assert (contact.gap[order][wet] > 0.0).all()
        assert (contact.active[order] == ~wet).all()
        # Resultants except for the force are those of the contact pressure.
        x, pressure = contact.coordinates[order, 0], contact.pressure[order]
        assert resultants.normal_force == pytest.approx(np.trapezoid(pressure, x), rel=1e-3)
        assert resultants.pressure_mean < pressure.max()
        assert resultants.centre[0] == pytest.approx(np.trapezoid(pressure * x, x) / resultants.normal_force, rel=0.02)
        assert contact.fluid_force == pytest.approx([0.0, contact.force[1] - contact.normal_force], rel=1e-3)
        assert f"of which the fluid {contact.fluid_force[1]:.6g}" in repr(contact)
    assert dry.active.all()
    assert 0 < reaches[0] < reaches[1] < len(dry.points)


@pytest.mark.parametrize("options", FORMULATIONS)
def test_the_front_is_the_same_from_the_other_side(options):
    forces = []
    for source, push in (("LEFT", lambda x: -0.004 - 0.01 * x[:, 0]), ("RIGHT", lambda x: -0.024 + 0.01 * x[:, 0])):
        model = seal(push=push, source=f"B BOTTOM_{source}", **options)
        forces.append(fc.solve(model, fc.Ramp((1.0, 6.0), ((0, 0), (30, 30))))[-1].contact["seal"].force)
    assert forces[0] * [-1, 1] == pytest.approx(forces[1], rel=1e-9)


@pytest.mark.parametrize("element", ["hex20", "tet10"])
def test_on_quadratic_faces_continuous_finds_the_front_of_mortar_to_a_facet(element):
    """Nodal pressures of quadratic faces oscillate: a node beside the front may be wet that mortar keeps dry."""
    fronts, facet = [], 0.5
    for options in (CONTINUOUS, {}):
        model = seal(element, push=lambda x: -0.004 - 0.01 * x[:, 0], **options)
        steps = fc.solve(model, fc.Ramp((1.0, 4.0, 7.0), ((0, 0), (30, 30))))[1:]
        fronts.append([step.contact["seal"] for step in steps])
    for continuous, mortar in zip(*fronts, strict=True):
        for contact in (continuous, mortar):
            x, wet = contact.coordinates[:, 0], contact.fluid_pressure > 0.0
            assert 0 < wet.sum() < len(wet)
            assert x[wet].max() < x[~wet].min() + facet
        assert continuous.force[-1] == pytest.approx(mortar.force[-1], rel=5e-3)
        reach = [contact.coordinates[contact.fluid_pressure > 0.0, 0].max() for contact in (continuous, mortar)]
        assert abs(reach[0] - reach[1]) <= facet


def test_a_pocket_that_no_facet_connects_with_the_source_stays_dry():
    """Open in the middle, closed on both sides of it: the fluid does not get there."""
    model = seal(clearance=lambda x: np.where(np.abs(x[:, 0] - 1.0) < 0.1, 0.05, 0.0))
    step = fc.solve(model, fc.Ramp((1.0, 6.0), ((0, 0), (30, 30))))[-1].contact["seal"]
    middle = np.abs(step.coordinates[:, 0] - 1.0) < 0.1
    assert (step.gap[middle] > 0.01).all()
    assert not step.fluid_pressure.any()


def test_what_is_refused():
    refused(fc.ContactError, "no nodes of the secondary side", seal, source="A BOTTOM_LEFT")
    refused(fc.ContactError, "no fluid can enter", seal, kind="tied")
    model = seal()
    refused(fc.ModelError, "unknown contact", model.add_fluid_pressure, "sael", 1.0, source="B BOTTOM_LEFT")
    refused(fc.ModelError, "negative", model.add_fluid_pressure, "seal", -1.0, source="B BOTTOM_LEFT")


@pytest.mark.parametrize("element", ["tri6", "quad8", "quad4"])
def test_fluid_round_a_disc_comes_as_far_as_the_contact_presses_less(element):
    """At a curved side, nodes whose places beside them are what is closed have gaps of their own, and are tight."""
    sizes = {"size": 0.5, "contact_size": 0.2} if element == "tri6" else {"arc_sizes": (0.1, 0.3), "segments": 8}
    mesh = fc.generate.quarter_disc(element, R=2.5, **sizes)
    mesh = fc.generate.renamed(mesh, {"CONT1": "ARC", "D1B1": "ARC"})
    model = elastic_model(mesh, "plane_strain", E=100.0, A1A2="x", A1B1="y")
    plate = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, -1.0))
    model.add_obstacle("plate", secondary="ARC", obstacle=plate, motion={"y": -0.1}, ramp=HELD)
    model.add_fluid_pressure("plate", 1.5, source="B1", ramp=FLUID)
    last = fc.solve(model, fc.linear_ramp(2, end=2.0))[-1]
    contact = last.contact["plate"]
    wet = contact.fluid_pressure > 0.0
    assert 0 < wet.sum() < len(wet)
    assert contact.pressure[~wet].min() > 1.5
    assert contact.gap[wet].min() >= contact.gap[~wet].min()
    # Fluid presses along the normals of the disc: as much as on the height that it wets.
    y = contact.coordinates[:, 1]
    assert contact.force[0] == pytest.approx(-1.5 * (0.5 * (y[wet].max() + y[~wet].min()) - y.min()), rel=0.02)
    assert abs(last.reaction[mesh.points_of("A1B1"), 1].sum() + contact.force[1]) < 1e-9 * abs(contact.force[1])


@pytest.mark.parametrize("strain", ["small", "finite"])
def test_the_force_of_a_fluid_does_not_depend_on_the_choice_of_the_secondary_side(strain):
    """A half disc of height 1 on a plate, wetted on its left as far as the contact: statics demands the pressure times it."""
    disc = fc.generate.mirrored(fc.generate.quarter_disc("tri6", R=1.0, size=0.2, contact_size=0.1), "y")
    disc = fc.generate.renamed(disc, {"CONT1": "ARC", "D1B1": "ARC"})
    disc = fc.generate.merge_points(fc.generate.union(disc, fc.generate.mirrored(disc, "x")), 1e-6)
    disc = disc.with_facet_group("CUT", lambda x: x[:, 1] > 1.0 - 1e-9)
    disc = disc.with_facet_group("EDGE", lambda x: (x[:, 0] < -0.95) & (x[:, 1] < 1.0))
    plate = fc.generate.renamed(fc.generate.block((4.0, 1.0), (48, 8), "quad4", (-2.0, -1.0)), lambda g: f"PLATE {g}")
    plate = plate.with_facet_group("FACES", lambda x: abs(abs(x[:, 1] + 0.5) - 0.5) < 1e-9)  # its back stays dry
    on_disc, on_plate, pressure, push = [], [], 1.5, 0.02
    for secondary, source in (("ARC", "EDGE"), ("PLATE TOP", "PLATE TOP_LEFT")):
        model = fc.Model(fc.generate.union(disc, plate), "plane_strain", strain=strain)
        model.add_material(fc.LinearElastic(E=100.0, nu=0.3) if strain == "small" else fc.NeoHookean(E=100.0, nu=0.3))
        supported(model, CUT={"x": 0.0, "y": -push, "ramp": HELD}, **{"PLATE BOTTOM": "xy"})
        primary = {"ARC": "FACES", "PLATE TOP": "ARC"}[secondary]
        model.add_contact("seal", secondary=secondary, primary=primary, search_distance=4.0)
        model.add_fluid_pressure("seal", pressure, source=source, ramp=((0, 0), (1, 0), (2, 1)))
        last = fc.solve(model, fc.Ramp((0.5, 1.0, 2.0), ((0, 0), (2, 2))))[-1]
        seal = last.contact["seal"]
        forces = [seal.force, seal.primary_force_vectors.sum(axis=0)]
        on_disc.append(forces[secondary != "ARC"])
        on_plate.append(forces[secondary == "ARC"])
        assert np.abs(last.reaction[model.mesh.points_of("CUT")].sum(axis=0) + on_disc[-1]).max() < 1e-9
    for force in on_disc:
        assert force[0] == pytest.approx(pressure * (1.0 - (push if strain == "finite" else 0.0)), rel=0.01)
    for forces, error in ((on_disc, 0.005), (on_plate, 0.002)):
        assert forces[0] == pytest.approx(forces[1], abs=error * abs(forces[1][1]))


@pytest.mark.filterwarnings("ignore:contact 'seal' is blown open")
@pytest.mark.parametrize(
    ("options", "element"),
    [(options, element) for options in FORMULATIONS[:4] for element in ("quad4", "quad8", "hex8")]
    + [({}, "hex20"), (CONTINUOUS, "hex20"), (CONTINUOUS, "tet10")],
)
def test_fluid_presses_on_the_part_of_the_secondary_side_that_faces_nothing(options, element):
    """A small block floats over a wide one: the fluid presses on the whole top of the wide block."""
    solid = element.startswith(("hex", "tet"))
    bottom, top, axes = ("ZMIN", "ZMAX", "xyz") if solid else ("BOTTOM", "TOP", "xy")
    generate = fc.generate.box if solid else fc.generate.block
    depth, divisions = ((1.0,), (2, 1)) if solid else ((), (1,))
    wide = generate((2.0, *depth, 0.5), (8, *divisions), element, (0.0, *(0.0 for _ in depth), -0.5), name="WIDE")
    small = generate((0.4, *depth, 0.5), (2, *divisions), element, (0.55, *(0.0 for _ in depth), 0.1), name="SMALL")
    model = elastic_model(united(**{"W ": wide, "S ": small}), E=E, **{f"W {bottom}": axes, f"S {top}": axes})
    model.add_contact("seal", secondary=f"W {top}", primary=f"S {bottom}", **options)
    model.add_fluid_pressure("seal", 2.0, source=f"W {top}")
    seal = fc.solve(model, 1)[-1].contact["seal"]
    assert (seal.fluid_pressure == 2.0).all()
    assert seal.normal_force == 0.0
    assert seal.force == pytest.approx([0.0] * (len(axes) - 1) + [-4.0], abs=1e-6)
    assert seal.primary_force_vectors.sum(axis=0)[-1] == pytest.approx(0.8, rel=1e-6)


@pytest.mark.parametrize(
    ("options", "swapped", "element"),
    [({}, 0, "hex8"), (CONTINUOUS, 0, "hex8"), (CONTINUOUS, 0, "tet10"), ({}, 1, "hex8"), ({}, 1, "hex20")],
)
def test_fluid_round_a_sphere_presses_on_both_sides(options, swapped, element):
    """A quarter of half a sphere on a block, in fluid, which presses on the projections of the surfaces of both."""
    sizes = dict(zip(("size", "contact_size"), (0.25, 0.15) if element == "hex8" else (0.5, 0.25)))
    mesh = fc.generate.sphere_on_block(element, R=1.0, block_size=(1.6, 0.8), contact_radius=0.3, **sizes)
    mesh = mesh.with_facet_group("SURFACE", lambda x: abs(np.linalg.norm(x - [0.0, 1.0, 0.0], axis=1) - 1.0) < 1e-6)
    mesh = mesh.with_groups(points={"FAR": np.flatnonzero(np.linalg.norm(mesh.points[:, ::2], axis=1) > 0.99)})
    model = elastic_model(mesh, "3d", E=100.0, nu=0.3, SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="xyz")
    model.prescribe("SPHERE_TOP", x=0.0, y=-0.02, z=0.0, ramp=HELD)
    secondary, primary = ("CONT_BLOCK", "SURFACE") if swapped else ("SURFACE", "CONT_BLOCK")
    model.add_contact("seal", secondary=secondary, primary=primary, **options)
    model.add_fluid_pressure("seal", 1.5, source="FAR", ramp=((0, 0), (1, 0), (2, 1)))
    seal = fc.solve(model, fc.Ramp((1.0, 2.0), ((0, 0), (2, 2))))[-1].contact["seal"]
    forces = [seal.force_vectors.sum(axis=0), seal.primary_force_vectors.sum(axis=0)]
    on_sphere, on_block = forces[::-1] if swapped else forces
    assert on_sphere == pytest.approx(1.5 * 0.25 * np.pi * np.array([-1.0, 1.0, -1.0]), rel=0.01)
    assert on_block == pytest.approx([0.0, -1.5 * 1.6**2, 0.0], rel=0.02, abs=0.01)


def test_facets_that_two_fluids_press_on_are_told():
    model = elastic_model(fc.generate.block((2.0, 1.0), (4, 2)), "plane_strain", E=1.0, nu=0.3, TOP="xy")
    for name, height in (("near", -0.1), ("far", -0.2)):
        model.add_obstacle(name, secondary="BOTTOM", obstacle=fc.obstacles.HalfSpace((0.0, height), (0.0, 1.0)))
        model.add_fluid_pressure(name, 1e-3, source="BOTTOM_LEFT")
    with pytest.warns(fc.FastcontactWarning) as told:
        fc.solve(model, 1)
    assert any("'near' and 'far' both act on 4 secondary facets" in str(warning.message) for warning in told)
