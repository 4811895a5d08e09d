"""Two pairs must not join the same facets, in either role."""

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc
from fastcontact.mesh.generate import block, block_on_block
from fastcontact.model.model_warnings import model_warnings


def parts(mesh, group):
    """The mesh with the facets of a group, from left to right, in halves and in an overlapping part of them."""
    facets = mesh.cell_groups[group]
    centres = np.concatenate([mesh.points[f][:, :2].mean(axis=1) for f in mesh.cells_of(group).values()])
    facets = facets[np.argsort(centres[:, 0])]
    half, third = len(facets) // 2, len(facets) // 3
    return mesh.with_groups(
        cells={f"{group}_LEFT": facets[:half], f"{group}_RIGHT": facets[half:], f"{group}_OVER": facets[third:]}
    )


@pytest.fixture
def mesh():
    return parts(parts(block_on_block(), "CONT_UPPER"), "CONT_LOWER")


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (("CONT_UPPER", "CONT_LOWER"), ("CONT_UPPER_LEFT", "CONT_LOWER")),
        (("CONT_UPPER_LEFT", "CONT_LOWER"), ("CONT_UPPER", "CONT_LOWER")),
        (("CONT_UPPER_LEFT", "CONT_LOWER"), ("CONT_UPPER_OVER", "CONT_LOWER")),
        (("CONT_UPPER", "CONT_LOWER_LEFT"), ("CONT_UPPER", "CONT_LOWER_OVER")),
        (("CONT_UPPER", "CONT_LOWER"), ("CONT_LOWER_LEFT", "CONT_UPPER")),
        (("CONT_UPPER_LEFT", "CONT_LOWER"), ("CONT_LOWER", "CONT_UPPER_OVER")),
        (("CONT_UPPER_OVER", "CONT_LOWER_LEFT"), ("CONT_LOWER_OVER", "CONT_UPPER_LEFT")),
    ],
)
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_facets_of_an_earlier_pair_are_refused(mesh, first, second, formulation):
    model = elastic_model(mesh)
    model.add_contact("first", secondary=first[0], primary=first[1], formulation=formulation)
    with pytest.raises(
        fc.ContactError, match=r"contact 'second' joins .* that contact 'first' joins already: .*point \d+"
    ):
        model.add_contact("second", secondary=second[0], primary=second[1], formulation=formulation)
    assert len(model.contact) == 1


@pytest.mark.parametrize("swapped", [False, True])
def test_both_groups_are_the_same(mesh, swapped):
    model = elastic_model(mesh)
    sides = ("CONT_UPPER", "CONT_LOWER")
    model.add_contact("first", secondary=sides[0], primary=sides[1])
    with pytest.raises(fc.ContactError, match="which contact 'first' joins already"):
        model.add_contact("second", secondary=sides[swapped], primary=sides[not swapped])


def test_facets_that_stand_in_the_mesh_twice_are_the_same(mesh):
    """Mesh generators write a facet once for each group that holds it."""
    again = {name: np.concatenate([b, mesh.cells_of("CONT_UPPER").get(name, b[:0])]) for name, b in mesh.cells.items()}
    before = sum(map(len, mesh.cells.values()))
    assert list(mesh.cells)[-1] == "line2"
    copied = mesh.replace(cells=again)
    copied = copied.with_groups(cells={"COPY": range(before, before + len(mesh.cell_groups["CONT_UPPER"]))})
    model = elastic_model(copied)
    model.add_contact("first", secondary="CONT_UPPER", primary="CONT_LOWER")
    with pytest.raises(fc.ContactError, match="contact 'second' joins"):
        model.add_contact("second", secondary="COPY", primary="CONT_LOWER")


def test_one_side_may_meet_two_others(mesh):
    model = elastic_model(mesh)
    model.add_contact("left", secondary="CONT_UPPER", primary="CONT_LOWER_LEFT")
    model.add_contact("right", secondary="CONT_UPPER", primary="CONT_LOWER_RIGHT")
    assert len(model.contact) == 2


def pressed_in_a_corner():
    model = elastic_model(block((1.0, 1.0), (2, 2)))
    floor = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor)
    return model


def test_one_side_may_meet_two_obstacles():
    model = pressed_in_a_corner()
    model.add_obstacle("slope", secondary="BOTTOM", obstacle=fc.obstacles.HalfSpace((0.0, 0.0), (0.5, 1.0)))
    model.add_obstacle("moving", secondary="BOTTOM", obstacle=model.contact[0].obstacle, motion={"y": 0.1})
    assert len(model.contact) == 3


def test_an_obstacle_and_a_pair_may_share_facets(mesh):
    model = elastic_model(mesh)
    model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER")
    model.add_obstacle("floor", secondary="CONT_UPPER", obstacle=fc.obstacles.HalfSpace((0.0, -5.0), (0.0, 1.0)))
    assert len(model.contact) == 2


def test_a_facet_that_stands_in_a_group_twice_is_loaded_once(mesh):
    line2 = mesh.cells["line2"]
    copied = mesh.replace(cells={**mesh.cells, "line2": np.vstack([line2, line2[:, ::-1]])})
    top = copied.cell_groups["UPPER_TOP"]
    copied = copied.with_groups(cells={"TWICE": np.concatenate([top, top + len(line2)])})
    model = elastic_model(copied)
    model.add_pressure("TWICE", 2.0)
    model.add_traction("TWICE", x=3.0)
    model.add_force("TWICE", y=5.0)
    width = np.ptp(copied.points[copied.points_of("UPPER_TOP"), 0])
    assert model.forces_by_ramp()[None].sum(axis=0) == pytest.approx([3.0 * width, 5.0 - 2.0 * width])


def test_a_load_that_supports_take_up_is_told(mesh):
    def lost(**force):
        model = elastic_model(mesh, UPPER_TOP="y", UPPER_LEFT="x", LOWER_BOTTOM="xy")
        model.add_force("UPPER_TOP", **force)
        return [text for text in model_warnings(model, fc.linear_ramp(1)) if "the supports carry all of it" in text]

    assert len(lost(y=1.0)) == 1
    assert not lost(x=1.0)
    assert not lost(x=1e-3, y=1.0)
    assert not lost(y=0.0)


def split(mesh, formulation, first, second, **options):
    model = elastic_model(mesh)
    model.add_contact("first", secondary=first[0], primary=first[1], formulation=formulation)
    model.add_contact("second", secondary=second[0], primary=second[1], formulation=formulation, **options)
    return [text for text in model_warnings(model, fc.linear_ramp(1)) if "continue each other" in text]


@pytest.mark.parametrize("formulation", ["continuous", "mortar"])
@pytest.mark.parametrize(
    ("first", "second"),
    [
        (("CONT_UPPER_LEFT", "CONT_LOWER"), ("CONT_UPPER_RIGHT", "CONT_LOWER")),
        (("CONT_UPPER", "CONT_LOWER_LEFT"), ("CONT_UPPER", "CONT_LOWER_RIGHT")),
        (("CONT_UPPER_LEFT", "CONT_LOWER_LEFT"), ("CONT_UPPER_RIGHT", "CONT_LOWER_RIGHT")),
        (("CONT_UPPER_LEFT", "CONT_LOWER_LEFT"), ("CONT_LOWER_RIGHT", "CONT_UPPER_RIGHT")),
    ],
)
def test_sides_that_are_split_give_a_warning(mesh, first, second, formulation):
    (text,) = split(mesh, formulation, first, second)
    assert text.startswith("contacts 'first' and 'second' continue each other at ")


def test_splitting_does_no_harm_where_nodes_carry_forces(mesh):
    sides = ("CONT_UPPER_LEFT", "CONT_LOWER"), ("CONT_UPPER_RIGHT", "CONT_LOWER")
    assert not split(mesh, "node_to_segment", *sides)
    assert split(mesh, "mortar", *sides)
    both = ("CONT_UPPER_LEFT", "CONT_LOWER_LEFT"), ("CONT_UPPER_RIGHT", "CONT_LOWER_RIGHT")
    assert split(mesh, "node_to_segment", *both)


@pytest.mark.parametrize("formulation", ["node_to_segment", "mortar"])
def test_one_pair_of_both_halves_has_the_pressure_of_the_press(mesh, formulation):
    """What the warning advises is right, and what is silent is right, too."""
    model = elastic_model(mesh, LOWER_BOTTOM="y", LOWER_LEFT="x", UPPER_LEFT="x")
    model.add_pressure("UPPER_TOP", 1.0)
    if formulation == "mortar":
        model.add_contact("all", secondary="CONT_UPPER", primary="CONT_LOWER", formulation=formulation)
    else:
        matching = parts(
            parts(block_on_block(divisions_lower=(6, 2), divisions_upper=(6, 2)), "CONT_UPPER"), "CONT_LOWER"
        )
        model = elastic_model(matching, LOWER_BOTTOM="y", LOWER_LEFT="x", UPPER_LEFT="x")
        model.add_pressure("UPPER_TOP", 1.0)
        for half in ("LEFT", "RIGHT"):
            side = f"CONT_UPPER_{half}"
            model.add_contact(half, secondary=side, primary="CONT_LOWER", formulation=formulation)
    (step,) = fc.solve(model, fc.linear_ramp(1))
    for contact in step.contact.values():
        assert contact.pressure == pytest.approx(np.ones(len(contact.points)), rel=1e-6)


@pytest.mark.each_value
@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize("friction", [None, 0.3])
@pytest.mark.parametrize("swapped", [False, True])
def test_pairs_share_the_force_of_a_common_node_by_area(solver, friction, swapped):
    """Their conditions there are the same, and leave the split of the force open; facets grow along the side."""
    even = block_on_block(divisions_lower=(6, 2), divisions_upper=(6, 2))
    points = even.points.copy()
    points[:, 0] = points[:, 0] ** 2 / points[:, 0].max()
    mesh = parts(parts(fc.Mesh(points, even.cells, even.cell_groups, even.point_groups), "CONT_UPPER"), "CONT_LOWER")
    model = elastic_model(mesh, LOWER_BOTTOM="y", LOWER_LEFT="x", UPPER_LEFT="x")
    model.add_pressure("UPPER_TOP", 1.0)
    for half in ("RIGHT", "LEFT") if swapped else ("LEFT", "RIGHT"):
        options = {} if friction is None else {"friction": friction}
        model.add_contact(
            half, secondary=f"CONT_UPPER_{half}", primary="CONT_LOWER", formulation="node_to_segment", **options
        )
    (step,) = fc.solve(model, fc.linear_ramp(1), linear_solver=solver, linear_tolerance=1e-12)
    for half, contact in step.contact.items():
        assert contact.pressure == pytest.approx(np.ones(len(contact.points)), rel=1e-6)
        width = np.ptp(mesh.points[mesh.points_of(f"CONT_UPPER_{half}"), 0])
        assert contact.force[1] == pytest.approx(width, rel=1e-6)
        assert contact.active.all()


def test_sides_that_meet_in_a_corner_are_silent():
    """A block in the corner of an angle touches it with two faces that have one node in common on both bodies."""
    points = [[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3], [0, 1], [1, 0], [1.5, 1.5], [3, 1.5], [3, 3], [1.5, 3]]
    angle = [[0, 7, 3, 6], [7, 1, 2, 3], [6, 3, 4, 5]]
    mesh = fc.Mesh(
        points, {"quad4": [*angle, [8, 9, 10, 11]], "line2": [[2, 3], [3, 4], [8, 9], [11, 8]]},
        cell_groups={"FLOOR": [4], "WALL": [5], "LOW": [6], "LEFT": [7]},
    )  # fmt: skip
    assert not split(mesh, "mortar", ("LOW", "FLOOR"), ("LEFT", "WALL"))
