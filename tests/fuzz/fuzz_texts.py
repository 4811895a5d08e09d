"""Damage to well-formed texts: decks, sections of Gmsh, XML of VTK."""

import base64
import copy
import struct
from xml.etree import ElementTree

import numpy as np

NUMBERS = [
    "0", "-1", "1", "2", "17", "99", "1000000", "2147483648", "9223372036854775808", "1e308", "-1e308", "1e-320", "nan",
    "inf", "0.5", "-0.0", "1.D5", "1_0", "0x10", "", " ", "x", "1e400", "S1", "all", "é", "1;2", "1 2",
]  # fmt: skip
KEYWORDS = [
    "HEADING", "NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "MATERIAL", "ELASTIC", "DENSITY", "EXPANSION", "SOLID SECTION",
    "SURFACE INTERACTION", "FRICTION", "SURFACE BEHAVIOR", "CONTACT PAIR", "TIE", "EQUATION", "RIGID BODY", "TRANSFORM",
    "AMPLITUDE", "GAP", "ORIENTATION", "SPRING", "CLEARANCE", "BOUNDARY", "STEP", "STATIC", "CLOAD", "DLOAD", "DSLOAD",
    "END STEP", "PART", "END PART", "INSTANCE", "END INSTANCE", "ASSEMBLY", "END ASSEMBLY", "NODE PRINT", "EL FILE",
    "INCLUDE", "MPC", "COUPLING", "KINEMATIC", "INITIAL CONDITIONS", "TEMPERATURE", "RESTART", "PREPRINT", "NO SUCH KEYWORD",
]  # fmt: skip
PARAMETERS = [
    "NSET=top", "ELSET=low", "NAME=si", "TYPE=C3D8", "TYPE=C3D10", "TYPE=CAX4", "TYPE=ISO", "TYPE=ORTHO", "GENERATE",
    "INTERNAL", "MATERIAL=steel", "AMPLITUDE=up", "OP=NEW", "OP=MOD", "NLGEOM", "INTERACTION=si", "ADJUST=0.1", "TIED",
    "INPUT=other.inp",
    "INPUT=../outside/bait.h5", "INPUT=/etc/hostname", "SYSTEM=R", "INSTANCE=a", "TYPE=", "=", "A=B=C", 'NAME="x, y"',
]  # fmt: skip


def _any(items: list, random: np.random.Generator):
    return items[int(random.integers(len(items)))]


def deck(text: str, random: np.random.Generator) -> str:
    """Return a deck with one to four changes: of keywords, parameters, data lines, or whole blocks."""
    blocks: list[list[str]] = []
    for line in text.splitlines():
        if (line.startswith("*") and not line.startswith("**")) or not blocks:
            blocks.append([])
        blocks[-1].append(line)
    for _ in range(1 + int(random.integers(4))):
        if blocks:
            _any(DECK_CHANGES, random)(blocks, random)
    return "\n".join(line for block in blocks for line in block) + "\n"


def _entry(blocks: list[list[str]], random: np.random.Generator) -> None:
    """Change an entry of a data line, mostly to one that stands elsewhere or to a strange number."""
    block = _any(blocks, random)
    if len(block) > 1:
        row = 1 + int(random.integers(len(block) - 1))
        entries = block[row].split(",")
        other = _any(_any(blocks, random), random).split(",")
        entries[int(random.integers(len(entries)))] = _any(NUMBERS if random.random() < 0.6 else other, random)
        block[row] = ",".join(entries)


def _length(blocks: list[list[str]], random: np.random.Generator) -> None:
    """Cut a data line, lengthen it, or let it go on."""
    block = _any(blocks, random)
    row = int(random.integers(len(block)))
    entries = block[row].split(",")
    cut = int(random.integers(len(entries) + 1))
    block[row] = _any([",".join(entries[:cut]), block[row] + ", 1", block[row] + ",", block[row] + "," * 20], random)


def _keyword(blocks: list[list[str]], random: np.random.Generator) -> None:
    block = _any(blocks, random)
    _, comma, rest = block[0].partition(",")
    block[0] = f"*{_any(KEYWORDS, random)}{comma}{rest}"


def _parameter(blocks: list[list[str]], random: np.random.Generator) -> None:
    block = _any(blocks, random)
    parts = block[0].split(",")
    kind = int(random.integers(4))
    if kind == 0:
        parts.append(_any(PARAMETERS, random))
    elif kind == 1 and len(parts) > 1:
        del parts[1 + int(random.integers(len(parts) - 1))]
    elif len(parts) > 1:
        at = 1 + int(random.integers(len(parts) - 1))
        key = parts[at].partition("=")[0]
        value = _any(NUMBERS, random) if kind == 2 else _any(_any(blocks, random), random).partition(",")[0]
        parts[at] = f"{key}={value.lstrip('*')}"
    block[0] = ",".join(parts)


def _block(blocks: list[list[str]], random: np.random.Generator) -> None:
    """Delete, double, move or empty a block, or put in a new one."""
    at, to, kind = int(random.integers(len(blocks))), int(random.integers(len(blocks))), int(random.integers(5))
    if kind == 0:
        del blocks[at]
    elif kind == 1:
        blocks.insert(to, list(blocks[at]))
    elif kind == 2:
        blocks.insert(to, blocks.pop(at))
    elif kind == 3:
        del blocks[at][1:]
    else:
        rows = [", ".join(str(_any(NUMBERS, random)) for _ in range(int(random.integers(1, 6))))]
        blocks.insert(to, [f"*{_any(KEYWORDS, random)}, {_any(PARAMETERS, random)}", *rows])


def _rows(blocks: list[list[str]], random: np.random.Generator) -> None:
    """Delete, double or exchange data lines, within a block or between two."""
    one, other = _any(blocks, random), _any(blocks, random)
    i, j = int(random.integers(len(one))), int(random.integers(len(other)))
    if i and j:
        one[i], other[j] = other[j], one[i]
    elif i:
        one[i : i + 1] = [] if random.random() < 0.5 else [one[i]] * int(random.integers(2, 50))


DECK_CHANGES = [_entry, _entry, _entry, _length, _keyword, _parameter, _parameter, _block, _block, _rows]


def gmsh(text: str, random: np.random.Generator) -> str:
    """Return a text of Gmsh with one to three changes: of numbers, lines, or whole sections."""
    lines = text.splitlines()
    for _ in range(1 + int(random.integers(3))):
        kind, at = random.random(), int(random.integers(max(len(lines), 1)))
        if not lines:
            break
        if kind < 0.55:
            words = lines[at].split(" ")
            words[int(random.integers(len(words)))] = _any(NUMBERS if random.random() < 0.7 else lines, random)
            lines[at] = " ".join(words)
        elif kind < 0.7:
            lines[at : at + 1] = [] if random.random() < 0.5 else [lines[at]] * int(random.integers(2, 60))
        else:
            _section(lines, random)
    return "\n".join(lines) + "\n"


def _section(lines: list[str], random: np.random.Generator) -> None:
    """Delete, double, move or rename a section, or take its end away."""
    starts = [number for number, line in enumerate(lines) if line.startswith("$") and not line.startswith("$End")]
    if not starts:
        return
    start = _any(starts, random)
    end = next((n for n in range(start, len(lines)) if lines[n].startswith("$End")), len(lines) - 1)
    section, kind = lines[start : end + 1], int(random.integers(5))
    if kind == 0:
        lines[start : end + 1] = []
    elif kind == 1:
        lines[end + 1 : end + 1] = section
    elif kind == 2:
        lines[start : end + 1] = []
        place = _any([0, len(lines)], random)
        lines[place:place] = section
    elif kind == 3:
        lines[start] = _any(
            ["$Nodes", "$Elements", "$PhysicalNames", "$Entities", "$Periodic", "$NodeData", "$X"], random
        )
    else:
        del lines[end]


ATTRIBUTES = {
    "type": ["Float32", "Float64", "Int8", "UInt8", "Int32", "Int64", "UInt64", "String", "x", ""],
    "format": ["ascii", "binary", "appended", "x"],
    "compressor": ["vtkZLibDataCompressor", "vtkLZMADataCompressor", "vtkLZ4DataCompressor", ""],
    "header_type": ["UInt32", "UInt64", "Int8", "x"],
    "byte_order": ["LittleEndian", "BigEndian", "x"],
    "Name": ["connectivity", "offsets", "types", "Points", "cell_group:A", "point_group:B", "", "é\n"],
}  # fmt: skip
TAGS = ["DataArray", "Points", "Cells", "Piece", "PointData", "CellData", "FieldData", "AppendedData", "x"]


def vtu(text: str, random: np.random.Generator) -> str:
    """Return a file of VTK's XML with one to three changes: of attributes, numbers, elements, sizes of packed blocks."""
    root = ElementTree.fromstring(text)
    for _ in range(1 + int(random.integers(3))):
        items = list(root.iter())
        parents = [item for item in items if len(item)]
        kind = random.random()
        if kind < 0.35:
            item = _any(items, random)
            key = _any([*item.attrib, *ATTRIBUTES], random)
            item.set(
                key, _any(ATTRIBUTES.get(key, NUMBERS), random) if random.random() < 0.7 else _any(NUMBERS, random)
            )
        elif kind < 0.6 and parents:
            _element(_any(parents, random), parents, random)
        else:
            _values(_any([item for item in items if item.tag == "DataArray"] or items, random), items, random)
    return ElementTree.tostring(root, encoding="unicode")


def _element(parent: ElementTree.Element, parents: list[ElementTree.Element], random: np.random.Generator) -> None:
    item, kind = _any(list(parent), random), int(random.integers(4))
    if kind == 0:
        parent.remove(item)
    elif kind == 1:
        parent.append(copy.deepcopy(item))
    elif kind == 2:
        item.tag = _any(TAGS, random)
    else:
        _any(parents, random).append(copy.deepcopy(item))


def _values(item: ElementTree.Element, items: list[ElementTree.Element], random: np.random.Generator) -> None:
    """Change numbers of a text, the head of packed blocks, or take the text of another array."""
    text = (item.text or "").strip()
    if random.random() < 0.3:
        item.text = _any(items, random).text
    elif item.get("format") == "binary" and text:
        try:
            raw = bytearray(base64.b64decode(text[:24], validate=True))
        except ValueError:
            return
        value = _any([0, 1, 2**16, 2**31 - 1, 2**32 - 1, 3, 33], random)
        place = int(random.integers(max(len(raw) // 4, 1)))
        if 4 * place + 4 <= len(raw):
            struct.pack_into("<I", raw, 4 * place, value)
        item.text = base64.b64encode(bytes(raw)).decode() + text[24:]
    else:
        words = text.split()
        for _ in range(int(random.integers(1, 4))):
            if words:
                words[int(random.integers(len(words)))] = _any(NUMBERS, random)
        item.text = " ".join(words[: int(random.integers(len(words) + 1))] if random.random() < 0.3 else words)


CHANGED = {".deck": deck, ".msh": gmsh, ".vtu": vtu}
