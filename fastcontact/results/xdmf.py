"""XDMF files that refer to the data of result files, for viewers that do not support steps in VTKHDF."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from xml.sax.saxutils import escape, quoteattr

from fastcontact._tools.paths import PathLike, checked_target, replacing
from fastcontact.arrays import AnyArray
from fastcontact.errors import FileError
from fastcontact.results import layout
from fastcontact.results.reader import open_results
from fastcontact.results.tables import STRESS_COMPONENTS

HEAD = """<?xml version="1.0" encoding="utf-8"?>
<Xdmf Version="2.0"><Domain>
<Grid Name="steps" GridType="Collection" CollectionType="Temporal">"""
TAIL = "</Grid></Domain></Xdmf>\n"


def write_xdmf(result_path: PathLike, xdmf_path: PathLike) -> None:
    """Write an XDMF file that refers to the steps of a result file, for ParaView before version 5.12.

    The XDMF file refers to the steps that are complete when it is written. It contains no data, so that the result file must
    remain at its relative path.

    Parameters
    ----------
    result_path : path-like
        Result file of ``ResultWriter``.
    xdmf_path : path-like
        File to write, with suffix ``.xdmf``; an existing file is replaced atomically.

    Raises
    ------
    FileError
        If the results cannot be read or contain no step, if the mesh has no solid cells, if XDMF does not support the name of
        the result file, or if the XDMF file cannot be written.
    """
    target = checked_target(xdmf_path)
    with open_results(result_path) as results:
        mesh, load_factors, fields = results.mesh, results.load_factors.tolist(), results.point_field_names
    if not load_factors:
        raise FileError(f"'{result_path}' contains no complete step yet: export it after the first one")
    topology = layout.xdmf_topology(mesh)
    if topology is None:
        raise FileError(
            f"XDMF cannot show '{result_path}' with no solid cells: open the .vtkhdf file itself (ParaView 5.12)"
        )
    reference = os.path.relpath(os.path.realpath(os.fspath(result_path)), target.parent)
    if ":" in reference or not reference.isascii():
        raise FileError(f"XDMF readers cannot open '{reference}': use a name in ASCII without colons")
    n_points, n_cells, n_steps = mesh.n_points, sum(map(len, mesh.solids.values())), len(load_factors)
    shape = [
        f'<Topology TopologyType="Mixed" NumberOfElements="{n_cells}">',
        _data_item(f"{reference}:/fastcontact/mesh/xdmf_topology", (len(topology),), "Int", 4),
        '</Topology><Geometry GeometryType="XYZ">',
        _data_item(f"{reference}:/VTKHDF/Points", (n_points, 3)),
        "</Geometry>",
    ]
    constant = [*_constant_attributes(reference, "Node", "PointData", layout.point_flags(mesh))]
    constant += _constant_attributes(reference, "Cell", "CellData", layout.cell_fields(mesh))
    grids = []
    for number, load_factor in enumerate(load_factors):
        grids += [f'<Grid Name="step {number + 1}" GridType="Uniform"><Time Value="{load_factor!r}"/>', *shape]
        for field in fields:
            grids += _field_attributes(f"{reference}:/VTKHDF/PointData/{field}", n_points, number, n_steps)
        grids += [*constant, "</Grid>"]
    with replacing(target) as temporary:
        temporary.write_text("\n".join([HEAD, *grids, TAIL]), encoding="utf-8")


def _joined(numbers: Iterable[int]) -> str:
    return " ".join(map(str, numbers))


def _data_item(address: str, shape: Iterable[int], kind: str = "Float", precision: int = 8) -> str:
    """Return an XDMF item that refers to the data set at `address`."""
    attributes = f'Dimensions="{_joined(shape)}" NumberType="{kind}" Precision="{precision}"'
    return f'<DataItem Format="HDF" {attributes}>{escape(address)}</DataItem>'


def _attribute(name: str, kind: str, center: str, item: str) -> str:
    return f'<Attribute Name={quoteattr(name)} AttributeType="{kind}" Center="{center}">{item}</Attribute>'


def _constant_attributes(reference: str, center: str, group: str, arrays: Mapping[str, AnyArray]) -> Iterator[str]:
    """Yield the attributes of arrays that do not change from step to step."""
    for name, values in arrays.items():
        address, kind = f"{reference}:/VTKHDF/{group}/{name}", "Char" if values.itemsize == 1 else "Int"
        yield _attribute(name, "Scalar", center, _data_item(address, values.shape, kind, values.itemsize))


def _field_attributes(address: str, n_points: int, number: int, n_steps: int) -> Iterator[str]:
    """Yield the attributes of a point field in one step, which occupies a part of the data set for all steps."""
    name = address.rpartition("/")[2]
    width = layout.POINT_FIELDS[name]
    columns = [(name, 0, width)]  # label, first column and number of columns of each attribute
    if name == "stress":  # XDMF orders tensor components differently from VTK
        columns = [(f"stress_{component}", column, 1) for column, component in enumerate(STRESS_COMPONENTS)]
    dims = 1 if width == 1 else 2
    for label, column, count in columns:
        start, size = (number * n_points, column)[:dims], (n_points, count)[:dims]
        selection = f'<DataItem Format="XML" Dimensions="3 {dims}">{_joined((*start, *[1] * dims, *size))}</DataItem>'
        whole = _data_item(address, (n_points * n_steps, width)[:dims])
        slab = f'ItemType="HyperSlab" Dimensions="{_joined(size)}" Type="HyperSlab"'
        item = f"<DataItem {slab}>{selection}{whole}</DataItem>"
        yield _attribute(label, "Vector" if count == 3 else "Scalar", "Node", item)
