"""Rare mistakes with files: functions that provoke them, the class of error, a pattern of the message.

No function names a device or anything else outside the folder it is given: a check that is missing could destroy it.
"""
# ruff: noqa: E501 (messages stay in one piece)

import errno
import os
import zlib
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
from library import blocks, square

import fastcontact as fc
from fastcontact._tools import hdf5, packing, paths
from fastcontact.cases import case as cases
from fastcontact.cli import _outputs, _results
from fastcontact.cli._outputs import write_json
from fastcontact.mesh.files import abaqus
from fastcontact.mesh.files.meshio_content import build_mesh


def solved(folder):
    """A result file of one step."""
    model = blocks()
    with fc.ResultWriter(folder / "run.vtkhdf", model) as out:
        fc.solve(model, fc.linear_ramp(1), on_step=out.write)
    return folder / "run.vtkhdf"


def refusing(number):
    def refuse(*_, **__):
        raise OSError(number, os.strerror(number))

    return refuse


def full(patch, work):
    patch.setattr(Path, "write_text", refusing(errno.ENOSPC))
    work("a.json", {})


def opened(folder, change):
    with h5py.File(folder / "spoilt.h5", "w") as file:
        change(file)
    with hdf5.open_hdf5(folder / "spoilt.h5") as file:
        return hdf5.values(file, "a")


def circle(file):
    file.create_group("one/two")
    file["one/two/one"] = file["one"]


def lzf(file):
    file.create_dataset("a", data=np.zeros(1000), chunks=(100,), compression="lzf")


def texts(file):
    file.create_dataset("a", data=["no", "numbers"], dtype=h5py.string_dtype())


def pipe(folder):
    os.mkfifo(folder / "pipe.med")
    fc.read_mesh(folder / "pipe.med")


def vanished(folder):
    with paths.replacing(folder / "a.txt") as temporary:
        temporary.unlink()


def packed_of_another_kind():
    raw = packing.pack({"a": np.arange(3.0)}).tobytes().replace(b"<f8", b"|O8")
    line, _, body = raw.partition(b"\n")
    old = b"%d" % zlib.crc32(body.replace(b"|O8", b"<f8"))
    packing.unpack(np.frombuffer(line.replace(old, b"%d" % zlib.crc32(body)) + b"\n" + body, np.uint8))


def packed_and_changed():
    values = packing.pack({"a": np.arange(3.0)}).copy()
    values[-1] ^= 1
    packing.unpack(values)


def resulting(folder, change):
    """Change a result file, and read its last step."""
    path = solved(folder)
    with h5py.File(path, "r+") as file:
        change(file)
    with fc.open_results(path) as results:
        assert results[-1].contact


def kinematics_in_numbers(file):
    del file["fastcontact/kinematics"]
    file["fastcontact/kinematics"] = "3"


def broken_point_numbers(file):
    pair = next(iter(file["fastcontact/contact"].values()))
    rows = pair["rows"][()]
    kinds = [(name, float if name == "points" else rows.dtype[name]) for name in rows.dtype.names]
    del pair["rows"]
    pair["rows"] = rows.astype(kinds)


def cell_field_cut_off(file):
    file["VTKHDF/CellData"].create_dataset("error", data=np.zeros(len(file["VTKHDF/Types"]) - 1))


def announced(folder):
    fc.ResultWriter(folder / "a.vtkhdf", square(BOTTOM="xy"), cell_fields=["two words"])


def not_announced(folder):
    model = square(BOTTOM="xy")
    with fc.ResultWriter(folder / "a.vtkhdf", model, cell_fields=["error"]) as out:
        fc.solve(model, fc.linear_ramp(1), on_step=out.write)


def changed_by_others(folder, patch):
    model = square(BOTTOM="xy")
    with fc.ResultWriter(folder / "a.vtkhdf", model) as out:
        patch.setattr(type(out._committed), "is_intact", lambda self: False)
        fc.solve(model, fc.linear_ramp(1), on_step=out.write)


def no_step_yet(folder):
    fc.ResultWriter(folder / "a.vtkhdf", square(BOTTOM="xy")).close()
    with fc.open_results(folder / "a.vtkhdf") as results:
        _results.select_step(results, -1)


def unexpected(patch):
    def fail(*_, **__):
        raise OverflowError("too large")

    patch.setattr(cases, "build_case", fail)
    cases.read_case("forma04a")


def picture_on_a_full_disk():
    _outputs.save(SimpleNamespace(figure=SimpleNamespace(savefig=refusing(errno.ENOSPC))), "a.png")


def of_ansys(folder):
    (folder / "a.msh").write_text('(0 "GAMBIT to Fluent File")\n')
    fc.read_mesh(folder / "a.msh")


def steps_announced(file):
    file["VTKHDF/Steps"].attrs["NSteps"] = 2


CALLS = [
    ("a mesh of Ansys with Gmsh's suffix", of_ansys, fc.errors.FileError, r"a\.msh' is not a Gmsh file, which starts with \$MeshFormat: convert it to \.med"),
    ("a result with fewer steps than it says", lambda folder: resulting(folder, steps_announced), fc.errors.FileError, r"only 1 of 2 steps"),
    ("a case with a name beyond all limits", lambda: cases.read_case("a" * 5000 + ".toml"), fc.errors.CaseError, r"cannot look for the case file 'a+' \(File name too long\)"),
    ("a case with a value of another size", unexpected, fc.errors.CaseError, r"a value is of the wrong kind or size \(too large\): see the ready-made cases"),
    ("a picture on a full disk", picture_on_a_full_disk, fc.errors.FileError, r"'a\.png' cannot be written \(No space left on device\)"),
    ("a picture without contact", lambda: _outputs.profile_picture(None, SimpleNamespace(contact={}), "a.png"), fc.errors.FastcontactError, r"there is no contact pair whose pressure could be plotted"),
    ("a step of no steps", no_step_yet, fc.errors.CaseError, r"a\.vtkhdf' contains no finished step yet"),
    ("a pair of a result without contact", lambda: _results.select_contact(SimpleNamespace(contact=None), SimpleNamespace(contact={})), fc.errors.CaseError, r"this result contains no contact pair"),
    ("figures of benchmarks on a full disk", lambda patch: full(patch, write_json), fc.errors.FileError, r"'a\.json' cannot be written \(No space left on device\)"),
    ("a summary on a full disk", lambda patch: full(patch, write_json), fc.errors.FileError, r"'a\.json' cannot be written \(No space left on device\)"),
    ("a mesh from a pipe", pipe, fc.errors.FileError, r"pipe\.med' is a device or a pipe: name a regular file"),
    ("a file that was never made", vanished, fc.errors.FileError, r"a\.txt' cannot be written \(No such file or directory\)"),
    ("an Abaqus file that cannot be read", lambda folder: abaqus.check_readable(folder), fc.errors.FileError, r"cannot read '.*': .*Is a directory"),
    ("coordinates in words", lambda: build_mesh([["a", "b"]], [], {}), fc.MeshError, r"its coordinates are not numbers: check that the file is complete"),
    ("an HDF5 file with groups in a circle", lambda folder: opened(folder, circle), fc.errors.FileError, r"spoilt\.h5' has cyclic or too deeply nested groups at '.*': write it again"),
    ("an HDF5 file with a strange filter", lambda folder: opened(folder, lzf), fc.errors.FileError, r"is compressed with the filter 32000, which HDF5 may lack: use gzip"),
    ("an HDF5 file with texts for numbers", lambda folder: opened(folder, texts), fc.errors.FileError, r"contains no plain numbers: the file is damaged; write it again"),
    ("packed data without head", lambda: packing.unpack(np.zeros(300, np.uint8)), ValueError, r"no packed data"),
    ("packed data that were changed", packed_and_changed, ValueError, r"packed data are cut off or changed"),
    ("packed data of another kind", packed_of_another_kind, ValueError, r"an array of \|O8 is not a packed array"),
    ("a result whose kinematics are a number", lambda folder: resulting(folder, kinematics_in_numbers), fc.errors.FileError, r"its kinematics or its case is not text"),
    ("a result whose point numbers are broken", lambda folder: resulting(folder, broken_point_numbers), fc.errors.FileError, r"the contact table of 'pair' has the wrong shape or type"),
    ("a result with a cell field cut off", lambda folder: resulting(folder, cell_field_cut_off), fc.errors.FileError, r"error of step 0 is truncated, or has the wrong shape or type"),
    ("a cell field with a name of two words", announced, fc.errors.FileError, r"'two words' cannot be the name of a cell field: it is reserved or not an identifier; choose another"),
    ("a cell field that never came", not_announced, fc.errors.FileError, r"step 1: the declared cell field 'error' has shape \(0,\), but \(4,\) is needed, a number for each solid cell"),
    ("a result file that others change", changed_by_others, fc.errors.FileError, r"a\.vtkhdf' was changed by another program after 0 steps, and its contents are left unchanged: let no other program write to it"),
]  # fmt: skip
