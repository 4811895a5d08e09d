"""An XDMF file beside a result file: viewers that know no steps in VTKHDF read the same data through it."""

from __future__ import annotations

import os
from typing import Any
from xml.etree import ElementTree

from fastcontact._tools.paths import PathLike, checked_target, replacing
from fastcontact.errors import FileError
from fastcontact.results import layout
from fastcontact.results.reader import open_results
from fastcontact.results.tables import STRESS_COMPONENTS

Node = ElementTree.Element


def write_xdmf(result_path: PathLike, xdmf_path: PathLike) -> None:
    """Write an XDMF file that refers to the steps of a result file, for ParaView before 5.12.

    The XDMF file holds no numbers, only their places in the result file: move the two together. It shows the steps that
    were complete when it was written.

    Parameters
    ----------
    result_path : path-like
        File of ``ResultWriter``.
    xdmf_path : path-like
        File to write, suffix ``.xdmf``; replaced at once if it exists.

    Raises
    ------
    FileError
        If the results cannot be read or hold no step, XDMF lacks an element, the result file has a name that XDMF cannot
        refer to, or the XDMF file cannot be written.
    """
    target = checked_target(xdmf_path)
    with open_results(result_path) as results:
        mesh, load_factors, fields = results.mesh, results.load_factors.tolist(), results.point_field_names
    if not load_factors:
        raise FileError(f"'{result_path}' holds no complete step yet: export it after the first one")
    topology = layout.xdmf_topology(mesh)
    if topology is None:
        names = ", ".join(mesh.solids) or "no solid cells"
        raise FileError(f"XDMF cannot show '{result_path}' with {names}: open the .vtkhdf file itself (ParaView 5.12)")
    reference = os.path.relpath(os.path.realpath(os.fspath(result_path)), target.parent)
    if ":" in reference or not reference.isascii():
        raise FileError(f"XDMF readers find no '{reference}': name it without colons and with ASCII letters only")
    sizes = {"points": mesh.n_points, "topology": len(topology), "cells": sum(map(len, mesh.solids.values()))}
    static = {
        "Node": {name: values.dtype for name, values in layout.point_flags(mesh).items()},
        "Cell": {name: values.dtype for name, values in layout.cell_fields(mesh).items()},
    }
    document = _document(reference, load_factors, fields, sizes, static)
    ElementTree.indent(document)
    with replacing(target) as temporary, open(temporary, "w", encoding="utf-8") as file:
        file.write('<?xml version="1.0" encoding="utf-8"?>\n')
        file.write(ElementTree.tostring(document, encoding="unicode") + "\n")


def _document(
    reference: str, load_factors: list[float], fields: list[str], sizes: dict[str, int],
    static: dict[str, dict[str, Any]],
) -> Node:  # fmt: skip
    root = Node("Xdmf", Version="2.0")
    domain = ElementTree.SubElement(root, "Domain")
    collection = _child(domain, "Grid", Name="steps", GridType="Collection", CollectionType="Temporal")
    for number, load_factor in enumerate(load_factors):
        grid = _child(collection, "Grid", Name=f"step {number + 1}", GridType="Uniform")
        _child(grid, "Time", Value=repr(load_factor))
        _geometry(grid, reference, sizes)
        for field in fields:
            _field(grid, f"{reference}:/VTKHDF/PointData/{field}", sizes["points"], number, len(load_factors))
        for center, arrays in static.items():
            count = sizes["points"] if center == "Node" else sizes["cells"]
            group = "PointData" if center == "Node" else "CellData"
            for name, dtype in arrays.items():
                attribute = _child(grid, "Attribute", Name=name, AttributeType="Scalar", Center=center)
                kind = "Char" if dtype.itemsize == 1 else "Int"
                _hdf(attribute, f"{reference}:/VTKHDF/{group}/{name}", str(count), kind, dtype.itemsize)
    return root


def _child(parent: Node, tag: str, **attributes: str) -> Node:
    return ElementTree.SubElement(parent, tag, attributes)


def _hdf(parent: Node, address: str, dimensions: str, kind: str, precision: int) -> None:
    item = _child(parent, "DataItem", Format="HDF", Dimensions=dimensions, NumberType=kind, Precision=str(precision))
    item.text = address


def _geometry(grid: Node, reference: str, sizes: dict[str, int]) -> None:
    topology = _child(grid, "Topology", TopologyType="Mixed", NumberOfElements=str(sizes["cells"]))
    _hdf(topology, f"{reference}:/fastcontact/mesh/xdmf_topology", str(sizes["topology"]), "Int", 4)
    geometry = _child(grid, "Geometry", GeometryType="XYZ")
    _hdf(geometry, f"{reference}:/VTKHDF/Points", f"{sizes['points']} 3", "Float", 8)


def _field(grid: Node, address: str, n_points: int, number: int, n_steps: int) -> None:
    name = address.rpartition("/")[2]
    width, rows = {**layout.POINT_FIELDS, **layout.HEAT_FIELDS}[name], n_points * n_steps
    parts = [(name, 0, width)]  # label, first column and number of columns of each field
    if name == "stress":  # XDMF orders the components of a symmetric tensor otherwise than VTK: each is a field
        parts = [(f"stress_{component}", column, 1) for column, component in enumerate(STRESS_COMPONENTS)]
    for label, column, count in parts:
        kind = "Vector" if count == 3 else "Scalar"
        attribute = _child(grid, "Attribute", Name=label, AttributeType=kind, Center="Node")
        shape, selection = (rows, width), ((number * n_points, column), (1, 1), (n_points, count))
        dims = 1 if width == 1 else 2
        _hyperslab(attribute, address, shape[:dims], tuple(row[:dims] for row in selection))


def _hyperslab(parent: Node, address: str, shape: tuple[int, ...], selection: tuple[tuple[int, ...], ...]) -> None:
    """Refer to a part of a data set: where it starts, its stride, its size."""
    item = _child(parent, "DataItem", ItemType="HyperSlab", Dimensions=_words(selection[2]), Type="HyperSlab")
    part = _child(item, "DataItem", Format="XML", Dimensions=f"3 {len(shape)}")
    part.text = " ".join(_words(row) for row in selection)
    _hdf(item, address, _words(shape), "Float", 8)


def _words(numbers: tuple[int, ...]) -> str:
    return " ".join(map(str, numbers))
