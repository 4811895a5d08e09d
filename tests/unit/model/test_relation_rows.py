"""Constraints along normals and between groups, and pretension sections: rotated results, refusals."""

import json

import numpy as np
import pytest
from case_texts import case_of
from models import body_of, elastic_model, supported, with_contact
from refusals import refused

import fastcontact as fc
from fastcontact.cases.case import build_case
from fastcontact.cli._main import main
from fastcontact.model.fingerprint import differing_parts, fingerprint

E, NU = 1000.0, 0.3
ANGLE = 0.4
FORMULATIONS = ["node_to_segment", "continuous", "mortar"]


def turn(dim):
    """A rotation, in space about an oblique axis."""
    c, s = np.cos(ANGLE), np.sin(ANGLE)
    if dim == 2:
        return np.array([[c, -s], [s, c]])
    x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return z @ x


def block(dim, element=None):
    return body_of(element or ("quad4" if dim == 2 else "hex8"), (2.0, 3.0, 1.0), (2, 3, 1))


def last(model, **options):
    return fc.solve(model, fc.linear_ramp(2), **options)[-1]


def pair_of(element):
    """Return dimensions, a rotation, planes of symmetry with their axes, a face to move, and a body before and after it."""
    dim = 2 if element.startswith(("tri", "quad")) else 3
    held = {"XMIN": "x", "YMIN": "y", "ZMIN": "z"} if dim == 3 else {"LEFT": "x", "BOTTOM": "y"}
    mesh, Q = block(dim, element), turn(dim)
    return (
        dim,
        Q,
        held,
        "ZMAX" if dim == 3 else "TOP",
        elastic_model(mesh),
        elastic_model(mesh.replace(points=mesh.points @ Q.T)),
    )


@pytest.mark.parametrize(
    ("along", "element"),
    [("normal", element) for element in ("tri3", "tri6", "quad4", "quad8", "tet4", "tet10", "hex8", "hex20", "wedge6")]
    + [("axes", element) for element in ("tri3", "quad8", "tet10", "hex8")],
)
def test_supports_along_normals_or_axes_turn_with_the_body(along, element):
    """With a displacement that varies along the surface and has its own history."""
    dim, Q, held, moved, straight, turned = pair_of(element)
    axes = tuple(Q[:, 0].tolist()) if dim == 2 else tuple(tuple(row) for row in Q.T.tolist())
    options = {"axes": axes} if along == "axes" else {}
    for group, axis in held.items():
        straight.fix(group, axis)
        turned.fix(group, axis if along == "axes" else "normal", **options)
    last_axis, ramp = "xyz"[dim - 1], [(0, 0), (0.5, 1), (1, 0.25)]

    def depth(x):
        return -0.1 * (1 + x[:, 0])

    straight.prescribe(moved, ramp=ramp, **{last_axis: depth})
    turned_depth = {last_axis if along == "axes" else "normal": lambda x: depth(x @ Q)}
    turned.prescribe(moved, ramp=ramp, **turned_depth, **options)
    one, other = last(straight), last(turned)
    np.testing.assert_allclose(other.displacement, one.displacement @ Q.T, atol=1e-13)
    np.testing.assert_allclose(other.reaction, one.reaction @ Q.T, atol=1e-9 * np.abs(one.reaction).max())


@pytest.mark.each_value
@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_contact_between_turned_bodies_is_the_same(formulation, solver):
    mesh, Q = fc.generate.block_on_block(divisions_lower=(5, 3), divisions_upper=(4, 3)), turn(2)
    found = []
    for turned in (False, True):
        model = elastic_model(mesh.replace(points=mesh.points @ Q.T) if turned else mesh)
        for group, axis in {"LOWER_LEFT": "x", "UPPER_LEFT": "x", "LOWER_BOTTOM": "y"}.items():
            model.fix(group, "normal" if turned else axis)
        model.prescribe("UPPER_TOP", ramp=[(0, 0), (0.5, 1), (1, 0.5)], **{"normal" if turned else "y": -0.05})
        # Where supports hold nodes, the continuous one makes a shear field compliant that does no work: by axes alone.
        friction = 0.0 if formulation == "continuous" else 0.1
        with_contact(model, "pair", "CONT_UPPER", "CONT_LOWER", formulation=formulation, friction=friction)
        found.append(last(model, linear_solver=solver))
    np.testing.assert_allclose(found[1].displacement, found[0].displacement @ Q.T, atol=1e-8 * 0.05)


def test_a_smooth_mandrel_holds_a_ring_and_lame_tells_the_pressure():
    """A ring on a rigid mandrel under a pressure from outside: zero radial displacement inside."""
    errors = []
    for n in (8, 16):
        square = fc.generate.block((1.0, 1.0), (n, n // 2), "quad8")
        angle, radius = 0.5 * np.pi * (1 - square.points[:, 0]), 1.0 + square.points[:, 1]
        mesh = square.replace(points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
        model = elastic_model(mesh, BOTTOM="normal", LEFT="x", RIGHT="y")
        model.add_pressure("TOP", 2.0)
        step = last(model)
        inside = mesh.points_of("BOTTOM")
        radial = mesh.points[inside] / np.linalg.norm(mesh.points[inside], axis=1, keepdims=True)
        assert np.abs((step.displacement[inside] * radial).sum(axis=1)).max() < 1e-5
        # u = A r + B / r with u(1) = 0: the stresses at 1 and 2 follow from sigma_rr(2) = -2.
        ratio = 1 - 2 * NU
        inner = 2.0 * (1 + 1 / ratio) / (1 / ratio + 0.25)
        stress = step.stress[mesh.points_of("BOTTOM")[0]]
        n0 = radial[0]
        found = n0[0] ** 2 * stress[0] + n0[1] ** 2 * stress[1] + 2 * n0[0] * n0[1] * stress[3]
        errors.append(abs(found + inner) / inner)
    assert errors[1] < 2e-3
    assert errors[1] < 0.4 * errors[0]


def test_nodes_coupled_along_normals_move_by_the_same():
    mesh, Q = block(2), turn(2)
    axes, turned = elastic_model(mesh), elastic_model(mesh.replace(points=mesh.points @ Q.T))
    for group, axis in {"LEFT": "x", "BOTTOM": "y"}.items():
        axes.fix(group, axis)
        turned.fix(group, "normal")
    axes.couple("TOP", "y")
    turned.couple("TOP", "normal")
    for model in (axes, turned):
        model.add_pressure("TOP", lambda x: 3.0 + 0.0 * x[:, 0])
        model.add_pressure("RIGHT", 1.0)
    np.testing.assert_allclose(last(turned).displacement, last(axes).displacement @ Q.T, atol=1e-13)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_part_that_repeats_itself_keeps_its_ends_together(dim):
    """Ends that move together leave no strain across: uniaxial strain, though nothing else holds the ends."""
    model = elastic_model(block(dim, "quad8" if dim == 2 else "hex8"))
    low, high = ("LEFT", "RIGHT") if dim == 2 else ("XMIN", "XMAX")
    model.relate_groups(low, high, "xyz"[:dim])
    bottom, top = ("BOTTOM", "TOP") if dim == 2 else ("YMIN", "YMAX")
    supported(model, **{bottom: "y", top: {"y": -0.3}, "BOTTOM_LEFT" if dim == 2 else "XMIN": {"x": 0.0}})
    if dim == 3:
        supported(model, ZMIN="z", ZMAX="z")
    step = last(model)
    stiff = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
    np.testing.assert_allclose(step.stress[:, 1], -0.1 * stiff, rtol=1e-10)
    np.testing.assert_allclose(step.stress[:, 0], -0.1 * stiff * NU / (1 - NU), rtol=1e-10)


def test_ends_may_be_strained_by_a_value():
    model = elastic_model(block(2))
    model.relate_groups("RIGHT", "LEFT", "x", value=0.02)
    supported(model, BOTTOM="y", BOTTOM_LEFT="x")
    np.testing.assert_allclose(last(model).stress[:, 0], 0.01 * E / (1 - NU**2), rtol=1e-10)


def test_groups_are_related_along_their_normals():
    """Opposite faces of a block squeezed by equal amounts: their displacements out of the body are equal."""
    mesh = block(2)
    model = elastic_model(mesh)
    model.relate_groups("BOTTOM", "TOP", "normal")
    model.couple("TOP", "y")
    model.fix("LEFT", "x")
    model.add_force("TOP", y=-5.0)
    step = last(model)
    bottom, top = mesh.points_of("BOTTOM"), mesh.points_of("TOP")
    np.testing.assert_allclose(step.displacement[bottom, 1], -step.displacement[top[0], 1], rtol=1e-12)
    assert step.displacement[top[0], 1] < 0


def test_a_support_that_contradicts_a_normal_one_is_told():
    model = elastic_model(block(2), LEFT="x", BOTTOM="y")
    model.prescribe("BOTTOM", normal=0.1)
    refused(fc.ModelError, "the displacement normal prescribed on 'BOTTOM' contradicts the supports", last, model)


@pytest.mark.parametrize(
    ("face", "corner"),
    [
        ({"x": 0.3}, lambda e: {"x": 0.3 + e}),
        ({"x": 0.3, "y": 0.0}, lambda e: {"x": 0.3, "y": e}),
        (
            {"x": 0.3, "ramp": [(0, 0), (0.3, 1), (1, 2)]},
            lambda e: {"x": 0.6, "ramp": [(0, 0), (0.3 + e, 0.5), (1, 1)]},
        ),
        ({"x": 0.3, "ramp": [(0, 0), (1, 1)]}, lambda e: {"x": [(0.5, 0.15), (1, 0.3 + e)]}),
        ({"normal": 0.3}, lambda e: {"x": 0.3 + e}),
        ({"rotation": {"angle": 0.1, "centre": (0, 0)}}, lambda e: {"rotation": {"angle": 0.1, "centre": (0, e)}}),
    ],
)
def test_two_supports_of_a_node_may_differ_by_round_off_alone(face, corner):
    for excess in (1e-15, 1e-8):
        model = elastic_model(block(2), LEFT="xy")
        model.prescribe("RIGHT", **face)
        model.prescribe("TOP_RIGHT", **corner(excess))
        if excess < 1e-12:
            model.check()
    refused(fc.ModelError, "'TOP_RIGHT' prescribes .*, but 'RIGHT' prescribes|contradicts the supports", model.check)


# ----------------------------------------------------------------------------- supports along axes
def test_a_cosine_that_is_round_off_contradicts_no_support():
    model = elastic_model(block(2))
    c, s = np.cos(np.pi / 2), np.sin(np.pi / 2)
    model.fix("LEFT", "x", axes=(c, s))
    supported(model, BOTTOM="y", TOP={"x": 0.1 * s, "y": -0.1 * c})
    assert last(model).displacement[:, 1] == pytest.approx(0.0, abs=1e-12)


def test_a_ring_held_round_about_is_lames():
    """All ends held along the circumference, the bore widened along the radius: plane strain, Lame."""
    mesh = fc.generate.block((1.0, 1.0), (6, 8), "quad8")
    radius, angle = 1.0 + mesh.points[:, 0], 0.3 + 0.9 * mesh.points[:, 1]
    mesh = mesh.replace(points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
    model, round_about = elastic_model(mesh), fc.CylindricalAxes()
    model.fix("BOTTOM", "y", axes=round_about)
    model.fix("TOP", "y", axes=round_about)
    model.prescribe("LEFT", x=0.01, axes=round_about)
    step = last(model)
    # u = A r + B / r without stress outside: A / (1 - 2 nu) = B / 4.
    b = 0.01 / (1.0 + (1.0 - 2.0 * NU) / 4.0)
    exact = b / radius + (1.0 - 2.0 * NU) * b / 4.0 * radius
    unit = mesh.points / radius[:, None]
    assert np.einsum("nd,nd->n", step.displacement, unit) == pytest.approx(exact, rel=2e-4)
    found = fc.sensitivities(
        model, step, ("displacement", mesh.point("TOP_RIGHT"), "y"), [("prescribed", "LEFT")], ramp=2
    )
    assert found.derivatives["prescribed", "LEFT"] == pytest.approx(found.value, rel=1e-9)


def bar(cut=True):
    mesh = fc.generate.block((1.0, 2.0), (2, 4))
    mesh = mesh.with_facet_group("CUT", lambda x: np.abs(x[:, 1] - 1.0) < 1e-9, between=True)
    return elastic_model(fc.generate.cut(mesh, "CUT") if cut else mesh, "plane_stress", TOP="xy", BOTTOM="xy")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, "pretension 'bolt' needs either a force or a shortening"),
        ({"force": 1.0, "shortening": 1.0}, "needs either a force or a shortening"),
        ({"shortening": 1.0, "locked_from": 1.0}, "locked_from applies to a force only"),
        ({"force": np.inf}, "the force of pretension 'bolt' is inf"),
        ({"force": 1.0, "opposite": "CUT"}, "share point 2: the sides need separate nodes"),
        ({"force": 1.0, "opposite": "TOP"}, "lies .* from the nearest node of 'TOP'"),
        ({"force": 1.0, "normal": (0.0, 0.0)}, "the normal .* must be 2 numbers, not all zero"),
    ],
)
def test_what_is_refused(options, said):
    refused(fc.ModelError, said, bar().add_pretension, "bolt", "CUT", **options)


def test_a_mesh_that_is_not_cut_and_names_given_twice():
    with pytest.raises(fc.ModelError, match=r"the mesh is not cut along 'CUT'.*fc\.generate\.cut\(mesh, 'CUT'\)"):
        bar(cut=False).add_pretension("bolt", "CUT", force=1.0)
    model = bar()
    model.add_pretension("bolt", "CUT", force=1.0)
    refused(fc.ModelError, "there is already a pretension 'bolt'", model.add_pretension, "bolt", "CUT", force=1.0)


def test_a_bent_section_needs_a_normal():
    model = bar()
    points = np.array(model.mesh.points)
    points[[7, 16], 1] += 0.1
    model.mesh = model.mesh.replace(points=points)
    refused(fc.ModelError, "do not determine a plane: give its normal", model.add_pretension, "bolt", "CUT", force=1.0)
    model.add_pretension("bolt", "CUT", force=1.0, normal=(0.0, 2.0))
    (step,) = fc.solve(model, 1)
    assert step.pretension["bolt"]["force"] == pytest.approx(1.0)


def test_a_lock_is_the_end_of_a_step():
    model = bar()
    model.add_pretension("bolt", "CUT", force=1.0, locked_from=0.7)
    with pytest.raises(fc.ModelError, match=r"is locked from 0\.7, but no load step ends there: .* such as 0\.5"):
        fc.solve(model, [0.5, 1.0])


def test_the_lock_counts_in_the_fingerprint():
    prints = []
    for begin in (None, 1.0, 2.0):
        model = bar()
        model.add_pretension("bolt", "CUT", force=1.0, locked_from=begin)
        prints.append(fingerprint(model))
    changed = ["the loads", "the relations", "the pretension sections"]
    assert differing_parts(prints[0], prints[1]) == differing_parts(prints[1], prints[2]) == changed


BOLT = """[[pretension]]
name = "bolt"
section = "CUT"
force = 3.0
locked_from = 1.0
"""
RAMP = "instants = [1.0, 2.0]\ntable = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]"
CASE = case_of('file = "bar.med"', BOLT, "plane_stress", ramp=RAMP, TOP="xy", BOTTOM="xy")


def test_a_case_file_cuts_its_mesh_and_the_summary_tells(tmp_path, capsys):
    fc.write_mesh(tmp_path / "bar.med", bar(cut=False).mesh)
    (tmp_path / "bolt.toml").write_text(CASE)
    out, summary = str(tmp_path / "bolt.vtkhdf"), str(tmp_path / "s.json")
    assert main(["run", str(tmp_path / "bolt.toml"), "-o", out, "--json", summary]) == 0
    assert "pretension 'bolt': force 3, shortened by 0.0058" in capsys.readouterr().out
    steps = json.loads((tmp_path / "s.json").read_text())["steps"]
    assert [step["pretension"]["bolt"]["force"] for step in steps] == pytest.approx([3.0, 3.0])
    kept = fc.open_results(tmp_path / "bolt.vtkhdf")
    assert [step.pretension["bolt"]["force"] for step in kept] == pytest.approx([3.0, 3.0])


def test_a_case_names_the_section_that_is_missing():
    data = {
        "kinematics": "plane_stress",
        "mesh": {"generator": "box"},
        "material": [{"E": 1.0, "nu": 0.0}],
        "pretension": [{"name": "bolt", "section": "NONE", "force": 1.0}],
    }
    with pytest.raises(fc.FastcontactError, match=r"pretension\[0\]: unknown group of cells 'NONE'"):
        build_case(data, name="bolt", mesh=bar(cut=False).mesh)
