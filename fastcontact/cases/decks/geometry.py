"""Keywords of the geometry: nodes, elements, sets, surfaces, sections, parts and instances."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from itertools import groupby

from fastcontact.cases.decks.blocks import Block, Row, defined, folded, registered, unquoted
from fastcontact.cases.decks.content import Cell, Content, Face, Instance, Members, Part, Section, SurfaceDefinition
from fastcontact.cases.decks.element_types import described, element_type
from fastcontact.mesh import elements

# Number of nodes of each supported element that is not a solid.
DISCRETE = {"GAPUNI": 2, "SPRINGA": 2}
# Smallest number of nodes of elements that may continue on the next line without a comma at the end of the line.
LONG = 15


def nodes(content: Content, part: Part, block: Block) -> None:
    """Read *NODE: numbers and coordinates of nodes."""
    if block.get("SYSTEM", "R").upper() != "R":
        raise block.refuse(f"SYSTEM={block.get('SYSTEM')} is not supported: give rectangular coordinates")
    numbers = array("q")
    for row in block.each():
        number = row.whole(0)
        if len(row.entries) > 4 and any(row.entries[4:]):
            raise row.refuse(f"node {number} has more than three coordinates")
        position = array("d", (row.number(1, 0.0), row.number(2, 0.0), row.number(3, 0.0)))
        known = part.nodes.setdefault(number, len(part.nodes))
        if 3 * known == len(part.coordinates):
            part.coordinates.extend(position)
        elif part.coordinates[3 * known : 3 * known + 3] != position:
            raise row.refuse(f"node {number} is defined twice, at different positions")
        numbers.append(number)
    if block.get("NSET"):
        part.add("node", block.get("NSET"), [Members(block.location, numbers)])


def cells(content: Content, part: Part, block: Block) -> None:
    """Read *ELEMENT: numbers and nodes of elements of one type."""
    name, element_set = block.required("TYPE").upper(), block.get("ELSET")
    kind = element_type(name)
    if kind is None and name not in DISCRETE:
        where = f" in set '{element_set}'" if element_set else ""
        count = sum(1 for _ in _joined(block, 0))
        raise block.refuse(
            f"element type {name[:40]}{described(name)} is not supported; {count} element{'s' * (count != 1)}{where}"
        )
    needed = DISCRETE[name] if kind is None else elements.get(kind.element).n_nodes
    if kind is not None and kind.note and f"{name}: " not in "".join(content.notes):
        content.note(block, f"{name}: {kind.note}")
    members = array("q")
    for row, entries in _joined(block, needed):
        number = row.whole(0)
        whole = Row(row.location, entries)
        connectivity = array("q", (whole.whole(i) for i in range(1, len(entries)) if entries[i]))
        if len(connectivity) != needed:
            raise row.refuse(f"element {number} of type {name} has {len(connectivity)} nodes, {needed} are needed")
        if number in part.cells:
            raise row.refuse(f"element {number} is defined twice, first in line {part.cells[number].location.line}")
        part.cells[number] = Cell(name, connectivity, block.location, row.location.line, element_set)
        members.append(number)
    if element_set:
        part.add("element", element_set, [Members(block.location, members)])


def _joined(block: Block, needed: int) -> Iterator[tuple[Row, tuple[str, ...]]]:
    """Yield the first line and all entries of each element, which may continue on several lines."""
    first: Row | None = None
    entries: tuple[str, ...] = ()
    for row in block.each():
        if first is None:
            first, entries = row, row.entries
        else:
            entries += row.entries
        short = len(entries) < needed + 1
        if not (short and (row.continued or (needed >= LONG and len(row.entries) >= 8))):
            yield first, entries
            first = None
    if first is not None:
        yield first, entries


def group(content: Content, part: Part, block: Block) -> None:
    """Read *NSET or *ELSET: a node set or an element set; CaseError if a range of GENERATE is empty."""
    name, instance = block.required(block.keyword), folded(block.get("INSTANCE"))
    entries: list[Members] = []
    for row in block.each():
        if "GENERATE" in block.parameters:
            first, last, increment = row.whole(0), row.whole(1), row.whole(2, 1)
            if increment < 1 or last < first:
                raise row.refuse(f"the range {first} to {last} by {increment} is empty: it must ascend")
            entries.append(Members(row.location, range(first, last + 1, increment), instance=instance))
            continue
        for numbers, members_named in groupby(row.entries, lambda entry: entry.isdecimal() and len(entry) < 19):
            if numbers:
                entries.append(Members(row.location, array("q", map(int, members_named)), instance=instance))
            else:
                entries += [Members(row.location, name=entry, instance=instance) for entry in members_named if entry]
    part.add("node" if block.keyword == "NSET" else "element", name, entries)


def surface(content: Content, part: Part, block: Block) -> None:
    """Read *SURFACE: faces of elements, or nodes."""
    name, kind = block.required("NAME"), block.choice("TYPE", ("ELEMENT", "NODE"))
    definition = SurfaceDefinition(name, block.location, kind == "NODE")
    registered("surface", name, part.surfaces, definition, block)
    for row in block.each():
        label = row.text(1).upper()
        if not definition.of_nodes and label and not (label[0] == "S" and label[1:].isdigit()):
            raise row.refuse(f"face '{row.text(1)[:40]}' is not supported: faces of solids are S1, S2, ...")
        definition.faces.append(Face(row.location, row.text(0), "" if definition.of_nodes else label))


def instance(content: Content, block: Block) -> Instance:
    """Read *INSTANCE: a part placed in the assembly."""
    name, of = block.required("NAME"), block.required("PART")
    placed = Instance(name, defined("part", of, content.parts, block))
    rows = block.rows
    if rows:
        placed.translation = tuple(rows[0].number(i, 0.0) for i in range(3))
    if len(rows) > 1:
        placed.rotation = tuple(rows[1].number(i) for i in range(7))
    if len(rows) > 2:
        raise rows[2].refuse("an instance has at most two data lines: a translation and a rotation")
    return registered("instance", name, content.instances, placed, block)


def new_part(content: Content, block: Block) -> Part:
    """Read *PART and return the new part."""
    name = block.required("NAME")
    return registered("part", name, content.parts, Part(unquoted(name)), block)


def section(content: Content, part: Part, block: Block) -> None:
    """Read *SOLID SECTION: material, orientation and thickness of the elements of a set."""
    thickness = None
    for row in block.rows[:1]:
        thickness = row.positive(0, "thickness", 1.0)
    orientation = block.get("ORIENTATION")
    part.sections.append(
        Section(block.location, block.required("ELSET"), block.required("MATERIAL"), thickness, orientation)
    )
