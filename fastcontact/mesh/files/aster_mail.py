"""Mesh files of code_aster in text form (``.mail``), which consist of blocks of words from a keyword to FINSF."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact.arrays import Indices
from fastcontact.errors import FileError, MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.files.meshio_content import VERTEX, Block, FileContent, build_mesh
from fastcontact.mesh.mesh import Mesh

# Element types by keyword.
TYPES = {
    "POI1": VERTEX, "SEG2": "line2", "SEG3": "line3", "TRIA3": "tri3", "TRIA6": "tri6", "QUAD4": "quad4", "QUAD8": "quad8",
    "QUAD9": "quad9", "TETRA4": "tet4", "TETRA10": "tet10", "PENTA6": "wedge6", "PENTA15": "wedge15", "PENTA18": "wedge18",
    "PYRAM5": "pyramid5", "PYRAM13": "pyramid13", "HEXA8": "hex8", "HEXA20": "hex20", "HEXA27": "hex27",
}  # fmt: skip
# Elements whose node order differs in code_aster: node k here is node NODE_ORDER[keyword][k] of code_aster. code_aster orders
# the edges as bottom, vertical, top; fastcontact as bottom, top, vertical.
_BRICK_EDGES = (*range(12), *range(16, 20), *range(12, 16))
NODE_ORDER = {
    "PENTA15": (*range(9), *range(12, 15), *range(9, 12)),
    "PENTA18": (*range(9), *range(12, 15), *range(9, 12), 15, 16, 17),
    "HEXA20": _BRICK_EDGES,
    "HEXA27": (*_BRICK_EDGES, 24, 22, 21, 23, 20, 25, 26),
}
COORDINATES = {"COOR_2D": 2, "COOR_3D": 3}
IGNORED_KEYWORDS = ("TITRE",)

Word = tuple[str, int]


def read(path: Path) -> FileContent:
    """Return the content of a file.

    Raises
    ------
    FileError
        If the file is damaged or contains an unknown keyword; the message names the line.
    MeshError
        If the file contains no cells.
    """
    content = _Content(path)
    words = _read_words(path)
    for keyword, line in words:
        if keyword.upper() == "FIN":
            try:
                return FileContent(*content.mesh(), "code_aster")
            except MeshError as error:
                raise MeshError(f"'{path}': {error}") from None
        content.add(keyword.upper(), line, _read_block(path, keyword, line, words))
    raise FileError(f"'{path}' ends without FIN: it is truncated, or not a mesh file of code_aster")


def _read_words(path: Path) -> Iterator[Word]:
    """Yield the words of a file with their line numbers, without comments."""
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            for number, line in enumerate(file, 1):
                yield from ((word, number) for word in line.partition("%")[0].replace("=", " = ").split())
    except OSError as error:
        raise FileError(f"cannot read '{path}': {error}") from error


def _read_block(path: Path, keyword: str, line: int, words: Iterator[Word]) -> list[Word]:
    """Return the words of one block. Of header entries such as ``NOM = x``, only the names of groups are included."""
    block: list[Word] = []
    for word, number in words:
        if word.upper() == "FINSF":
            return block
        block.append((word, number))
        if len(block) > 2 and block[-2][0] == "=":
            (name, _), _, value = block[-3:]
            del block[-3:]
            if keyword.upper().startswith("GROUP") and name.upper() == "NOM":
                block.append(value)
    raise FileError(f"'{path}', line {line}: {keyword[:40]} has no FINSF: the file is truncated")


class _Content:
    """Nodes, cells and groups of a file, which are identified by names."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._points: dict[str, int] = {}
        self._coordinates: list[list[float]] = []
        self._cells: dict[str, dict[str, list[int]]] = {}
        self._groups: dict[str, dict[str, list[Word]]] = {"GROUP_NO": {}, "GROUP_MA": {}}

    def add(self, keyword: str, line: int, words: list[Word]) -> None:
        """Add one block."""
        if keyword in COORDINATES:
            for name, *coordinates in self._rows(keyword, line, words, 1 + COORDINATES[keyword]):
                self._points[name[0]] = len(self._coordinates)
                self._coordinates.append([self._number(word) for word in coordinates])
        elif keyword in TYPES:
            count = 1 if TYPES[keyword] == VERTEX else elements.get(TYPES[keyword]).n_nodes
            block = self._cells.setdefault(keyword, {})
            for name, *nodes in self._rows(keyword, line, words, 1 + count):
                points = list(map(self._point, nodes))
                block[name[0]] = [points[k] for k in NODE_ORDER.get(keyword, range(count))]
        elif keyword in self._groups:
            if not words:
                raise self._error(line, f"{keyword} has no name")
            self._groups[keyword].setdefault(words[0][0], []).extend(words[1:])
        elif keyword not in IGNORED_KEYWORDS:
            keywords = ", ".join([*COORDINATES, *TYPES, *self._groups])
            raise self._error(line, f"{keyword[:40]} is not known; a mesh has {keywords}")

    def mesh(self) -> tuple[Mesh, dict[str, int]]:
        """Return the mesh, and the numbers of omitted cells by kind."""
        self._check_members("GROUP_MA", set().union(*self._cells.values()), "cell")
        self._check_members("GROUP_NO", self._points, "node")
        cell_groups, point_groups = self._groups["GROUP_MA"], self._groups["GROUP_NO"]
        blocks = []
        for keyword, block in self._cells.items():
            row_of = {name: row for row, name in enumerate(block)}
            members = {name: _numbers(words, row_of) for name, words in cell_groups.items()}
            nodes = np.array(list(block.values()), np.intp)
            blocks.append(Block(TYPES[keyword], nodes, {name: rows for name, rows in members.items() if len(rows)}))
        points = {name: _numbers(members, self._points) for name, members in point_groups.items()}
        return build_mesh(np.array(self._coordinates), blocks, points, cell_groups)

    def _rows(self, keyword: str, line: int, words: list[Word], width: int) -> Iterator[list[Word]]:
        """Yield the words of a block in rows of `width` words."""
        if len(words) % width:
            raise self._error(line, f"{keyword} has {len(words)} words, which do not form rows of {width}")
        yield from (words[i : i + width] for i in range(0, len(words), width))

    def _number(self, word: Word) -> float:
        """Return a word as a number. Raises FileError if it is not a number."""
        try:
            return float(word[0].upper().replace("D", "E"))
        except ValueError:
            raise self._error(word[1], f"'{word[0][:40]}' is not a number") from None

    def _point(self, word: Word) -> int:
        """Return the number of a node. Raises FileError if the node is not defined."""
        if word[0] not in self._points:
            raise self._error(word[1], f"there is no node '{word[0][:40]}' before this line")
        return self._points[word[0]]

    def _check_members(self, keyword: str, names: Any, kind: str) -> None:
        """Raise FileError if a member of a group is not among the `names` of nodes or cells."""
        for word, line in chain.from_iterable(self._groups[keyword].values()):
            if word not in names:
                raise self._error(line, f"there is no {kind} '{word[:40]}'")

    def _error(self, line: int, text: str) -> FileError:
        """Return a FileError with the file, the line and a text."""
        return FileError(f"'{self._path}', line {line}: {text}")


def _numbers(members: list[Word], number_of: dict[str, int]) -> Indices:
    """Return the numbers of the members of a group that are among the names `number_of`."""
    return np.array([number_of[word] for word, _ in members if word in number_of], np.intp)
