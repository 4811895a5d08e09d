"""Mesh files of code_aster in text form (``.mail``): blocks of words, each from its keyword to FINSF."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact.errors import FileError, MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.files.meshio_content import VERTEX, mesh_of
from fastcontact.mesh.mesh import Mesh

# Cells by keyword, and positions of the nodes of fastcontact among those of code_aster where the orders differ.
KINDS = {
    "POI1": VERTEX, "SEG2": "line2", "SEG3": "line3", "TRIA3": "tri3", "TRIA6": "tri6", "QUAD4": "quad4", "QUAD8": "quad8",
    "QUAD9": "quad9", "TETRA4": "tet4", "TETRA10": "tet10", "PENTA6": "wedge6", "PENTA15": "wedge15", "PENTA18": "wedge18",
    "PYRAM5": "pyramid5", "PYRAM13": "pyramid13", "HEXA8": "hex8", "HEXA20": "hex20", "HEXA27": "hex27",
}  # fmt: skip
# Edges of bricks in code_aster: bottom, upright, top; here: bottom, top, upright.
_BRICK_EDGES = (*range(12), *range(16, 20), *range(12, 16))
NODE_ORDER = {
    "PENTA15": (*range(9), *range(12, 15), *range(9, 12)),
    "PENTA18": (*range(9), *range(12, 15), *range(9, 12), 15, 16, 17),
    "HEXA20": _BRICK_EDGES,
    "HEXA27": (*_BRICK_EDGES, 24, 22, 21, 23, 20, 25, 26),
}
COORDINATES = {"COOR_2D": 2, "COOR_3D": 3}
IGNORED = ("TITRE",)

Word = tuple[str, int]


def read(path: Path) -> tuple[Mesh, dict[str, int]]:
    """Return the mesh of a file, and the number of its cells of one node, whose groups are groups of points.

    Raises
    ------
    FileError
        If the file is damaged or contains anything else; the message names the line.
    """
    content = _Content(path)
    words = _words(path)
    for keyword, line in words:
        if keyword.upper() == "FIN":
            try:
                return mesh_of(content.plain())
            except MeshError as error:
                raise MeshError(f"'{path}': {error}") from None
        content.add(keyword.upper(), line, _block(path, keyword, line, words))
    raise FileError(f"'{path}' ends without FIN: it is truncated, or not a mesh file of code_aster")


def _words(path: Path) -> Iterator[Word]:
    """Yield the words of a file with their line numbers, without comments."""
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            for number, line in enumerate(file, 1):
                yield from ((word, number) for word in line.partition("%")[0].replace("=", " = ").split())
    except OSError as error:
        raise FileError(f"cannot read '{path}': {error}") from error


def _block(path: Path, keyword: str, line: int, words: Iterator[Word]) -> list[Word]:
    """Return the words of one block, without header entries such as ``NOM = x``, except for the name of a group."""
    kept: list[Word] = []
    for word, number in words:
        if word.upper() == "FINSF":
            return kept
        kept.append((word, number))
        if len(kept) > 2 and kept[-2][0] == "=":
            (name, _), _, value = kept[-3:]
            del kept[-3:]
            if keyword.upper().startswith("GROUP") and name.upper() == "NOM":
                kept.append(value)
    raise FileError(f"'{path}', line {line}: {keyword[:40]} has no FINSF: the file is truncated")


class _Content:
    """Nodes, cells and groups of a file by their names."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._points: dict[str, int] = {}
        self._places: list[list[float]] = []
        self._cells: dict[str, dict[str, list[str]]] = {}
        self._groups: dict[str, dict[str, list[Word]]] = {"GROUP_NO": {}, "GROUP_MA": {}}

    def add(self, keyword: str, line: int, words: list[Word]) -> None:
        """Add one block."""
        if keyword in COORDINATES:
            for name, *coordinates in self._rows(keyword, line, words, 1 + COORDINATES[keyword]):
                self._points[name[0]] = len(self._places)
                self._places.append([self._number(word) for word in coordinates])
        elif keyword in KINDS:
            count = 1 if KINDS[keyword] == VERTEX else elements.get(KINDS[keyword]).n_nodes
            block = self._cells.setdefault(keyword, {})
            for name, *nodes in self._rows(keyword, line, words, 1 + count):
                block[name[0]] = [self._point(node) for node in nodes]
        elif keyword in self._groups:
            if not words:
                raise self._refusal(line, f"{keyword} has no name")
            self._groups[keyword].setdefault(words[0][0], []).extend(words[1:])
        elif keyword not in IGNORED:
            known = ", ".join([*COORDINATES, *KINDS, *self._groups])
            raise self._refusal(line, f"{keyword[:40]} is not known; a mesh has {known}")

    def plain(self) -> dict[str, Any]:
        """Return points, cells and groups in the format of `meshio_process.plain_content`."""
        cells: list[Any] = []
        sets: dict[str, Any] = {}
        start: dict[str, dict[str, int]] = {}
        for keyword, block in self._cells.items():
            nodes = np.array([[self._points[node] for node in row] for row in block.values()], np.intp)
            nodes = nodes[:, NODE_ORDER[keyword]] if keyword in NODE_ORDER else nodes
            kind = VERTEX if KINDS[keyword] == VERTEX else elements.get(KINDS[keyword]).meshio
            cells.append([kind, len(nodes), nodes])
            start[keyword] = {name: row for row, name in enumerate(block)}
        for group, members in self._groups["GROUP_MA"].items():
            rows = {keyword: [known[w] for w, _ in members if w in known] for keyword, known in start.items()}
            self._all_known(members, set().union(*start.values()) if start else set(), "cell")
            sets[group] = [np.array(rows[keyword], np.intp) for keyword in self._cells]
        points = {}
        for group, members in self._groups["GROUP_NO"].items():
            self._all_known(members, self._points, "node")
            points[group] = np.array([self._points[word] for word, _ in members], np.intp)
        return {
            "points": np.array(self._places, np.float64), "cells": cells, "cell_data": {}, "point_data": {},
            "cell_sets": sets, "point_sets": points, "field_data": {}, "said": "",
        }  # fmt: skip

    def _rows(self, keyword: str, line: int, words: list[Word], width: int) -> Iterator[list[Word]]:
        if len(words) % width:
            raise self._refusal(line, f"{keyword} has {len(words)} words, which do not form rows of {width}")
        yield from (words[i : i + width] for i in range(0, len(words), width))

    def _number(self, word: Word) -> float:
        try:
            return float(word[0].upper().replace("D", "E"))
        except ValueError:
            raise self._refusal(word[1], f"'{word[0][:40]}' is not a number") from None

    def _point(self, word: Word) -> str:
        if word[0] not in self._points:
            raise self._refusal(word[1], f"there is no node '{word[0][:40]}' before this line")
        return word[0]

    def _all_known(self, members: list[Word], known: Any, kind: str) -> None:
        for word, line in members:
            if word not in known:
                raise self._refusal(line, f"there is no {kind} '{word[:40]}'")

    def _refusal(self, line: int, text: str) -> FileError:
        return FileError(f"'{self._path}', line {line}: {text}")
