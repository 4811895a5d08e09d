"""Files that declare more than they can hold are refused within limits of memory and time."""

import base64
import errno
import lzma
import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from hostile_texts import DECKS, TEXTS
from pairwise import first_of
from refusals import refused
from test_result_files import MESH, step_result, write

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.cli._results import case_data
from fastcontact.errors import FileError, MeshError
from fastcontact.mesh.files import meshio_process
from fastcontact.mesh.files.med import add_field, write_med_mesh
from fastcontact.mesh.files.meshio_content import Block, build_mesh

HEAP = b"GCOL\x01\0\0\0"


@pytest.fixture
def results(tmp_path):
    path = tmp_path / "results.vtkhdf"
    write(path, 2)
    return path


def replaced(path, name, **created):
    with h5py.File(path, "r+") as file:
        attributes = dict(file[name].attrs)
        del file[name]
        file.create_dataset(name, **created).attrs.update(attributes)


def objects(data, place):
    """Where the objects of a heap of texts stand, the free room at its end being the last one."""
    at, found = place + 16, []
    while True:
        found.append(at)
        if not struct.unpack_from("<H", data, at)[0]:
            return found
        at += 16 + (struct.unpack_from("<Q", data, at + 8)[0] + 7) // 8 * 8


@pytest.mark.parametrize("size", [0, 8, 3584, 2**40])
def test_a_heap_whose_end_hdf5_would_not_find(results, size):
    """With a free room of size 0, HDF5 2.0 goes round for ever; with one that ends in zeros, too."""
    data = bytearray(results.read_bytes())
    at = objects(data, data.find(HEAP))[-1]
    assert struct.unpack_from("<Q", data, at + 8)[0] > 3584
    struct.pack_into("<Q", data, at + 8, size)
    results.write_bytes(data)
    with fc.open_results(results) as found:
        assert len(found) == 2
    with fc.ResultWriter(results, MESH, resume=True) as out:
        out.write(step_result(2))
    with fc.open_results(results) as found:
        assert len(list(found)) == 3


@pytest.mark.parametrize("size", [0, 1, 2**40, 2**64 - 1])
def test_a_text_of_another_size_is_refused_at_once(results, size):
    data = bytearray(results.read_bytes())
    for at in objects(data, data.find(HEAP))[:-1]:
        struct.pack_into("<Q", data, at + 8, size)
    results.write_bytes(data)
    refused(FileError, r"its strings are damaged at byte|Expecting|Extra data", fc.open_results, results)


@pytest.mark.parametrize("place", [0, 40, 2**62, 2**64 - 1, "of no number"])
def test_a_text_that_stands_elsewhere_is_refused(results, place):
    data = bytearray(results.read_bytes())
    with h5py.File(results) as file:
        at = file["fastcontact/case"].id.get_offset()
    if place == "of no number":
        struct.pack_into("<I", data, at + 12, 60_000)
    else:
        struct.pack_into("<Q", data, at + 4, place)
    results.write_bytes(data)
    refused(FileError, "its strings are damaged", fc.open_results, results)


def test_texts_in_a_mesh_file_are_not_read(tmp_path):
    path = tmp_path / "mesh.med"
    write_med_mesh(path, MESH)
    with h5py.File(path, "r+") as file:
        file["ENS_MAA/mesh"].attrs["DES"] = ["a text", "of any length"]
    data = bytearray(path.read_bytes())
    struct.pack_into("<Q", data, objects(data, data.find(HEAP))[-1] + 8, 0)
    path.write_bytes(data)
    assert fc.read_mesh(path).n_points == MESH.n_points
    with h5py.File(path, "r+") as file:
        file["ENS_MAA/mesh"].attrs["TYP"] = "a text"
    refused(FileError, r"'TYP' of '/ENS_MAA/mesh' of '.*' is not a plain number: write it again", fc.read_mesh, path)


@pytest.mark.parametrize(
    ("name", "created", "message"),
    [
        ("fastcontact/mesh/points", {"shape": (2**40, 3), "dtype": "f8", "chunks": (1000, 3)}, r"declares 2.64e\+13"),
        ("fastcontact/notes", {"shape": (4,), "maxshape": (None,), "dtype": "u1", "chunks": (2**30,)}, r"1.07e\+09"),
        ("fastcontact/mesh/elements", {"shape": (10**6,), "dtype": h5py.string_dtype()}, "1000000 strings or"),
        ("fastcontact/versions", {"data": ["{}"], "dtype": h5py.string_dtype()}, "is not a string"),
        ("fastcontact/case", {"data": "x", "dtype": h5py.string_dtype(), "chunks": None}, "Expecting value"),
        ("fastcontact/mesh/cell_groups/sizes", {"data": np.zeros(10**6, np.int64)}, r"6 names for sizes of shape"),
    ],
)
def test_result_files_that_declare_too_much(results, name, created, message):
    replaced(results, name, **created)
    refused(FileError, message, fc.open_results, results)


@pytest.mark.parametrize("value", [1.0, "2", [1, 2], h5py.Empty("i8")])
def test_a_schema_that_is_no_whole_number(results, value):
    with h5py.File(results, "r+") as file:
        file["fastcontact"].attrs["schema"] = value
    refused(FileError, r"'schema' of '/fastcontact' is not a whole number|damaged", fc.open_results, results)


def test_a_result_file_behind_a_block_of_others_is_refused(results):
    results.write_bytes(bytes(512) + results.read_bytes())
    refused(FileError, "its superblock differs from that of result files", fc.open_results, results)


def test_unknown_kinds_of_cells_are_listed_in_short(tmp_path):
    path = tmp_path / "kinds.med"
    write_med_mesh(path, MESH)
    with h5py.File(path, "r+") as file:
        cells = next(iter(file["ENS_MAA/mesh"].values()))["MAI"]
        for number in range(2000):
            cells.create_group(f"kind {number:04d}")
    with pytest.raises(MeshError, match=r"0 cells of kind kind 0000, .* 1988 kinds more, which fastcontact") as caught:
        fc.read_mesh(path)
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize("tail", first_of(2, ["", ",", ")", "x"]))
def test_surfaces_as_text_that_are_none(tmp_path, tail):
    """A pattern that goes back and forth takes twice as long with each further point."""
    path = tmp_path / "surface.wkt"
    path.write_text("TIN (((" + "0.0 1.0 0.0, 2.0 0.0 0.02.0 " * 400 + tail)
    refused(FileError, r"meshio cannot read .*surface\.wkt", fc.read_mesh, path)
    path.write_text("TIN (((0 0 0, 1 0. 0, .5 1.0 0, 0 0 0)),((0 0 0, 1. 0 0, 0 -1 0, 0 0 0)))")
    assert fc.read_mesh(path).n_cells == 2


def test_parts_longer_than_the_file(tmp_path):
    path = tmp_path / "points.ply"
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 999999999999\nproperty double x\nproperty double y\n"
    path.write_bytes(
        (head + "property double z\nelement face 1\nproperty list uint8 int32 vertex_indices\nend_header\n").encode()
    )
    with pytest.raises((FileError, MeshError), match=r"points\.ply") as caught:
        fc.read_mesh(path)
    assert not isinstance(caught.value.__cause__, MemoryError)


@pytest.mark.parametrize("name", ["a" * 5000 + ".med", "a\0b.med", "/etc/hostname/mesh.med", "missing.med"])
def test_names_that_no_file_can_have(name):
    with pytest.raises(FileError, match=r"cannot be accessed|does not exist") as caught:
        fc.read_mesh(name)
    assert len(str(caught.value)) < 400


def test_points_that_are_no_numbers(tmp_path):
    path = tmp_path / "points.obj"
    path.write_text("f 1 2 3\n")
    refused((MeshError, FileError), r"points\.obj", fc.read_mesh, path)


def test_gmsh_files_of_more_blocks_than_bytes(tmp_path):
    path = tmp_path / "blocks.msh"
    head = b'$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 1 "A"\n$EndPhysicalNames\n'
    nodes = b"$Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n0 0 0\n1 0 0\n0 1 0\n$EndNodes\n"
    path.write_bytes(head + nodes + b"$Elements\n50000000 1 1 1\n2 1 3 1\n1 1 2 3 4\n$EndElements\n")
    refused(FileError, r"meshio cannot read .*blocks\.msh", fc.read_mesh, path)


# What meshio is made to do with a file, by a module that stands in front of it.
FAKE = """
import os, resource, time

topological_dimension = {}


def read(path, file_format):
    KIND
"""


REASONS = [
    ("while True: pass", "it was not read within 1 s of computing"),
    ("time.sleep(60)", "it was not read within 2 s"),
    ("bytearray(1 << 40)", "it announces more data than the memory can hold"),
    ("os.abort()", "the reading process was ended by SIGABRT"),
    ("os._exit(3)", "the reading process failed: no answer"),
    ("raise RuntimeError('any')", "any"),
    ("raise SystemExit(1)", "SystemExit"),
    ("raise RecursionError", "RecursionError"),
]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows limits neither memory nor computing time")
@pytest.mark.parametrize(("does", "reason"), first_of(4, REASONS))
def test_whatever_meshio_does_to_its_process(tmp_path, monkeypatch, does, reason):
    folder = tmp_path / "fake" / "meshio"
    folder.mkdir(parents=True)
    for name in ("__init__.py", "_mesh.py"):
        (folder / name).write_text(FAKE.replace("KIND", does))
    path = tmp_path / "mesh.vtu"
    path.touch()
    monkeypatch.syspath_prepend(str(folder.parent))
    monkeypatch.setattr(meshio_process, "SECONDS", 1)
    monkeypatch.setattr(meshio_process, "ELAPSED_TO_CPU_TIME", 2 if "sleep" in does else 60)
    assert meshio_process.read_in_process(path, "vtu") == {"error": reason}


def test_a_mesh_that_is_larger_than_its_file_can_mean(tmp_path, monkeypatch):
    path = tmp_path / "mesh.vtu"
    fc.write_mesh(path, MESH)
    for name in ("ANSWER_SIZE", "ANSWER_SIZE_PER_BYTE"):
        monkeypatch.setattr(meshio_process, name, 0)
    refused(FileError, "it contains more than is plausible for a file of its size", fc.read_mesh, path)


@pytest.mark.parametrize("name", ["", "C:/application.exe"])
def test_without_an_interpreter_to_start_files_are_read_in_the_same_process(tmp_path, monkeypatch, name):
    fc.write_mesh(tmp_path / "mesh.vtu", MESH)
    monkeypatch.setattr(sys, "executable", name)
    assert fc.read_mesh(tmp_path / "mesh.vtu").n_cells == MESH.n_cells


def test_when_no_process_can_be_started(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))

    fc.write_mesh(tmp_path / "mesh.vtu", MESH)
    monkeypatch.setattr(subprocess, "run", refuse)
    refused(FileError, r"no process can be started: Cannot allocate memory", fc.read_mesh, tmp_path / "mesh.vtu")


def test_cells_of_several_sizes_are_no_array(tmp_path, monkeypatch):
    cells = [SimpleNamespace(type="polygon", data=[[0, 1, 2], [0, 1, 2, 3]])]
    nothing = {key: {} for key in ("cell_data", "point_data", "cell_sets", "point_sets", "field_data")}
    found = SimpleNamespace(points=[["a"]], cells=cells, **nothing)
    monkeypatch.setattr(meshio_process, "library", lambda: SimpleNamespace(read=lambda *_, **__: found))
    content = meshio_process.plain_content(tmp_path / "mesh.vtu", "vtu")
    assert content == {"points": None, "cells": [["polygon", 2, None]], **nothing, "output": ""}


def test_a_mesh_without_optional_attributes(tmp_path):
    write_med_mesh(tmp_path / "mesh.med", MESH)
    with h5py.File(tmp_path / "mesh.med", "r+") as file:
        for name in ("TYP", "REP"):
            del file["ENS_MAA/mesh"].attrs[name]
    assert fc.read_mesh(tmp_path / "mesh.med").n_points == MESH.n_points


def test_an_abaqus_file_that_includes_another(tmp_path):
    (tmp_path / "other.inp").write_text("*NODE\n1, 0, 0\n")
    (tmp_path / "mesh.inp").write_text("*HEADING\n*include, input=other.inp\n")
    refused(FileError, "includes another file, which is not read: copy its lines", fc.read_mesh, tmp_path / "mesh.inp")


def packed_vtu(path, compressor, pack, megabytes, blocks):
    """Write a mesh whose points are zeros, packed in blocks of 32 kB or in one."""
    size = (1 << 20) * megabytes // blocks
    block = pack(bytes(size))
    head = struct.pack("<III", blocks, size, 0) + struct.pack("<I", len(block)) * blocks
    points = base64.b64encode(head).decode() + base64.b64encode(block * blocks).decode()
    path.write_text(
        '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" header_type="UInt32" '
        f'compressor="vtk{compressor}DataCompressor"><UnstructuredGrid><Piece NumberOfPoints="{(megabytes << 20) // 24}" '
        'NumberOfCells="1"><Points><DataArray type="Float64" Name="Points" NumberOfComponents="3" format="binary">'
        f"{points}</DataArray></Points></Piece></UnstructuredGrid></VTKFile>"
    )


@pytest.mark.skipif(sys.platform == "win32", reason="Windows limits neither memory nor computing time")
@pytest.mark.parametrize(
    ("compressor", "pack", "blocks"),
    [
        ("ZLib", zlib.compress, 12_800),
        pytest.param("ZLib", zlib.compress, 1, marks=pytest.mark.slow),
        ("LZMA", lzma.compress, 400),
    ],
)
def test_a_packed_file_takes_no_more_memory_than_it_may(tmp_path, monkeypatch, compressor, pack, blocks):
    path = tmp_path / "packed.vtu"
    packed_vtu(path, compressor, pack, 400, blocks)
    assert path.stat().st_size < 2_000_000
    monkeypatch.setattr(meshio_process, "MEMORY", 1 << 28)
    refused(FileError, r"it announces more data than the memory can hold", fc.read_mesh, path)


LINES = {
    "msh": "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n",
    "vtu": '<VTKFile type="UnstructuredGrid" version="0.1"><UnstructuredGrid><Piece NumberOfPoints="1" NumberOfCells="1">'
    '<Points><DataArray type="Float64" Name="Points" NumberOfComponents="3" format="ascii">',
    "off": "OFF\n", "su2": "NDIME= 3\nNPOIN= 7\n", "inp": "*NODE\n1, ", "bdf": "BEGIN BULK\nGRID,", "obj": "v ",
    "mesh": "MeshVersionFormatted 2\nDimension 3\nVertices\n1000\n",
}  # fmt: skip


@pytest.mark.skipif(sys.platform == "win32", reason="Windows limits neither memory nor computing time")
@pytest.mark.parametrize("suffix", first_of(3, list(LINES)))
def test_a_line_of_megabytes_is_refused_within_the_limits(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"line.{suffix}"
    path.write_text(LINES[suffix] + ("12," if suffix in ("inp", "bdf") else "12 ") * 1_000_000)
    monkeypatch.setattr(meshio_process, "MEMORY", 1 << 28)
    with pytest.raises((FileError, MeshError)) as caught:
        fc.read_mesh(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 1000


def test_data_sets_that_are_too_large_together(tmp_path, results):
    """A few kilobytes can hold any number of names of one data set of zeros."""
    mesh = tmp_path / "mesh.med"
    write_med_mesh(mesh, MESH)
    fc.write_med_results(tmp_path / "fields.rmed", MESH, [step_result(1)])
    for path in (mesh, tmp_path / "fields.rmed", results):
        with h5py.File(path, "r+") as file:
            file.create_dataset("zeros", (1 << 24,), "f8", chunks=(1 << 20,), compression="gzip")
            for number in range(20):
                file[f"names/{number}"] = file["zeros"]
        with pytest.raises(FileError, match=r"declares more than 1.07e\+09 bytes in total, which a file of its size"):
            fc.open_results(path) if path is results else fc.read_mesh(path)


def test_a_field_of_too_many_instants(tmp_path):
    """Symbolic links inside a file may name one instant as often as one likes."""
    path = tmp_path / "fields.rmed"
    mesh = fc.generate.GENERATORS["box"](divisions=(20, 20, 20))
    points = np.zeros(mesh.points.shape)
    write_med_mesh(path, mesh)
    with h5py.File(path, "r+") as file:
        add_field(file, "DEPL", ("DX", "DY", "DZ"), points, (1, 1.0), "mesh")
        field = file["CHA/DEPL"]
        first = next(iter(field))
        for number in range(6000):
            field[f"{number:040d}"] = h5py.SoftLink(f"/CHA/DEPL/{first}")
    with pytest.raises(
        FileError, match=r"field 'DEPL' of '.*' is an array of 1.33e\+09 bytes, too many for a file of its"
    ):
        fc.read_med_field(path, "DEPL")


@pytest.mark.parametrize("said", DECKS)
def test_lines_of_decks_end_somewhere(tmp_path, said):
    path = tmp_path / "deck.inp"
    path.write_text(DECKS[said])
    refused(fc.CaseError, f"{said}.*the line has more than 65536 characters", fc.read_deck, path)


def test_comments_of_decks_may_have_any_length(tmp_path):
    path = tmp_path / "deck.inp"
    path.write_text("** " + "x" * 100_000 + "\n*HEADING\n")
    refused(fc.CaseError, "the deck has no step", fc.read_deck, path)


@pytest.mark.parametrize("kind", TEXTS)
def test_texts_of_cases_are_no_toml(tmp_path, results, kind):
    path = tmp_path / "case.toml"
    path.write_text(TEXTS[kind])
    refused(fc.CaseError, r"is not valid TOML: ", read_case, path)
    with fc.open_results(results) as found:
        found.case_text = TEXTS[kind]
        assert case_data(found)["title"] == ""
        assert found._units_of_case() == {}


def test_a_case_text_in_results_that_is_too_large_is_not_parsed(results):
    with fc.open_results(results) as found:
        found.case_text = "a = 1\n" + "#" * (1 << 23)
        assert found._units_of_case() == {}


@pytest.mark.parametrize("shape", [(8, 0), (1, 0), (0, 0, 8)])
def test_cells_without_nodes_are_no_cells(shape):
    """A block of eight cells of no node each has nothing in it, and is none of no cells either."""
    if shape[0]:
        with pytest.raises(MeshError, match=r"cells of hex8 must have shape \(n_cells, 8\), not \(\d, 0\)"):
            fc.Mesh(np.zeros((8, 3)), {"hex8": np.empty(shape, int)})
    else:
        assert not fc.Mesh(np.zeros((8, 3)), {"hex8": np.empty(shape, int)}).cells
    with pytest.raises(MeshError):
        build_mesh(np.zeros((8, 3)), [Block("hex8", np.empty(shape, int))], {})


def test_pages_tell_the_limits_of_meshio():
    """Both pages that tell them: memory, and seconds for each megabyte."""
    docs = Path(__file__).parents[4] / "docs" / "reference"
    gib, times = meshio_process.MEMORY >> 30, meshio_process.MEMORY_PER_BYTE
    assert f"to {gib} GiB plus {times} times the size of the file" in (docs / "promises.md").read_text("utf-8")
    told = " ".join((docs / "io.md").read_text("utf-8").split())
    assert f"limited to {gib} GiB plus {times} times the size of the file" in told
    each = meshio_process.SECONDS_PER_BYTE * 1e6
    assert f"its CPU time to {meshio_process.SECONDS:g} s plus {each:g} s per megabyte" in told
