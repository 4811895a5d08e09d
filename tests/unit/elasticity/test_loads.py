"""Loads: nodal forces compared with areas, volumes and fine quadrature; multi-point constraints; messages."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import FLAT, SOLIDS, elastic_model, supported
from refusals import refused
from scipy.sparse import csr_array

import fastcontact as fc
from fastcontact.elasticity.constrained_system import ConstrainedMotion
from fastcontact.elasticity.multipoint_constraints import eliminate
from fastcontact.mesh import elements, quadrature

pytestmark = pytest.mark.pairwise


def block(element, bend=True):
    """A block away from the axis; bent, so that quadratic sides are curved."""
    mesh = fc.generate.block((2.0, 1.5), (3, 2), element, origin=(1.0, 0.5))
    x, y = mesh.points.T
    curved = np.column_stack([x + 0.1 * np.sin(y), y + 0.1 * np.cos(2 * x)])
    return mesh.replace(points=curved) if bend else mesh


def box(element, bend=True):
    mesh = fc.generate.box((2.0, 1.5, 1.0), (2, 2, 1), element)
    if not bend:
        return mesh
    x, y, z = mesh.points.T
    return mesh.replace(points=np.column_stack([x + 0.1 * np.sin(y * z), y + 0.1 * np.cos(x), z + 0.05 * x * y]))


def everywhere(mesh):
    """The mesh with a group OUTSIDE of all its outer facets, some of them the wrong way round."""
    blocks, outside, count = dict(mesh.solids), [], sum(map(len, mesh.solids.values()))
    for name, facets in fc.topology.outer_facets(mesh).items():
        turned = facets.copy()
        turned[::2] = turned[::2][:, list(elements.get(name).reversed)]
        blocks[name] = turned
        outside += range(count, count + len(turned))
        count += len(turned)
    return fc.Mesh(mesh.points, blocks, {"OUTSIDE": outside})


def total(model):
    """Nodal forces of all loads."""
    return sum(model.forces_by_ramp().values(), np.zeros(model.mesh.points.shape))


@pytest.mark.parametrize("element", FLAT + SOLIDS)
def test_uniform_pressure_all_around_has_no_resultant_and_works_on_a_change_of_volume(element):
    """The work of a pressure on a uniform growth is minus pressure times change of volume, on curved facets too."""
    mesh = everywhere(block(element) if element in FLAT else box(element))
    model = elastic_model(mesh, "plane_strain" if mesh.dim == 2 else "3d")
    model.add_pressure("OUTSIDE", 7.0)
    model.add_body_force(x=1.0)
    forces, unit = (load.vector(mesh, model.kinematics) for load in model.loads)
    assert np.abs(forces).max() > 0.1
    assert np.abs(forces.sum(axis=0)).max() < 1e-12
    moment = mesh.points[:, :, None] * forces[:, None, :]
    assert np.abs((moment - moment.transpose(0, 2, 1)).sum(axis=0)).max() < 1e-12
    assert (forces * mesh.points).sum() == pytest.approx(-7.0 * mesh.dim * unit[:, 0].sum(), rel=1e-12)


@pytest.mark.parametrize("element", ["quad8", "tri6"])
@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric"])
def test_nodal_forces_of_curved_facets_against_fine_integration(element, kinematics):
    mesh = block(element)
    model = elastic_model(mesh, kinematics)
    model.add_pressure("RIGHT", lambda x: 1.0 + x[:, 1])
    expected = np.zeros(mesh.points.shape)
    xi, weights = quadrature.gauss_line(40)
    line = elements.get("line3")
    for facet in mesh.cells_of("RIGHT")["line3"]:
        corners = mesh.points[facet]
        x, tangent = line.shape(xi) @ corners, line.gradient(xi)[:, :, 0] @ corners
        normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
        normal *= np.sign(normal[:, :1])  # the right side looks along +x
        ring = 2 * np.pi * x[:, 0] if kinematics == "axisymmetric" else 1.0
        density = -(weights * ring * (1.0 + x[:, 1]))[:, None] * normal
        np.add.at(expected, facet, line.shape(xi).T @ density)
    assert np.abs(total(model) - expected).max() < 1e-13 * np.abs(expected).max()


def test_a_traction_that_varies_has_the_right_moments():
    mesh = block("quad4", bend=False)
    model = elastic_model(mesh, "plane_strain")
    model.add_traction("TOP", y=lambda x: x[:, 0] ** 2, x=-1.0)
    forces = total(model)
    assert forces[:, 0].sum() == pytest.approx(-2.0, rel=1e-13)
    assert forces[:, 1].sum() == pytest.approx((3.0**3 - 1.0) / 3, rel=1e-13)
    assert forces[:, 1] @ mesh.points[:, 0] == pytest.approx((3.0**4 - 1.0) / 4, rel=1e-13)


@pytest.mark.parametrize("element", FLAT)
def test_body_force_by_group_and_over_the_full_circle(element):
    lower, upper = fc.generate.block_on_block(element), "UPPER"
    model = elastic_model(lower, "axisymmetric")
    model.add_body_force(upper, y=-2.0)
    model.add_body_force(y=lambda x: x[:, 0])
    volume = np.pi * 10.0**2 * 5.0
    first, both = (load.vector(lower, "axisymmetric")[:, 1] for load in model.loads)
    assert first.sum() == pytest.approx(-2.0 * volume, rel=1e-13)
    assert not first[lower.points_of("LOWER")].any()
    assert both.sum() == pytest.approx(2 * np.pi * 10.0**3 / 3 * 10.0, rel=1e-13)


def test_a_cell_in_two_groups_is_loaded_once():
    mesh = block("quad4", bend=False)
    mesh = mesh.with_groups(cells={"AGAIN": mesh.cell_groups["BLOCK"]})
    model = elastic_model(mesh, "plane_strain")
    model.add_body_force(["BLOCK", "AGAIN"], x=1.0)
    assert total(model)[:, 0].sum() == pytest.approx(3.0, rel=1e-13)


def test_a_total_force_is_split_consistently():
    mesh = fc.generate.block((3.0, 1.0), (1, 1), "quad8")
    model = elastic_model(mesh, "plane_strain")
    model.add_force("TOP", y=-6.0)
    forces = total(model)[:, 1]
    ends = [mesh.point("TOP_LEFT"), mesh.point("TOP_RIGHT")]
    middle = np.setdiff1d(mesh.points_of("TOP"), ends)
    assert forces[ends] == pytest.approx([-1.0, -1.0], rel=1e-13)
    assert forces[middle] == pytest.approx([-4.0], rel=1e-13)


def test_the_group_decides_what_a_force_is():
    mesh = block("quad4", bend=False)
    mesh = mesh.with_groups(points={"NODES": mesh.points_of("TOP")})
    model = elastic_model(mesh, "plane_strain")
    model.add_force("NODES", x=1.0)
    model.add_force("TOP", y=1.0)
    model.add_force("BOTTOM", y=1.0, distribute=False)
    forces = [load.vector(mesh, "plane_strain") for load in model.loads]
    assert forces[0][mesh.points_of("TOP"), 0] == pytest.approx(1.0)
    assert forces[1][:, 1].sum() == pytest.approx(1.0)
    assert forces[2][mesh.points_of("BOTTOM"), 1] == pytest.approx(1.0)


def test_loads_of_one_history_come_together():
    model = elastic_model(block("quad4"), "plane_strain")
    table = ((0.0, 0.0), (1.0, 2.0))
    model.add_pressure("TOP", 1.0)
    model.add_pressure("TOP", 2.0, ramp=table)
    model.add_traction("TOP", x=1.0, ramp=fc.Ramp((0.5,), table))
    assert set(model.forces_by_ramp()) == {None, table}


# --- linear relations ---------------------------------------------------------------------------------------------


@settings(max_examples=80, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(2, 12), m=st.integers(0, 8))
def test_eliminated_relations_hold(seed, n, m):
    """Whatever the free components are, the relations hold, where supports and repeated rows allow it."""
    rng = np.random.default_rng(seed)
    R = rng.integers(-2, 3, size=(m, n)) * (rng.random((m, n)) < 0.5)
    known = rng.random(n) < 0.3
    u = rng.normal(size=n)  # relations are consistent: some displacement obeys them
    r = R @ u
    tie = eliminate(csr_array(R.astype(float)), known)
    w = rng.normal(size=n)
    w[known] = u[known]
    w[tie.pivots] = 0.0
    if len(tie.origin):
        assert np.abs(tie.conditions @ np.r_[w, r]).max() < 1e-9
    assert not known[tie.pivots].any()
    full = tie.T @ w + tie.S @ r
    assert np.abs(R @ full - r).max(initial=0.0) < 1e-8
    assert full[known] == pytest.approx(w[known])
    rank = np.linalg.matrix_rank(R[:, ~known]) if m and not known.all() else 0
    assert len(tie.pivots) == rank


def test_a_coupled_group_follows_one_node_which_a_support_may_prescribe():
    mesh = block("quad4", bend=False)
    model = elastic_model(mesh, "plane_strain")
    model.couple("TOP", "y")
    (relation,) = model.relations
    tie = eliminate(relation.rows, np.zeros(model.n_dofs, bool))
    assert len(tie.pivots) == len(mesh.points_of("TOP")) - 1
    assert tie.T.nnz == model.n_dofs
    model.prescribe("TOP_LEFT", y=0.25)
    fixed, values = model.prescribed()
    motion = ConstrainedMotion(fixed.ravel(), model.relations)
    assert motion.lift(values.ravel(), [1.0]).reshape(-1, 2)[mesh.points_of("TOP"), 1] == pytest.approx(0.25)


# --- messages -----------------------------------------------------------------------------------------------------


@pytest.fixture
def model():
    mesh = block("quad4", bend=False)
    mesh = mesh.with_groups(points={"NONE": [], "TOP_NODES": mesh.points_of("TOP")})
    return elastic_model(mesh, "plane_strain", BOTTOM="xy")


def test_a_pressure_inside_the_solid_is_refused():
    mesh = fc.generate.block((1.0, 1.0), (2, 1), "quad4")
    inner = np.flatnonzero(np.abs(mesh.points[:, 0] - 0.5) < 1e-12)
    lines = np.vstack([mesh.cells["line2"], inner])
    inside = fc.Mesh(mesh.points, {"quad4": mesh.cells["quad4"], "line2": lines}, {"INNER": [2 + len(lines) - 1]})
    model = elastic_model(inside, "plane_strain")
    with pytest.raises(fc.ModelError, match=r"facets of 'INNER' do not lie on the outside.*1 of 1, .*traction"):
        model.add_pressure("INNER", 1.0)
    model.add_traction("INNER", x=2.0)
    assert total(model)[:, 0].sum() == pytest.approx(2.0)


def test_a_force_on_a_point_outside_all_solids_is_refused(model):
    mesh = model.mesh.replace(points=np.vstack([model.mesh.points, [[2.0, 5.0]]]))
    mesh = mesh.with_groups(points={"REFERENCE": [len(model.mesh.points)]})
    lone = elastic_model(mesh, "plane_strain", BOTTOM="xy")
    lone.add_force("REFERENCE", y=-1.0)
    refused(fc.ModelError, r"nodal force on 'REFERENCE' acts on points .*number: 1", lone.check)
    for node in mesh.points_of("TOP"):
        lone.relate([(int(node), "y", 1.0), ("REFERENCE", "y", -1.0)])
    lone.check()


@pytest.mark.parametrize(
    ("consistent", "contrary", "value"),
    [
        ([[(f"BOTTOM_{side}", "y", 1.0)] for side in ("LEFT", "RIGHT")], [("BOTTOM_LEFT", "y", 1.0)], 0.5),
        (
            [[("TOP_LEFT", "y", f), ("TOP_RIGHT", "y", -f)] for f in (1, -2)],
            [("TOP_LEFT", "y", 1), ("TOP_RIGHT", "y", -1)],
            1e-3,
        ),
    ],
)
def test_relations_that_contradict_supports_or_each_other_are_refused(model, consistent, contrary, value):
    model.couple("BOTTOM", "y")  # consistent with its supports
    for terms in consistent:
        model.relate(terms)
    model.check()
    model.relate(contrary, value=value)
    refused(fc.ModelError, rf"the relation of y of '\w+_LEFT'.* contradicts .* by {value}", model.check)


def test_supports_with_other_histories_clash(model):
    supported(model, TOP={"x": 0.1}, TOP_LEFT={"x": 0.1})
    model.check()
    model.prescribe("TOP_RIGHT", x=0.1, ramp=[(0, 1), (1, 1)])
    refused(fc.ModelError, r"with another ramp", model.check)


def test_motions_that_relations_stop_are_no_longer_free():
    model = elastic_model(block("quad4", bend=False), "plane_strain", BOTTOM_LEFT="xy")
    refused(fc.ModelError, r"1 rigid-body motion is not restrained: body 'BLOCK'.*rotation", model.check)
    model.relate([("BOTTOM_RIGHT", "y", 1.0)])
    model.check()


def test_bodies_tied_by_relations_move_together():
    model = elastic_model(fc.generate.block_on_block("quad4"), "plane_strain", LOWER_BOTTOM="y", LOWER_LEFT="x")
    model.fix("UPPER_LEFT", "x")
    refused(fc.ModelError, r"1 rigid-body motion is not restrained: body 'UPPER': translation along y", model.check)
    model.relate([("LOWER_TOP_LEFT", "y", 1.0), ("UPPER_BOTTOM_LEFT", "y", -1.0)])
    model.check()


@pytest.mark.parametrize(
    ("held", "body"),
    [
        ({"LOWER_BOTTOM": "x", "UPPER_TOP": "xy"}, "LOWER"),
        ({"LOWER_BOTTOM": "xy", "UPPER_TOP": "x"}, "UPPER"),
        ({"LOWER_BOTTOM": "xy"}, "UPPER"),
    ],
)
def test_a_body_that_contact_lets_go_is_said_to_translate(held, body):
    """It can also rotate about many points, and the axis of one such rotation lay ten widths away."""
    model = elastic_model(fc.generate.block_on_block("quad4"), "plane_strain", **held)
    model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", friction=0.2)
    refused(
        fc.ModelError, rf"1 rigid-body motion is not restrained: body '{body}': translation along y\. Fix", model.check
    )
