"""Element loops in every dimension against plain NumPy twins, patch tests, exact solutions, orientation, mixed meshes."""

import numpy as np
import pytest
from models import CELLS, SOLIDS, elastic_model
from refusals import refused

import fastcontact as fc
from fastcontact.elasticity.stiffness import rigid_modes, sparsity, stiffness
from fastcontact.mesh import elements
from fastcontact.mesh.generate.box import box
from fastcontact.mesh.topology import corner_measures, oriented, outer_facets

pytestmark = pytest.mark.pairwise

QUADRATIC = [name for name in SOLIDS if elements.get(name).order == 2]
E, NU = 210.0, 0.3
# Displacement gradient of a linear field without symmetry, and its strain.
SLOPE = np.array([[1.0, 0.4, -0.3], [-0.2, -2.0, 0.7], [0.5, 0.1, 0.6]]) * 1e-3
STRAIN = [SLOPE[0, 0], SLOPE[1, 1], SLOPE[2, 2], SLOPE[0, 1] + SLOPE[1, 0], SLOPE[1, 2] + SLOPE[2, 1],
          SLOPE[0, 2] + SLOPE[2, 0]]  # fmt: skip


def moduli(kinematics="3d"):
    return fc.LinearElastic(E, NU).moduli(kinematics)


D = moduli()


def distorted(mesh, amount=0.03):
    """All points moved by a smooth field, mid nodes too, so that edges and faces curve."""
    return mesh.replace(points=mesh.points + amount * np.sin(4.0 * mesh.points[:, [1, 2, 0]] + [0.3, 1.1, 2.0]))


def patch(element, divisions=(2, 2, 2)):
    return distorted(box((2.0, 1.5, 1.2), divisions, element, (0.5, -0.3, 0.2)))


def plane_patch(element):
    """A distorted patch of cells away from the axis."""
    mesh = fc.generate.block((2.0, 1.5), (3, 2), element, origin=(2.0, -0.3))
    return mesh.replace(points=mesh.points + np.sin(7.0 * mesh.points[:, ::-1]) * 0.04)


def mixed():
    """Columns of hexahedra, wedges, pyramids, and pyramids with tetrahedra outside, around one inner line."""
    n = np.arange(27).reshape(3, 3, 3)
    points, cells = list(np.indices((3, 3, 3)).reshape(3, -1).T.astype(float)), {}

    def add(name, *cell):
        cells.setdefault(name, []).append(cell)

    for i, j, k in np.ndindex(2, 2, 2):
        corners = elements.get("hex8").nodes.astype(int) > 0
        c = n[i + corners[:, 0], j + corners[:, 1], k + corners[:, 2]].tolist()
        if (i, j) == (0, 0):
            add("hex8", *c)
        elif (i, j) == (1, 0):
            add("wedge6", *(c[m] for m in (0, 1, 2, 4, 5, 6)))
            add("wedge6", *(c[m] for m in (0, 2, 3, 4, 6, 7)))
        else:
            points.append(np.mean([points[m] for m in c], axis=0))
            for facet in elements.get("hex8").facets:
                base = [c[m] for m in reversed(facet)]
                places = np.array([points[m] for m in base])
                outside = (places == places[0]).all(axis=0) & np.isin(places[0], (0.0, 2.0))
                if (i, j) == (1, 1) and outside.any():
                    add("tet4", base[0], base[1], base[2], len(points) - 1)
                    add("tet4", base[0], base[2], base[3], len(points) - 1)
                else:
                    add("pyramid5", *base, len(points) - 1)
    return fc.Mesh(points, cells)


MESHES = {name: lambda name=name: patch(name) for name in SOLIDS}
MESHES["mixed linear"] = lambda: distorted(mixed())
MESHES["mixed quadratic"] = lambda: distorted(fc.generate.to_quadratic(mixed()))
EVERY = [*CELLS, *(("3d", name) for name in MESHES if name not in SOLIDS)]


@pytest.fixture(params=EVERY, ids="-".join, scope="module")
def body(request):
    """Kinematics, and a mesh."""
    kinematics, name = request.param
    return kinematics, MESHES[name]() if kinematics == "3d" else plane_patch(name)


@pytest.fixture(params=MESHES, scope="module")
def any_mesh(request):
    return MESHES[request.param]()


def operators(element, corners, axisymmetric):
    """Strain operators (n_q, 3 + shears, dim n) of a cell and their weights, written out."""
    N, dN, weights = element.tables
    dim, found = element.dim, []
    measures = weights.copy()
    for q in range(len(weights)):
        J = dN[q].T @ corners
        G = dN[q] @ np.linalg.inv(J).T
        shears = [(0, 1)] if dim == 2 else [(0, 1), (1, 2), (0, 2)]
        B = np.zeros((3 + len(shears), element.n_nodes, dim))
        for i in range(dim):
            B[i, :, i] = G[:, i]
        for row, (i, j) in enumerate(shears, start=3):
            B[row, :, i], B[row, :, j] = G[:, j], G[:, i]
        measures[q] *= np.linalg.det(J)
        if axisymmetric:
            radius = N[q] @ corners[:, 0]
            B[2, :, 0] = N[q] / radius
            measures[q] *= 2 * np.pi * radius
        found.append(B.reshape(len(B), -1))
    return np.array(found), measures


def twin(mesh, kinematics="3d", D=None):
    """Stiffness assembled densely, cell by cell."""
    K, D, dim = np.zeros((mesh.points.size,) * 2), moduli(kinematics) if D is None else D, mesh.dim
    for name, block in mesh.solids.items():
        for cell in block:
            dofs = (dim * cell[:, None] + np.arange(dim)).ravel()
            B, measures = operators(elements.get(name), mesh.points[cell], kinematics == "axisymmetric")
            K[np.ix_(dofs, dofs)] += np.einsum("qia,ij,qjb,q->ab", B, D, B, measures)
    return K


def one_material(mesh):
    return {name: np.zeros(len(block), np.int32) for name, block in mesh.solids.items()}


def assembled(mesh, kinematics="3d"):
    return stiffness(mesh, kinematics, moduli(kinematics)[None], one_material(mesh))


def stress_at_points(kinematics, mesh, u):
    return fc.recovery.stress_at_points(mesh, kinematics, moduli(kinematics)[None], one_material(mesh), u)


def with_field(mesh, field):
    """A model with the displacement `field` prescribed at every outer node, and the inner nodes."""
    outer = np.unique(np.concatenate([facets.ravel() for facets in outer_facets(mesh).values()]))
    model = elastic_model(mesh.with_groups(points={f"P{p}": [p] for p in outer}), "3d", E=E, nu=NU)
    for p, (x, y, z) in zip(outer, field(mesh.points[outer])):
        model.prescribe(f"P{p}", x=x, y=y, z=z)
    return model, np.setdiff1d(np.arange(mesh.n_points), outer)


@pytest.mark.parametrize("element", SOLIDS)
def test_the_loop_names_the_first_cell_that_is_inside_out(element):
    mesh = patch(element, (2, 1, 1))
    block = mesh.cells[element].copy()
    block[1:3] = block[1:3][:, elements.get(element).reversed]
    turned = mesh.replace(cells={element: block}, cell_groups={})
    refused(fc.MeshError, f"cell 1 of {element} near .* inverted", assembled, turned)


# Exact solutions -----------------------------------------------------------------------------------------------------


def test_linear_patch_test_through_the_solver(any_mesh):
    model, inner = with_field(any_mesh, lambda x: x @ SLOPE.T + 1e-3)
    (step,) = fc.solve(model, fc.linear_ramp(1))
    assert len(inner)
    assert np.abs(step.displacement - (any_mesh.points @ SLOPE.T + 1e-3)).max() < 1e-10 * 1e-3
    assert np.abs(step.stress - D @ STRAIN).max() < 1e-10 * np.abs(D @ STRAIN).max()
    assert np.abs(step.reaction[inner]).max() == 0.0


@pytest.mark.parametrize("element", QUADRATIC)
def test_pure_bending_is_exact_with_quadratic_cells(element):
    # Sheared, not curved: cells stay affine images of the reference cell, on which quadratic fields are exact.
    mesh = box((2.0, 1.0, 1.0), (2, 2, 2), element)
    mesh = mesh.replace(points=mesh.points @ np.array([[1.0, 0.1, 0.0], [0.2, 1.0, 0.0], [0.1, 0.3, 1.0]]))
    curvature = 1e-3

    def bending(points):
        x, y, z = points.T
        return curvature * np.column_stack([x * y, -(x * x + NU * (y * y - z * z)) / 2, -NU * y * z])

    model, inner = with_field(mesh, bending)
    (step,) = fc.solve(model, fc.linear_ramp(1))
    assert np.abs(step.displacement - bending(mesh.points))[inner].max() < 1e-10 * curvature
    expected = np.zeros((mesh.n_points, 6))
    expected[:, 0] = E * curvature * mesh.points[:, 1]
    assert np.abs(step.stress - expected).max() < 1e-9 * np.abs(expected).max()


# Element loops -------------------------------------------------------------------------------------------------------


def test_stiffness_equals_its_numpy_twin(body):
    kinematics, mesh = body
    K, expected = assembled(mesh, kinematics).toarray(), twin(mesh, kinematics)
    assert np.abs(K - expected).max() < 1e-12 * np.abs(expected).max()
    assert np.array_equal(K, K.T)


def test_linear_displacements_give_the_exact_stress_everywhere(body):
    """In axisymmetry a radial stretch and one along the axis."""
    kinematics, mesh = body
    slope = np.diag([1e-3, -5e-4]) if kinematics == "axisymmetric" else SLOPE[: mesh.dim, : mesh.dim]
    plane = [slope[0, 0], slope[1, 1], slope[0, 0] * (kinematics == "axisymmetric"), slope[0, 1] + slope[1, 0]]
    expected = moduli(kinematics) @ (STRAIN if mesh.dim == 3 else plane)
    at_points = stress_at_points(kinematics, mesh, mesh.points @ slope.T)
    for values in (*at_points.values(), *fc.recovery.stress_at_element_nodes(at_points).values()):
        assert np.abs(values - expected).max() < 1e-11
    assert np.abs(fc.recovery.nodal_average(mesh, at_points) - expected).max() < 1e-11


def test_internal_forces_are_stiffness_times_displacement(body):
    kinematics, mesh = body
    u = np.random.default_rng(2).normal(size=mesh.points.shape)
    force = fc.recovery.internal_force(mesh, kinematics, stress_at_points(kinematics, mesh, u))
    assert np.abs(force.ravel() - assembled(mesh, kinematics) @ u.ravel()).max() < 1e-12 * np.abs(force).max()


@pytest.mark.parametrize("element", SOLIDS)
def test_nothing_but_rigid_body_motion_is_free(element):
    values = np.linalg.eigvalsh(assembled(patch(element, (1, 1, 1))).toarray())
    assert np.abs(values[:6]).max() < 1e-12 * values[-1]
    assert values[6] > 1e-4 * values[-1]


def test_the_sparsity_couples_exactly_the_nodes_of_common_cells():
    mesh = fc.Mesh([[0, 0], [1, 0], [1, 1], [0, 1], [9, 9]], {"tri3": [[0, 1, 2], [0, 2, 3]]})
    pattern = sparsity(mesh)
    rows = [pattern.indices[a:b].tolist() for a, b in zip(pattern.indptr[:-1], pattern.indptr[1:])]
    assert rows == [[0, 1, 2, 3], [0, 1, 2], [0, 1, 2, 3], [0, 2, 3], [4]]
    assert {pattern.indptr.dtype, pattern.indices.dtype} == {np.dtype(np.int32)}  # 64 bits would take twice the memory
    assert assembled(patch("hex8")).indices.dtype == np.int32


def test_von_mises_of_simple_states():
    assert fc.recovery.von_mises(np.array([5.0, 0, 0, 0])) == pytest.approx(5.0)
    assert fc.recovery.von_mises(np.array([-3.0, -3, -3, 0])) == pytest.approx(0.0)
    assert fc.recovery.von_mises(np.array([0.0, 0, 0, 2])) == pytest.approx(2 * np.sqrt(3))
    assert fc.recovery.von_mises(np.array([0.0, 0, 0, 0, 2, 0])) == pytest.approx(2 * np.sqrt(3))
    assert fc.recovery.von_mises_signed(np.array([[-5.0, 0, 0, 0], [5, 0, 0, 0]])) == pytest.approx([-5.0, 5.0])


# Topology ------------------------------------------------------------------------------------------------------------


def enclosed(mesh):
    """Volume inside the outer facets by the divergence theorem."""
    total = 0.0
    for name, facets in outer_facets(mesh).items():
        N, dN, weights = elements.get(name).tables
        corners = mesh.points[facets]
        a, b = np.moveaxis(np.einsum("qnk,fnd->fqkd", dN, corners), 2, 0)
        total += np.einsum("q,fqd,fqd->", weights, np.cross(a, b), np.einsum("qn,fnd->fqd", N, corners)) / 3
    return total


def test_outer_facets_enclose_the_volume_with_normals_outward(any_mesh):
    assert enclosed(any_mesh) == pytest.approx(fc.quality(any_mesh).measure, rel=1e-3)
    for facets in outer_facets(any_mesh).values():
        assert len(np.unique(np.sort(facets, axis=1), axis=0)) == len(facets)


@pytest.mark.parametrize("element", SOLIDS)
def test_corner_volumes_are_those_of_the_cells_with_straight_edges(element):
    mesh = distorted(box((2.0, 1.5, 1.2), (2, 2, 2), elements.get(element).linear))
    assert corner_measures(mesh, elements.get(element).linear).sum() == pytest.approx(enclosed(mesh), rel=1e-13)
    assert corner_measures(box((2.0, 1.5, 1.2), (2, 2, 2), element), element).sum() == pytest.approx(3.6, rel=1e-13)


# Models --------------------------------------------------------------------------------------------------------------


def test_six_rigid_motions_are_counted_and_named():
    model = elastic_model(box(divisions=(1, 1, 1)), "3d", E=E, nu=NU)
    refused(fc.ModelError, r"6 rigid-body motions .*'BOX'.*translation along z.*rotation about x", model.check)
    model.fix("XMIN", "xy")
    refused(fc.ModelError, r"1 rigid-body motion .*translation along z", model.check)
    model.fix("XMIN", "z")
    model.check()


@pytest.mark.parametrize("name", MESHES)
def test_cells_turned_inside_out_are_turned_back(name):
    mesh = MESHES[name]()
    K, cells, random, n_turned = assembled(mesh), {}, np.random.default_rng(5), 0
    for kind, block in mesh.solids.items():
        turned = random.random(len(block)) < 0.5
        turned[0] = True
        cells[kind] = np.where(turned[:, None], block[:, elements.get(kind).reversed], block)
        n_turned += turned.sum()
    inside_out = mesh.replace(cells={**mesh.cells, **cells})
    assert sum((corner_measures(inside_out, kind) < 0).sum() for kind in cells) == n_turned
    refused(fc.MeshError, r"inverted", fc.Model, inside_out, "3d")
    refused(fc.MeshError, r"cell 0 of", assembled, inside_out)
    back, count = oriented(inside_out)
    assert count == n_turned
    assert np.array_equal(assembled(back).toarray(), K.toarray())
    assert oriented(back) == (back, 0)


def test_rigid_body_motion_needs_no_force_and_gives_no_stress(body):
    kinematics, mesh = body
    K, modes = assembled(mesh, kinematics), rigid_modes(mesh.points, kinematics)
    assert np.linalg.matrix_rank(modes) == {"3d": 6, "axisymmetric": 1}.get(kinematics, 3)
    for mode in modes.T:
        assert np.abs(K @ mode).max() < 1e-10 * np.abs(K.data).max()
        at_points = stress_at_points(kinematics, mesh, mode.reshape(-1, mesh.dim))
        assert np.abs(fc.recovery.nodal_average(mesh, at_points)).max() < 1e-10 * E
