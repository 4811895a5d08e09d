"""Memory and time of decks: at most 20 bytes per byte, and time proportional to their size."""

import sys
import tracemalloc

import numpy as np
import pytest
from deck_text import MATERIAL, NODES, SUPPORTS, deck_of

import fastcontact as fc


def block(cells):
    """A cube of cells**3 hexahedra with sets that list all their members."""
    p = cells + 1
    grid = np.arange(1, p**3 + 1).reshape(p, p, p)
    corners = [(0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0), (1, 0, 0), (1, 0, 1), (1, 1, 1), (1, 1, 0)]
    of_cells = np.stack([grid[k : k + cells, j : j + cells, i : i + cells].ravel() for k, j, i in corners], axis=1)
    where = np.stack(np.meshgrid(*[np.arange(p) / cells] * 3, indexing="ij"), axis=-1)[..., ::-1].reshape(-1, 3)
    lines = ["*Node, nset=nall", *(f"{n}, {x:.9f}, {y:.9f}, {z:.9f}" for n, (x, y, z) in enumerate(where, 1))]
    lines += ["*Element, type=C3D8, elset=all"]
    lines += [f"{n}, {', '.join(map(str, row))}" for n, row in enumerate(of_cells.tolist(), 1)]
    for kind, count in (("n", p**3), ("el", cells**3)):
        lines.append(f"*{kind}set, {kind}set=listed")
        lines += [", ".join(map(str, range(k, min(k + 16, count + 1)))) for k in range(1, count + 1, 16)]
    lines += ["*Surface, name=outside", "all,", "*Material, name=s", "*Elastic", "1000., 0.3"]
    lines += ["*Solid section, elset=all, material=s", "*Boundary", f"listed, 3\n1, 1, 2\n{p}, 2", "*Step", "*Static"]
    return "\n".join(lines) + "\n*Dsload\noutside, P, 1.\n*End step\n"


def numbered(cells):
    """Nodes of a block of so many cells along each edge."""
    return range(1, (cells + 1) ** 3 + 1)


def motions(cells):
    """Displacements of their own along every axis."""
    return "\n".join(f"{k}, {axis}, {axis}, {1e-6 * k * axis:.6g}" for k in numbered(cells) for axis in (1, 2, 3))


# What every node may have a line of its own for: a part of the deck and what stands in its place.
LINES = {
    "sets": ("", None),
    "forces": ("*Dsload\noutside, P, 1.", lambda n: "*Cload\n" + "\n".join(f"{k}, 3, {k}." for k in numbered(n))),
    "same forces": ("*Dsload\noutside, P, 1.", lambda n: "*Cload\n" + "\n".join(f"{k}, 3, 1." for k in numbered(n))),
    "displacements": ("*Dsload\noutside, P, 1.", lambda n: "*Boundary\n" + motions(n)),
    "body forces": (
        "*Dsload\noutside, P, 1.",
        lambda n: "*Dload\n" + "\n".join(f"{k}, BX, {k}." for k in range(1, n**3 + 1)),
    ),
    "members": ("*Step\n", lambda n: "*Nset, nset=singly\n" + "\n".join(map(str, numbered(n))) + "\n*Step\n"),
}


def check_size(folder, small, text, count):
    """Bytes at the peak of reading a deck with so many cells."""
    deck_of(folder, small)  # imports
    tracemalloc.start()
    deck = deck_of(folder, text)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(deck.model.mesh.cells["hex8"]) == count
    assert peak < 20 * len(text), f"{peak / len(text):.1f} bytes a byte"


@pytest.mark.parametrize(
    "kind", [pytest.param(k, marks=() if k in ("displacements", "body forces") else pytest.mark.slow) for k in LINES]
)
def test_twenty_bytes_a_byte(kind, tmp_path):
    old, new = LINES[kind]
    small, large = (block(n).replace(old, new(n)) if old else block(n) for n in (1, 16))
    check_size(tmp_path, small, large, 16**3)


@pytest.mark.slow
@pytest.mark.parametrize(
    "load",
    [
        "*Cload\n{node}, 3, {cube}.",
        *(pytest.param(f"*Dload\n{{cube}}, P2, {size}.", marks=pytest.mark.slow) for size in ("{cube}", "1")),
    ],
)
def test_twenty_bytes_a_byte_of_lone_cubes(load, tmp_path):
    small, large = (many_forces(n, *load.split("\n")) for n in (2, 1400))
    check_size(tmp_path, small, large, 1400)


def test_a_member_that_is_missing_is_told_by_its_line(tmp_path):
    text = block(1).replace("*Step", "*Nset, nset=singly\n1\n2, 3\n77, 4\n5\n*Step")
    line = text.splitlines().index("77, 4") + 1
    with pytest.raises(fc.CaseError, match=f"line {line}, .NSET: node 77 is not defined"):
        deck_of(tmp_path, text)


def calls(folder, text):
    """Calls of Python functions that reading a deck takes."""
    count = 0

    def counted(frame, event, argument):
        nonlocal count
        count += event == "call"

    before = sys.getprofile()
    sys.setprofile(counted)
    try:
        deck_of(folder, text)
    finally:
        sys.setprofile(before)
    return count


def many_steps(number):
    steps = "".join(f"*Step\n*Static\n*Dsload\nroof, P, {k % 7}.\n*End Step\n" for k in range(number))
    return NODES + MATERIAL + "*Mpc\nTIE, 11, 5\nTIE, 12, 6\nTIE, 13, 7\nTIE, 14, 8\n" + SUPPORTS + steps


def many_forces(number, keyword="*Cload", load="{node}, 3, {cube}."):
    """Single cubes, all held, each with a load of its own: by default as many nodes with a force."""
    nodes, cells, forces = [], [], []
    for k in range(number):
        first = 8 * k + 1
        nodes += [f"{first + n}, {2 * k + x}., {y}., {z}." for n, (x, y, z) in enumerate(CORNERS)]
        cells.append(f"{k + 1}, " + ", ".join(str(first + n) for n in range(8)))
        forces += [load.format(node=first + 4, cube=k + 1)]
    text = "*Node, nset=nall\n" + "\n".join(nodes) + "\n*Element, type=C3D8, elset=all\n" + "\n".join(cells)
    text += "\n*Material, name=s\n*Elastic\n1000., 0.\n*Solid section, elset=all, material=s\n*Boundary\n"
    text += "".join(f"{8 * k + n}, 1, 3\n" for k in range(number) for n in (1, 2, 3, 4))
    return f"{text}*Step\n*Static\n{keyword}\n" + "\n".join(forces) + "\n*End step\n"


CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]


@pytest.mark.parametrize("text", [many_steps, many_forces])
def test_time_grows_as_the_deck(text, tmp_path):
    small, large = calls(tmp_path, text(100)), calls(tmp_path, text(400))
    assert large < 4.4 * small


def test_forces_and_displacements_of_their_own(tmp_path):
    """Nodes with forces and displacements that differ have those: two cubes on each other, coincident points included."""
    deck = deck_of(tmp_path, many_forces(3).replace("*Cload\n", "*Boundary\n3, 1, 1, 0.001\n4, 1, 1, 0.002\n*Cload\n"))
    (step,) = deck.solve()
    for k in range(3):
        held = [deck.point(8 * k + n) for n in (1, 2, 3, 4)]
        assert step.reaction[held, 2].sum() == pytest.approx(-(k + 1.0))
    assert step.displacement[[deck.point(3), deck.point(4)], 0] == pytest.approx([0.001, 0.002], abs=1e-18)
    assert isinstance(deck, fc.Deck)


TURNED = "*Transform, nset=seven\n1., 1., 0., -1., 1., 0.\n"
TOP = "*Surface, name=top\n2, S2\n"
# Loads of three cubes on each other's side, and what they add up to along x, or y.
ADDED = {
    "of elements and a set": ("*Dload\n1, GRAV, 2., 1., 0., 0.\nall, BX, 2.\n", 0, (22.0, 2.0, 2.0)),
    "gravity": ("*Dload\n1, GRAV, 2., 3., 0., 0.\n2, GRAV, 6., 1., 0., 0.\n", 0, (20.0, 60.0, 0.0)),
    "centrifugal": ("*Dload\n" + "".join(f"{k}, CENTRIF, {k / 100}, 0., 0., 0., 0., 0., 1.\n" for k in (1, 2, 3)), 0,
                    (0.05, 0.5, 1.35)),
    "on faces": ("*Dload\n1, P2, 2.\n2, P2, 3.\n3, P2, 5.\n*Dsload\ntop, P, 1.\n", 2, (-2.0, -4.0, -5.0)),
    "along local axes": ("*Cload\n7, 1, 1.\n7, 2, 1.\n", 1, (2.0**0.5, 0.0, 0.0)),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:hex8 cells are too stiff")
@pytest.mark.parametrize("kind", ADDED)
def test_loads_on_the_same_add_up(kind, tmp_path):
    lines, axis, expected = ADDED[kind]
    head, _, _ = many_forces(3).partition("*Cload\n")
    head = head.replace("*Elastic", "*Density\n10.\n*Elastic").replace(
        "*Step", f"*Nset, nset=seven\n7\n{TURNED}{TOP}*Step"
    )
    deck = deck_of(tmp_path, f"{head}{lines}*End step\n")
    (step,) = deck.solve()
    held = [[deck.point(8 * k + n) for n in (1, 2, 3, 4)] for k in range(3)]
    assert [-step.reaction[points, axis].sum() for points in held] == pytest.approx(expected, rel=1e-9, abs=1e-9)
