"""Results do not depend on the linear solver: multigrid compared with the direct solver.

Every element, formulation and dimension, rigid obstacles too, with and without friction and penalty, either side secondary.
The default run takes each element with two formulations, with friction and without, in space with one, in turn with friction,
a penalty, or swapped; on obstacles every second element. The whole table is slow.
"""

from itertools import product

import numpy as np
import pytest
from mechanics import contact_forces, given_back, in_space, out_of_balance
from models import elastic_model, united, with_contact, with_obstacle

import fastcontact as fc
from fastcontact.mesh.generate.box import SOLIDS

# What multigrid leaves to factors is told, and is no other result.
pytestmark = [
    pytest.mark.pairwise,
    pytest.mark.filterwarnings(
        "ignore:.*deviate from their arcs", "ignore:.*raise its penalty", "ignore:multigrid gave up"
    ),
]
FORMULATIONS = {
    "node_to_segment": {"formulation": "node_to_segment"},
    "continuous": {"formulation": "continuous"},
    "dual": {"formulation": "mortar", "multipliers": "dual"},
    "standard": {"formulation": "mortar", "multipliers": "standard"},
}
FACES = ("tri3", "tri6", "quad4", "quad8", "quad9")
# Facets whose corner nodes carry no pressure, which node-to-segment refuses, on the cells that have them.
NO_CORNERS = {"hex20": "quad8", "pyramid13": "quad8", "tet10": "tri6", "wedge15": "tri6", "wedge18": "tri6"}
FRICTION, PENALTY = 0.3, 1e5
SAME = 1e-7  # of the largest; multigrid stops at residuals of 1e-10


def cells(kinematics, elements, every=1):
    """Return (kinematics, element, formulation, friction, penalty, swapped); what the default run leaves out is slow.

    It takes one in `every` of the formulations of each element, in turn.
    """
    table = []
    for (i, element), (j, formulation), (k, friction) in product(
        enumerate(elements), enumerate(FORMULATIONS), enumerate((0.0, FRICTION))
    ):
        for penalty, swapped in product((None, PENALTY), (False, True)):
            taken = (i + j) % every == 0 == (i + j + k + (penalty is not None) + 2 * swapped) % 4
            taken = taken and (every < 4 or k == i % 2)
            marks = () if taken else pytest.mark.slow
            cell = (kinematics, element, formulation, friction, penalty, swapped)
            name = "-".join([kinematics, element, formulation, "friction" * bool(friction), "penalty" * bool(penalty)])
            table.append(pytest.param(*cell, marks=marks, id=name + "-swapped" * swapped))
    return table


def bodies(kinematics, element, alone):
    """Return two blocks whose meshes do not match, the upper one a little round below and perhaps alone; and their sides."""
    below, _, above = element.partition("+")
    if kinematics == "3d":
        lower = fc.generate.box((1.4, 1.2, 0.5), (3, 3, 1), below, (-0.67, -0.58, -0.5), name="LOWER")
        upper = fc.generate.box((1.0, 1.0, 0.5), (2, 2, 1), above or below, (-0.5, -0.5, 0.0), name="UPPER")
        sides = ("LOWER_ZMIN", "LOWER_ZMAX", "UPPER_ZMIN", "UPPER_ZMAX")
    else:
        lower = fc.generate.block((1.4, 0.5), (5, 2), element, (0.0, -0.5), name="LOWER")
        upper = fc.generate.block((1.0, 0.5), (4, 2), element, (0.0, 0.0), name="UPPER")
        sides = ("LOWER_BOTTOM", "LOWER_TOP", "UPPER_BOTTOM", "UPPER_TOP")
    points = np.array(upper.points)
    points[:, -1] += 0.02 * (points[:, :-1] ** 2).sum(axis=1)
    upper = upper.replace(points=points)
    return united(UPPER_=upper) if alone else united(LOWER_=lower, UPPER_=upper), sides


def model(kinematics, element, formulation, friction, penalty, swapped=False, obstacle=False):
    """The upper block pressed on the lower one and pushed along it, or on a plane in the place of the lower one."""
    mesh, (bottom, lower, upper, top) = bodies(kinematics, element, alone=obstacle)
    described = elastic_model(mesh, kinematics)
    along = {"3d": {"x": 0.012, "y": 0.003}, "plane_strain": {"x": 0.012}, "axisymmetric": {}}[kinematics]
    described.prescribe(top, **along, **{"xyz"[mesh.dim - 1]: -0.013})
    for name in ("UPPER",) if obstacle else ("LOWER", "UPPER"):
        if kinematics == "axisymmetric":
            described.fix(f"{name}_LEFT", "x")
    options = FORMULATIONS[formulation] | {"friction": friction} | ({"penalty": penalty} if penalty else {})
    if obstacle:
        plane = fc.obstacles.HalfSpace(point=(0.0,) * mesh.dim, normal=(0.0,) * (mesh.dim - 1) + (1.0,))
        return with_obstacle(described, "pair", upper, plane, **options)
    described.fix(bottom, "xyz"[: mesh.dim])
    secondary, primary = (lower, upper) if swapped else (upper, lower)
    return with_contact(described, "pair", secondary, primary, **options)


def solved(described, solver, friction=0.0):
    """Friction depends on the path: two steps."""
    return fc.solve(described, fc.linear_ramp(2 if friction else 1), linear_solver=solver)[-1]


def check_same(one, other):
    """Forces, displacements, stresses and states of two results agree."""
    ours, theirs = one.contact["pair"], other.contact["pair"]
    assert ours.active.any()
    of_pairs = ("force_vectors", "primary_force_vectors", "pressure", "shear")
    told = [(one, other, name) for name in ("displacement", "stress", "reaction")] + [
        (ours, theirs, n) for n in of_pairs
    ]
    for here, there, name in told:
        a, b = getattr(here, name), getattr(there, name)
        size = np.abs(ours.pressure).max() if name == "shear" else np.abs(a).max(initial=0.0)
        assert np.abs(a - b).max(initial=0.0) <= SAME * size, name
    assert (ours.active == theirs.active).all()
    assert (ours.sticking == theirs.sticking).all()


def check_mechanics(described, step, friction, obstacle=False):
    """Every node is in balance, the whole in force and moment, both sides against each other; friction is in its cone."""
    balance, sizes = out_of_balance(described, step, 1.0, 1e-10)
    assert balance < 1e-7
    contact = step.contact["pair"]
    if not obstacle:
        forces, moments = given_back(described, step, sizes, "pair")
        assert forces < 1e-8
        # What a penalty lets penetrate stands apart.
        assert moments < 1e-8 + np.abs(contact.gap[contact.active]).max(initial=0.0)
    outer = step.reaction + contact_forces(step)  # those of both sides balance each other
    size = np.abs(step.reaction).sum()
    if described.kinematics == "axisymmetric":
        assert abs(outer[:, 1].sum()) < 1e-8 * size
    else:
        places, forces = in_space(described.mesh.points), in_space(outer)
        assert np.abs(forces.sum(axis=0)).max() < 1e-8 * size
        assert np.abs(np.cross(places, forces).sum(axis=0)).max() < 1e-8 * size
    if contact.formulation == "node_to_segment":
        normal = np.einsum("nd,nd->n", contact.force_vectors, contact.normal)
        tangential = np.linalg.norm(contact.force_vectors - normal[:, None] * contact.normal, axis=1)
        assert (tangential <= friction * np.abs(normal) + 1e-6 * np.abs(normal).max()).all()


def refusal(element, formulation, swapped):
    """Return what node-to-segment says where facets have corners that carry nothing; None where it does not."""
    below, _, above = element.partition("+")
    kind = NO_CORNERS.get(below if swapped else above or below)
    return kind if formulation == "node_to_segment" else None


def compare(cell, obstacle=False):
    kind = refusal(cell[1], cell[2], cell[5]) if cell[0] == "3d" else None
    if kind:
        for solver in ("direct", "amg", "auto"):
            with pytest.raises(fc.ContactError, match=f"facets of {kind} .* use formulation 'continuous' or 'mortar'"):
                solved(model(*cell, obstacle=obstacle), solver)
        return
    described = model(*cell, obstacle=obstacle)
    one, other = (solved(described, solver, cell[3]) for solver in ("direct", "amg"))
    check_same(one, other)
    check_mechanics(described, one, cell[3], obstacle)
    check_mechanics(described, other, cell[3], obstacle)


WHOLE = ("kinematics", "element", "formulation", "friction", "penalty", "swapped")


@pytest.mark.parametrize(WHOLE, cells("3d", (*SOLIDS, "hex8+tet10", "wedge6+hex20"), every=4))
def test_multigrid_gives_what_factors_give_in_space(kinematics, element, formulation, friction, penalty, swapped):
    compare((kinematics, element, formulation, friction, penalty, swapped))


@pytest.mark.parametrize(WHOLE, cells("plane_strain", FACES, every=2) + cells("axisymmetric", FACES, every=2))
def test_multigrid_gives_what_factors_give_in_a_plane(kinematics, element, formulation, friction, penalty, swapped):
    compare((kinematics, element, formulation, friction, penalty, swapped))


ON_OBSTACLES = [  # by default every second element with friction, formulations in turn
    pytest.param(
        k,
        e,
        formulation,
        friction,
        penalty,
        marks=() if friction and not penalty and (i + j) % 3 == 0 == i % 2 else pytest.mark.slow,
    )
    for i, (k, e) in enumerate([*product(("plane_strain", "axisymmetric"), FACES), *product(("3d",), SOLIDS)])
    for j, formulation in enumerate(("node_to_segment", "continuous", "dual"))
    for friction, penalty in product((0.0, FRICTION), (None, PENALTY))
]


@pytest.mark.parametrize(WHOLE[:5], ON_OBSTACLES)
def test_multigrid_gives_what_factors_give_on_obstacles(kinematics, element, formulation, friction, penalty):
    compare((kinematics, element, formulation, friction, penalty, False), obstacle=True)
