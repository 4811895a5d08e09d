"""Forces at points that a field represents in part: equations of the field, and continuous contact by multigrid."""

import numpy as np
import pytest
from models import elastic_model, with_obstacle
from pairwise import first_of
from pressed_blocks import assert_agree, box, pressed
from scipy.sparse import csr_array

import fastcontact as fc
from fastcontact.contact.multiplier_field import Projection
from fastcontact.linear import choice
from fastcontact.linear.field_compliance import FieldCompliance
from fastcontact.linear.solvers.amg import Amg

RHO = 2.0


def along_a_line(m=10, per_node=3, seed=0):
    """Return the projection of points along a line upon a field of m values."""
    from scipy.sparse.linalg import splu

    rng = np.random.default_rng(seed)
    at = np.sort(rng.random(per_node * (m - 1))) * (m - 1)
    left = np.minimum(at.astype(int), m - 2)
    P = np.zeros((len(at), m))
    P[np.arange(len(at)), left], P[np.arange(len(at)), left + 1] = 1 - (at - left), at - left
    areas = 0.1 + 0.1 * rng.random(len(at))
    mass = splu(csr_array(P.T @ (areas[:, None] * P)).tocsc())
    return Projection(csr_array(P), areas, RHO, mass)


def rows_at_points(projection, fixed, seed=1):
    """Return rows (m, n): values of a field of displacements, each with an unknown of its own, at the points."""
    rng, nodes = np.random.default_rng(seed), np.zeros((projection.P.shape[1], len(fixed)))
    free = rng.permutation(np.flatnonzero(~fixed))
    for i, row in enumerate(nodes):
        row[free[i]] = 1.0
        row[free[len(nodes) + rng.permutation(8)[:3]]] = -rng.random(3)
    m = projection.P.shape[0]
    return csr_array(projection.P @ nodes), rng.normal(size=m)


@pytest.mark.parametrize(
    ("closed", "soft"), first_of(3, [("all", False), ("some", False), ("some", True), ("few", False), ("one", False)])
)
def test_the_equations_of_the_field_are_those_of_the_points(closed, soft):
    """Also where points are softer by compliances of their own."""
    projection = along_a_line()
    m = projection.P.shape[0]
    rows = {"all": np.arange(m), "some": np.arange(5, 20), "few": np.array([3, 12, 13]), "one": np.array([7])}[closed]
    K, modes, B, c, f = loaded(projection, rows)
    among, C = projection.block_operator(rows), projection.block(rows)
    if soft:
        softness = np.random.default_rng(6).random(len(rows)) * np.logspace(-4, 2, len(rows))
        C = np.diag(softness) + C
        among = among.softened(softness, lambda: C)
    whole = np.block([[K.toarray(), -B.toarray().T], [B.toarray(), C]])
    expected = np.linalg.lstsq(whole, np.concatenate([f, c]), rcond=None)[0]
    solver = Amg(1e-11)
    solver.prepare(K, modes)
    assert isinstance(among, FieldCompliance)
    u, forces = solver.load(f).solve(B, c, among)
    assert not solver.columns.requests
    for found, exact in ((u, expected[: len(f)]), (forces, expected[len(f) :])):
        assert found == pytest.approx(exact, abs=1e-8 * np.abs(found).max())
    # As factors and columns take it.
    direct = choice.make("direct", dim=3, n_dofs=len(f))
    direct.prepare(K, modes)
    assert direct.load(f).solve(B, c, among)[1] == pytest.approx(forces, abs=1e-8 * np.abs(forces).max())


def test_points_beside_equations_that_do_not_give_way():
    projection, m = along_a_line(), 27
    both = FieldCompliance.stacked(
        [projection.block_operator(np.arange(4, 20)), FieldCompliance.none(2)], lambda: dense
    )
    dense = np.zeros((18, 18))
    dense[:16, :16] = projection.block(np.arange(4, 20))
    K, modes, fixed = box()
    assert projection.P.shape[0] == m
    B, c = rows_at_points(projection, fixed)
    other = np.zeros((2, len(fixed)))
    other[[0, 1], np.flatnonzero(~fixed)[[100, 200]]] = 1.0
    B, c = csr_array(np.vstack([B[4:20].toarray(), other])), np.r_[c[4:20], 0.1, -0.2]
    f = np.where(fixed, 0.0, 1.0)
    solver = Amg(1e-11)
    solver.prepare(K, modes)
    u, forces = solver.load(f).solve(B, c, both)
    assert np.abs(B @ u + dense @ forces - c).max() < 1e-8 * np.abs(c).max()
    assert np.abs(K @ u - f - B.T @ forces).max() < 1e-8 * np.abs(forces).max()


def continuous(curvature=0.0, **options):
    return pressed(curvature=curvature, formulation="continuous", **options)


def on_obstacle(obstacle, element="hex8"):
    divisions = (8, 8, 4) if element == "hex8" else (4, 4, 2)
    mesh = fc.generate.box((1.0, 1.0, 0.5), divisions, element)
    model = elastic_model(mesh, "3d", E=1.0, ZMAX={"x": 0.0, "y": 0.0, "z": -0.01})
    return with_obstacle(model, "c", "ZMIN", obstacle, formulation="continuous")


def loaded(projection, rows):
    """Return stiffness and modes of a box, those rows of a field with their right-hand side, and a load."""
    K, modes, fixed = box()
    B, c = rows_at_points(projection, fixed)
    return K, modes, csr_array(B[rows]), c[rows], np.where(fixed, 0.0, np.random.default_rng(5).normal(size=len(fixed)))


def beside_another(**options):
    """A pair of points beside one of nodes with `options`."""
    model = continuous(0.02)
    wall = fc.obstacles.HalfSpace((1.001, 0.0, 0.0), (-1.0, 0.0, 0.0))
    return with_obstacle(model, "wall", "U_XMAX", wall, formulation="node_to_segment", **options)


def quadratic(element, curvature=0.0, **options):
    return pressed(element, curvature=curvature, n=5, formulation="continuous", **options)


WALL = fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
CASES = {
    "all closed": (continuous, 30), "edge": (lambda: continuous(0.02), 90), "few": (lambda: continuous(0.2), 80),
    "stiff primary": (lambda: continuous(0.02, ratio=100.0), 150), "tet4": (lambda: continuous(0.02, element="tet4"), 200),
    "augmented": (lambda: continuous(0.02, augmentation=10.0), 300), "two pairs": (beside_another, 200),
    "penalty": (lambda: continuous(penalty=1.0), 40), "stiff penalty": (lambda: continuous(0.02, penalty=1000.0), 90),
    "soft penalty": (lambda: continuous(0.02, penalty=0.1), 40), "penalty beside": (lambda: beside_another(penalty=2.0), 200),
    "wall": (lambda: on_obstacle(WALL), 30),
    "hex27": (lambda: quadratic("hex27"), 60), "tet10": (lambda: quadratic("tet10"), 60),
    "hex20": (lambda: quadratic("hex20"), 110), "hex20, curved": (lambda: quadratic("hex20", 0.02), 110),
    "hex20, penalty": (lambda: quadratic("hex20", 0.02, penalty=100.0), 100),
    "tet10, curved": (lambda: quadratic("tet10", 0.02), 80),
    "hex20 on a wall": (lambda: on_obstacle(WALL, "hex20"), 110),
    "tet10 on a wall": (lambda: on_obstacle(WALL, "tet10"), 80),
    "ball": (lambda: on_obstacle(fc.obstacles.Sphere((0.5, 0.5, -1.0), 1.0)), 100),
}  # fmt: skip


# As others, but for one more option.
LONG = (
    "few", "soft penalty", "penalty beside", "tet10", "hex20", "hex20, penalty", "hex20 on a wall", "tet10, curved",
    "tet10 on a wall", "stiff penalty",
)  # fmt: skip


@pytest.mark.parametrize("case", [pytest.param(c, marks=pytest.mark.slow) if c in LONG else c for c in CASES])
def test_continuous_contact_costs_multigrid_no_columns(case):
    make, most = CASES[case]
    assert_agree(make(), most, within=1e-7)
