"""Keywords of contact pairs, ties, equations, rigid bodies and couplings."""

from __future__ import annotations

from collections.abc import Iterator

from fastcontact.cases.decks.blocks import Block, Location, Row, as_number, unquoted
from fastcontact.cases.decks.content import Content, Equation, Link, MultiPoint, Pair, Pin
from fastcontact.cases.decks.cyclic_symmetry import sector_ends
from fastcontact.cases.decks.relating import LEAST

# Largest number of terms of an equation. Each equation couples all of its terms to each other.
MOST_TERMS = 100_000


def contact_pair(content: Content, block: Block) -> None:
    """Read *CONTACT PAIR; the first surface of a line is the secondary side."""
    kinds = ("NODE TO SURFACE", "SURFACE TO SURFACE", "MORTAR", "LINMORTAR", "PGLINMORTAR")
    if block.choice("TYPE", kinds) == "NODE TO SURFACE":
        content.note(block, "NODE TO SURFACE: mortar contact is used, which transmits uniform pressures on any meshes")
    if "SMALL SLIDING" in block.parameters:
        content.note(block, "SMALL SLIDING: no effect, contact is detected in the deformed configuration")
    adjust = block.get("ADJUST") if "ADJUST" in block.parameters else ""
    content.pairs += [
        Pair(*sides, block.required("INTERACTION"), adjust=adjust) for sides in _sides(block, "a contact pair")
    ]


def _sides(block: Block, kind: str) -> Iterator[tuple[Location, str, str]]:
    """Yield the location of each data line with the names of its secondary and its primary surface."""
    for row in block.each():
        if len([entry for entry in row.entries if entry]) != 2:
            raise row.refuse(f"{kind} needs two surfaces, the secondary and the primary one")
        yield row.location, unquoted(row.text(0)), unquoted(row.text(1))


def clearance(content: Content, block: Block) -> None:
    """Read *CLEARANCE: the initial gap between the sides of a pair, which replaces that of the coordinates."""
    secondary = block.get("SLAVE") or block.get("SECONDARY")
    primary = block.get("MASTER") or block.get("MAIN")
    value = as_number(block.location, block.required("VALUE"))
    for pair in content.pairs:
        if (pair.secondary.upper(), pair.primary.upper()) == (secondary.upper(), primary.upper()):
            pair.clearance = value
            return
    raise block.refuse(f"there is no contact pair of '{secondary}' and '{primary}' above this line")


def tie(content: Content, block: Block) -> None:
    """Read *TIE: tied surfaces, or the end surfaces of a cyclic sector."""
    if "CYCLIC SYMMETRY" in block.parameters:
        content.sector_ends.append(sector_ends(block))
        return
    tolerance = block.get("POSITION TOLERANCE")
    value = as_number(block.location, tolerance) if tolerance else None
    adjust = block.choice("ADJUST", ("YES", "NO"))
    if value is not None:
        if value < 0.0:
            raise block.refuse(f"POSITION TOLERANCE={value:g} is negative")
        content.note(
            block,
            f"POSITION TOLERANCE={value:g}: no effect, the surfaces are tied where they face each other, at any distance, "
            "not node by node",
        )
    if adjust == "YES" and "ADJUST" in block.parameters:
        content.note(block, "ADJUST=YES: nodes are not moved, distances of the sides are kept")
    content.pairs += [Pair(*sides, tied=True, adjust=adjust, tolerance=value) for sides in _sides(block, "a tie")]


def equation(content: Content, block: Block) -> None:
    """Read *EQUATION: the number of terms, then the node, component and coefficient of each term."""
    rows = block.each()
    for head in rows:
        count = head.whole(0)
        terms: list[tuple[str, int, float]] = []
        if not 1 <= count <= MOST_TERMS:
            raise head.refuse(f"an equation cannot have {count} terms")
        while len(terms) < count:
            row = next(rows, None)
            if row is None:
                break
            starts = (start for start in range(0, len(row.entries), 3) if row.text(start))
            terms += [(row.text(start), row.whole(start + 1), row.number(start + 2)) for start in starts]
        if len(terms) != count:
            raise head.refuse(f"the equation has {len(terms)} terms, {count} are announced")
        content.equations.append(Equation(head.location, tuple(terms)))


def multi_point(content: Content, block: Block) -> None:
    """Read *MPC.

    PIN and TIE give two nodes the same displacement, and BEAM is a rigid bar from the first node to the second. PLANE,
    STRAIGHT and MEANROT continue on lines that begin with a number.
    """
    several: list[tuple[Row, str, list[str]]] = []
    for row in block.each():
        kind, nodes = row.text(0).upper(), [unquoted(entry) for entry in row.entries[1:] if entry]
        if kind.isdecimal() and several:
            several[-1][2].extend([*([row.text(0)] if int(kind) else []), *nodes])
        elif kind in LEAST:
            several.append((row, kind, nodes))
        elif kind not in ("PIN", "TIE", "BEAM"):
            known = ", ".join(("PIN", "TIE", "BEAM", *LEAST))
            raise row.refuse(f"an MPC of type {kind[:40]} is not supported, only {known}")
        elif len(nodes) != 2:
            raise row.refuse(f"{kind} needs two nodes, the dependent and the independent one")
        elif kind == "BEAM":
            content.links.append(Link(row.location, nodes[1], nodes[0], "nodes"))
        else:
            content.pins.append(Pin(row.location, nodes[0], nodes[1]))
    content.multi_points += [MultiPoint(row.location, kind, tuple(nodes)) for row, kind, nodes in several]


def rigid_body(content: Content, block: Block) -> None:
    """Read *RIGID BODY: nodes that move as a rigid body with a reference node."""
    kind = "elements" if block.get("ELSET") else "nodes"
    group = block.get("ELSET") or block.required("NSET")
    content.links.append(Link(block.location, block.required("REF NODE"), group, kind, rotation=block.get("ROT NODE")))


def coupling(content: Content, block: Block, inner: Block) -> None:
    """Read *COUPLING with its *KINEMATIC or *DISTRIBUTING, the `inner` block."""
    components: set[int] = set()
    for row in inner.each():
        first, last = row.whole(0), row.whole(1, row.whole(0))
        if not 1 <= first <= last <= 6:
            raise row.refuse(f"the components {first} to {last} are not within 1 to 6")
        components.update(range(first, last + 1))
    chosen = tuple(sorted(components)) or (1, 2, 3, 4, 5, 6)
    distributing = inner.keyword == "DISTRIBUTING"
    content.links.append(
        Link(
            block.location, block.required("REF NODE"), block.required("SURFACE"), "surface", chosen, distributing,
            orientation=block.get("ORIENTATION"),
        )
    )  # fmt: skip
