"""References to other files are refused before opening them: links, external storage, virtual data sets, paths."""

import sys
from xml.etree import ElementTree

import fuzz_seeds
import h5py
import numpy as np
import pytest
from fuzz_worker import Watch
from refusals import refused

import fastcontact as fc
from fastcontact.errors import FileError
from fastcontact.mesh.files.med import write_med_mesh
from fastcontact.results.writer import ResultWriter

WAYS = ("link", "relative link", "outer storage", "virtual")


@pytest.fixture(scope="module")
def solved():
    return fuzz_seeds.contact_case()


@pytest.fixture
def outside(tmp_path):
    """A folder with what must not be touched, watched from when it is full."""
    folder = tmp_path / "outside"
    folder.mkdir()
    with h5py.File(folder / "bait.h5", "w") as file:
        file["numbers"] = np.zeros((1000, 3))
        file.create_group("VTKHDF")
    np.zeros(3000).tofile(folder / "numbers.bin")
    return folder


def lead_out(path, name, way, outside):
    """Let the data set `name` of an HDF5 file stand in another one, in one of several ways."""
    with h5py.File(path, "r+") as file:
        old = file[name]
        shape, dtype, attributes = old.shape, old.dtype, dict(old.attrs)
        del file[name]
        if way == "link":
            file[name] = h5py.ExternalLink(outside / "bait.h5", "/numbers")
            return
        if way == "relative link":
            file[name] = h5py.ExternalLink("outside/bait.h5", "/numbers")
            return
        if way == "outer storage":
            size = int(np.prod(shape)) * dtype.itemsize
            new = file.create_dataset(name, shape, dtype, external=[(outside / "numbers.bin", 0, size)])
        else:
            layout = h5py.VirtualLayout(shape, dtype)
            layout[...] = h5py.VirtualSource(outside / "bait.h5", "numbers", shape=shape)
            new = file.create_virtual_dataset(name, layout)
        new.attrs.update(attributes)


def make(kind, folder, solved):
    """Write a file of a kind; return it, the HDF5 file that holds its numbers, and one of its data sets."""
    model, steps = solved
    path = folder / f"file.{kind}"
    if kind == "med":
        write_med_mesh(path, fuzz_seeds.small_mesh())
        with h5py.File(path) as file:
            step = next(iter(file["ENS_MAA/mesh"]))
        return path, path, f"ENS_MAA/mesh/{step}/NOE/COO"
    if kind == "vtkhdf":
        with ResultWriter(path, model) as out:
            for step in steps:
                out.write(step)
        return path, path, "VTKHDF/PointData/displacement"
    import meshio

    meshio.write(path, fuzz_seeds._for_meshio(fuzz_seeds.solid_mesh(tetrahedra=True))(""), file_format=kind)
    own = path.with_suffix(".h5") if kind == "xdmf" else path
    with h5py.File(own) as file:
        names = []
        file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
    return path, own, names[0]


def read(path):
    if path.suffix == ".vtkhdf":
        with fc.open_results(path) as results:
            list(results)
    else:
        fc.read_mesh(path)


@pytest.mark.each_value
@pytest.mark.skipif(sys.platform != "linux", reason="watching a folder is done as Linux does it")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", ["med", "vtkhdf", "xdmf", "h5m", "hmf", "cgns"])
def test_numbers_in_another_file_are_refused_untouched(tmp_path, outside, solved, kind, way):
    path, own, name = make(kind, tmp_path, solved)
    read(path)
    lead_out(own, name, way, outside)
    watch = Watch(outside)
    refused(FileError, r"another file( at .*)?: copy the data into one file", read, path)
    assert not watch.touched()
    (outside / "bait.h5").read_bytes()
    assert watch.touched()  # it does see


@pytest.mark.skipif(sys.platform != "linux", reason="watching a folder is done as Linux does it")
@pytest.mark.parametrize("place", ["../outside/bait.h5", "{outside}/bait.h5", "linked.h5", "missing.h5"])
@pytest.mark.parametrize("form", ["HDF", "Binary"])
def test_an_xdmf_file_that_names_a_file_elsewhere_is_refused(tmp_path, outside, solved, place, form):
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "linked.h5").symlink_to(outside / "bait.h5")
    path, _, _ = make("xdmf", folder, solved)
    document = ElementTree.parse(path)
    for item in document.iter("DataItem"):
        item.set("Format", form)
        name = place.format(outside=outside)
        item.text = name if form == "Binary" else f"{name}:/numbers"
    document.write(path)
    watch = Watch(outside)
    refused(FileError, r"not beside it|does not exist", read, path)
    assert not watch.touched()


@pytest.mark.skipif(sys.platform != "linux", reason="watching a folder is done as Linux does it")
def test_a_file_that_only_links_to_results_is_no_result_to_write_over(tmp_path, outside, solved):
    path = tmp_path / "linked.vtkhdf"
    with h5py.File(path, "w") as file:
        file["VTKHDF"] = h5py.ExternalLink(outside / "bait.h5", "/VTKHDF")
    before, watch = path.read_bytes(), Watch(outside)
    refused(FileError, "is not a result file", ResultWriter, path, solved[0], overwrite=True)
    refused(FileError, "refers to another file", fc.open_results, path)
    assert not watch.touched()
    assert path.read_bytes() == before
