"""Friction between mirrored bodies has no effect: they stick everywhere, as if each were pressed on a smooth plane.

Without friction two-body contact is not quite symmetric itself, since at the edge of the contact the normal of one side
leans; friction takes up what that leaves. So the two bodies with friction are compared with each on a smooth plane.
"""

import functools
import warnings

import numpy as np
import pytest
from models import elastic_model, pressed_spheres, supported
from two_bodies import arcs

import fastcontact as fc

pytestmark = pytest.mark.each_value

MESHES = {"tri3": {"size": 6.0}, "tri6": {"size": 8.0}, "quad4": {"arc_sizes": (0.5, 4.0), "radial_sizes": (0.5, 4.0)}}
FACETS = [("node_to_segment", {}), ("node_to_segment", {"normals": "averaged"})]
FIELDS = [("continuous", {}), ("mortar", {"multipliers": "standard"})]


def spheres(element, name=None, **options):
    return pressed_spheres(fc.generate.half_spheres(element, **MESHES[element]), name=name, **options)


def pressed(element, formulation, steps=1, friction=0.3, criteria=None, **options):
    model = spheres(element, "pair", formulation=formulation, friction=friction, **options)
    return fc.solve(model, fc.linear_ramp(steps), criteria=criteria, linear_solver="direct")


@functools.cache
def on_a_plane(element, formulation, augmentation=None):
    model = spheres(element)
    options = {} if augmentation is None else {"augmentation": augmentation}
    for side, normal in (("CONT1", -1.0), ("CONT2", 1.0)):
        plane = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, normal))
        model.add_obstacle(side, secondary=side, obstacle=plane, formulation=formulation, **options)
    with warnings.catch_warnings():  # of the two bodies, which know nothing of each other
        warnings.filterwarnings("ignore", "bodies .* interpenetrate", fc.FastcontactWarning)
        return fc.solve(model, fc.linear_ramp(1), linear_solver="direct")[-1]


def apart(one, other):
    return max(
        np.abs(one.displacement - other.displacement).max() / np.abs(other.displacement).max(),
        np.abs(one.stress - other.stress).max() / np.abs(other.stress).max(),
    )


@pytest.mark.parametrize("steps", [1, 5])
@pytest.mark.parametrize("element", ["tri3", "tri6"])
@pytest.mark.parametrize(("formulation", "options"), FACETS)
def test_node_to_segment_with_friction_is_each_body_on_a_smooth_plane(element, formulation, options, steps):
    found = pressed(element, formulation, steps, **options)
    assert apart(found[-1], on_a_plane(element, "node_to_segment")) < 1e-8
    for step in found:
        contact = step.contact["pair"]
        assert contact.sticking[contact.active].all()
        assert abs(contact.dissipation) < 1e-9 * np.abs(contact.force[1])  # times a slip of 1


def test_increments_along_the_path_keep_mirrored_bodies_mirrored():
    """What closing a gap adds to the slip where the normal leans belongs to the increment that closes it."""
    along = fc.Criteria(friction_while_touching=0.01)
    step = pressed("tri6", "node_to_segment", 2, criteria=along, normals="averaged")[-1]
    assert apart(step, on_a_plane("tri6", "node_to_segment")) < 1e-8
    assert step.contact["pair"].sticking[step.contact["pair"].active].all()


@pytest.mark.parametrize(("element", "exact"), [("tri3", 1e-2), ("quad4", 1e-3)])
@pytest.mark.parametrize(("formulation", "options"), FIELDS)
def test_fields_of_multipliers_stick_everywhere_without_work(element, exact, formulation, options):
    step = pressed(element, formulation, **options)[-1]
    contact = step.contact["pair"]
    assert contact.sticking[contact.active].all()
    assert abs(contact.dissipation) < 1e-9 * np.abs(contact.force[1])
    # Points with pressure and a gap, which the augmentation leaves at the edge, face each other at a slant.
    assert np.abs(contact.shear).max() < exact * contact.pressure_max
    if element == "quad4":  # whose contact has many facets, and a flat one at the axis
        axis = int(np.argmin(contact.coordinates[:, 0]))
        assert np.abs(contact.shear[axis]).max() < 1e-6 * contact.pressure_max
    assert apart(step, on_a_plane(element, "continuous", 2.0)) < 0.1 * exact


@pytest.mark.parametrize(("formulation", "options"), FIELDS)
def test_what_fields_of_multipliers_miss_vanishes_with_the_gaps_they_leave(formulation, options):
    step = pressed("tri3", formulation, augmentation=1e5, **options)[-1]
    assert apart(step, on_a_plane("tri3", "continuous", 2e5)) < 1e-8


@pytest.mark.parametrize("multipliers", ["dual"])
def test_dual_multipliers_dissipate_nothing_on_a_fine_path(multipliers):
    for step in pressed("quad4", "mortar", 5, multipliers=multipliers):
        assert abs(step.contact["pair"].dissipation) < 1e-9 * np.abs(step.contact["pair"].force[1])


@pytest.mark.parametrize(("formulation", "exact"), [("node_to_segment", 1e-9), ("continuous", 1e-4)])
def test_mirrored_bodies_in_space_stay_mirrored(formulation, exact):
    # Supports hold one direction of slip at the nodes of the planes of symmetry, and all at the pole.
    body = fc.generate.sphere_octant("hex8", size=25.0, contact_size=3.0, contact_radius=10.0)
    upper = fc.generate.renamed(body, {name: f"U_{name}" for name in body.group_names})
    names = {name: name.replace("U_", "L_") for name in upper.group_names}
    mesh = fc.generate.union(upper, fc.generate.mirrored(upper, "y", at=body.points[:, 1].min(), rename=names))
    model = elastic_model(mesh, "3d", E=20_000.0)
    for side, approach in (("U", -1.0), ("L", 1.0)):
        model.fix(f"{side}_SYMMETRY_X", "x")
        supported(model, **{f"{side}_SYMMETRY_Z": "z", f"{side}_SPHERE_TOP": {"y": approach}})
    sides = {"secondary": "U_CONT_SPHERE", "primary": "L_CONT_SPHERE"}
    model.add_contact("pair", formulation=formulation, friction=0.3, **sides)
    step = fc.solve(model, fc.linear_ramp(1), linear_solver="direct")[-1]
    contact, half = step.contact["pair"], body.n_points
    assert contact.active.sum() > 4
    assert contact.sticking[contact.active].all()
    assert abs(contact.dissipation) < 1e-9 * np.abs(contact.force[1])
    mirrored = step.displacement[half:] * (1.0, -1.0, 1.0)
    assert np.abs(step.displacement[:half] - mirrored).max() < exact


def test_frictionless_and_frictional_forces_agree_but_for_the_edge():
    smooth, rough = (pressed("quad4", "continuous", friction=mu)[-1].contact["pair"] for mu in (0.0, 0.3))
    assert rough.force[1] == pytest.approx(smooth.force[1], rel=1e-3)
    assert rough.pressure_max == pytest.approx(smooth.pressure_max, rel=2e-3)


FIT = [
    {"formulation": "continuous", "surface_smoothing": True},
    {"formulation": "mortar", "multipliers": "standard"},
    {"formulation": "mortar", "multipliers": "dual"},
    {"formulation": "node_to_segment", "surface_smoothing": True},
]


@pytest.mark.parametrize("options", FIT, ids=str)
@pytest.mark.parametrize(
    ("elements", "turned", "swap"),
    [("quad4", 0.0, False), ("tri3", 0.3, True), ("hex8", 0.3, False), ("tet4", 0.0, True)],
)
def test_press_fit_between_planes_of_symmetry_sticks_without_shear(elements, turned, swap, options):
    """A tenth of two rings whose straight facets do not match: where facets end, their normals lean across the plane."""
    space = elements in ("hex8", "tet4")
    ends = ("YMIN", "YMAX", "ZMIN", "ZMAX") if space else ("BOTTOM", "TOP")
    cells = [(3, n, 1) if space else (4, n) for n in (6, 5)]
    model = elastic_model(arcs(elements, cells, 0.2 * np.pi, turned))
    for name in "AB":
        for end in ends:
            model.fix(name + end, "normal")
    sides = ("AXMAX", "BXMIN") if space else ("ARIGHT", "BLEFT")
    secondary, primary = sides[::-1] if swap else sides
    model.add_contact("fit", secondary=secondary, primary=primary, clearance=-1e-3, friction=0.3, **options)
    contact = fc.solve(model, 1)[-1].contact["fit"]
    x, y = contact.coordinates.T[:2] / 2.0
    around = contact.shear[:, 1] * x - contact.shear[:, 0] * y
    # Diagonals of tetrahedra lean to one side: their pressures differ by 37 %, and shear comes with that.
    assert np.abs(around).max() < (0.04 if elements == "tet4" else 0.01) * contact.pressure.mean()
    assert contact.sticking.all()
