"""Keywords of the geometry of a deck: nodes, elements, sets, surfaces, sections, parts and instances."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from itertools import groupby

from fastcontact.cases.decks.blocks import Block, Row, key_of, look_up, register, unquoted
from fastcontact.cases.decks.content import Cell, Content, Instance, Members, Part, Section, Surface, SurfaceEntry
from fastcontact.cases.decks.element_types import element_type, unsupported_kind
from fastcontact.mesh import elements

# Number of nodes of the supported elements that are not solids.
DISCRETE = {"GAPUNI": 2, "SPRINGA": 2}
# Smallest number of nodes of an element whose data may continue after a full line that does not end with a comma.
LONG = 15


def nodes(content: Content, part: Part, block: Block) -> None:
    """Read *NODE: numbers and coordinates of nodes."""
    if block.get("SYSTEM", "R").upper() != "R":
        raise block.error(f"SYSTEM={block.get('SYSTEM')} is not supported: give rectangular coordinates")
    numbers = array("q")
    for row in block.iter_rows():
        number = row.integer(0)
        if len(row.entries) > 4 and any(row.entries[4:]):
            raise row.error(f"node {number} has more than three coordinates")
        position = array("d", (row.number(1, 0.0), row.number(2, 0.0), row.number(3, 0.0)))
        row_of_node = part.nodes.setdefault(number, len(part.nodes))
        if 3 * row_of_node == len(part.coordinates):
            part.coordinates.extend(position)
        elif part.coordinates[3 * row_of_node : 3 * row_of_node + 3] != position:
            raise row.error(f"node {number} is defined twice, at different positions")
        numbers.append(number)
    if block.get("NSET"):
        part.add("node", block.get("NSET"), [Members(block.location, numbers)])


def cells(content: Content, part: Part, block: Block) -> None:
    """Read *ELEMENT: the numbers and the nodes of elements of one type."""
    name, element_set = block.required("TYPE").upper(), block.get("ELSET")
    solid_type = element_type(name)
    if solid_type is None and name not in DISCRETE:
        where = f" in set '{element_set}'" if element_set else ""
        count = sum(1 for _ in _element_rows(block, 0))
        raise block.error(
            f"element type {name[:40]}{unsupported_kind(name)} is not supported; {count} element{'s' * (count != 1)}{where}"
        )
    n_nodes = DISCRETE[name] if solid_type is None else elements.get(solid_type.element).n_nodes
    if solid_type is not None and solid_type.note and f"{name}: " not in "".join(content.notes):
        content.note(block, f"{name}: {solid_type.note}")
    members = array("q")
    for row in _element_rows(block, n_nodes):
        number = row.integer(0)
        connectivity = array("q", (row.integer(i) for i, entry in enumerate(row.entries) if i and entry))
        if len(connectivity) != n_nodes:
            raise row.error(f"element {number} of type {name} has {len(connectivity)} nodes, {n_nodes} are needed")
        if number in part.cells:
            raise row.error(f"element {number} is defined twice, first in line {part.cells[number].location.line}")
        part.cells[number] = Cell(name, connectivity, block.location, row.location.line, element_set)
        members.append(number)
    if element_set:
        part.add("element", element_set, [Members(block.location, members)])


def _element_rows(block: Block, n_nodes: int) -> Iterator[Row]:
    """Yield the data of each element, which may continue on several lines, as one row at the location of the first line."""
    element_row: Row | None = None
    for row in block.iter_rows():
        element_row = row if element_row is None else Row(element_row.location, element_row.entries + row.entries)
        incomplete = len(element_row.entries) < n_nodes + 1
        if not (incomplete and (row.continued or (n_nodes >= LONG and len(row.entries) >= 8))):
            yield element_row
            element_row = None
    if element_row is not None:
        yield element_row


def group(content: Content, part: Part, block: Block) -> None:
    """Read *NSET or *ELSET: a node set or an element set. Raises CaseError if a range of GENERATE is empty."""
    name, instance = block.required(block.keyword), key_of(block.get("INSTANCE"))
    entries: list[Members] = []
    for row in block.iter_rows():
        if "GENERATE" in block.parameters:
            first, last, increment = row.integer(0), row.integer(1), row.integer(2, 1)
            if increment < 1 or last < first:
                raise row.error(f"the range {first} to {last} by {increment} is empty: it must ascend")
            entries.append(Members(row.location, range(first, last + 1, increment), instance=instance))
            continue
        # Numbers of 19 digits or more may exceed 64 bits. They are looked up as names, which do not exist.
        for are_numbers, members in groupby(row.entries, lambda entry: entry.isdecimal() and len(entry) < 19):
            if are_numbers:
                entries.append(Members(row.location, array("q", map(int, members)), instance=instance))
            else:
                entries += [Members(row.location, name=entry, instance=instance) for entry in members if entry]
    part.add("node" if block.keyword == "NSET" else "element", name, entries)


def surface(content: Content, part: Part, block: Block) -> None:
    """Read *SURFACE: the faces of elements or the nodes of a surface."""
    name, kind = block.required("NAME"), block.choice("TYPE", ("ELEMENT", "NODE"))
    definition = Surface(name, block.location, kind == "NODE")
    register("surface", name, part.surfaces, definition, block)
    for row in block.iter_rows():
        label = row.text(1).upper()
        if not definition.of_nodes and label and not (label[0] == "S" and label[1:].isdigit()):
            raise row.error(f"face '{row.text(1)[:40]}' is not supported: faces of solids are S1, S2, ...")
        definition.entries.append(SurfaceEntry(row.location, row.text(0), "" if definition.of_nodes else label))


def instance(content: Content, block: Block) -> Instance:
    """Read *INSTANCE: a part with its translation and rotation in the assembly."""
    name, part_name = block.required("NAME"), block.required("PART")
    new_instance = Instance(name, look_up("part", part_name, content.parts, block))
    rows = block.rows
    if rows:
        new_instance.translation = tuple(rows[0].number(i, 0.0) for i in range(3))
    if len(rows) > 1:
        new_instance.rotation = tuple(rows[1].number(i) for i in range(7))
    if len(rows) > 2:
        raise rows[2].error("an instance has at most two data lines: a translation and a rotation")
    return register("instance", name, content.instances, new_instance, block)


def new_part(content: Content, block: Block) -> Part:
    """Read *PART and return the new part."""
    name = block.required("NAME")
    return register("part", name, content.parts, Part(unquoted(name)), block)


def section(content: Content, part: Part, block: Block) -> None:
    """Read *SOLID SECTION: material, orientation and thickness of the elements of a set."""
    rows = block.rows
    thickness = rows[0].positive(0, "thickness", 1.0) if rows else None
    names = block.required("ELSET"), block.required("MATERIAL")
    part.sections.append(Section(block.location, *names, thickness, block.get("ORIENTATION")))
