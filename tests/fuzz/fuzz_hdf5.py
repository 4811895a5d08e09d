"""Damage inside valid HDF5 files: other shapes, types, links, attributes, storage."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np

BAIT = "bait.h5"
NAMES = ["NOE", "a/b", "..", ".", "é" * 30, "x" * 300, "NBR", "\x01", " ", "COO", "%s", "FAS"]


def damage(path: Path, outside: Path, random: np.random.Generator) -> None:
    """Damage an HDF5 file in place; links to other files go to the bait in `outside`."""
    for _ in range(1 + int(random.integers(3))):
        with h5py.File(path, "r+") as file:
            groups, datasets = _objects(file)
            CHANGES[int(random.integers(len(CHANGES)))](file, groups, datasets, outside, random)


def _objects(file: Any) -> tuple[list[Any], list[Any]]:
    groups, datasets = [file], []
    file.visititems(lambda _, item: (groups if isinstance(item, h5py.Group) else datasets).append(item))
    return groups, datasets


def _any(items: list[Any], random: np.random.Generator) -> Any:
    return items[int(random.integers(len(items)))]


def _replace(dataset: Any, **created: Any) -> None:
    parent, name, attributes = dataset.parent, dataset.name.rsplit("/", 1)[1], dict(dataset.attrs)
    del parent[name]
    new = parent.create_dataset(name, **created)
    for key, value in attributes.items():
        new.attrs[key] = value


def _shape(file: Any, groups: list[Any], datasets: list[Any], outside: Path, random: np.random.Generator) -> None:
    dataset = _any(datasets, random)
    shapes = [(), (0,), (1,), (3,), (2, 3), (7, 1, 2), (1000,), (*dataset.shape, 1)]
    _replace(dataset, shape=_any(shapes, random), dtype=dataset.dtype)


def _type(file: Any, groups: list[Any], datasets: list[Any], outside: Path, random: np.random.Generator) -> None:
    types = ["f4", "i1", "u8", ">i4", "S5", "c16", "?", h5py.string_dtype(), h5py.ref_dtype, h5py.regionref_dtype,
             h5py.vlen_dtype(np.int32), np.dtype([("a", "i4"), ("b", "f8")]), h5py.opaque_dtype("M8[s]"),
             h5py.enum_dtype({"A": 0}), np.dtype(("f8", (3,)))]  # fmt: skip
    dataset = _any(datasets, random)
    _replace(dataset, shape=dataset.shape, dtype=_any(types, random))


def _huge(file: Any, groups: list[Any], datasets: list[Any], outside: Path, random: np.random.Generator) -> None:
    dataset = _any(datasets, random)
    kind = int(random.integers(4))
    n = int(_any([2**27, 2**31, 2**40, 2**60], random))
    dtype = dataset.dtype if dataset.dtype.kind in "iuf" else np.dtype("f8")
    if kind == 0:  # never allocated
        _replace(dataset, shape=(n // dtype.itemsize,), dtype=dtype, chunks=(1024,))
    elif kind == 1:  # one huge chunk of a small data set
        chunk = min(n, 2**31) // dtype.itemsize
        _replace(dataset, shape=(4,), maxshape=(None,), dtype=dtype, chunks=(chunk,), compression="gzip")
    elif kind == 2:  # contiguous beyond the end of the file
        space = h5py.h5s.create_simple((n // dtype.itemsize,))
        parent, name = dataset.parent, dataset.name.rsplit("/", 1)[1]
        del parent[name]
        settings = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        settings.set_alloc_time(h5py.h5d.ALLOC_TIME_LATE)
        h5py.h5d.create(parent.id, name.encode(), h5py.h5t.py_create(dtype), space, settings)
    else:  # a bomb: 300 MB of zeros in 300 kB
        _replace(dataset, shape=(40 * 2**20,), dtype="f8", chunks=(2**20,), compression="gzip")
        dataset = file[dataset.name] if dataset else None
        for name in list(_paths(file)):
            if file[name].shape == (40 * 2**20,):
                for start in range(0, 40, 8):
                    file[name][start * 2**20 : (start + 1) * 2**20] = 0.0


def _paths(file: Any) -> list[str]:
    return [item.name for item in _objects(file)[1]]


def _values(file: Any, groups: list[Any], datasets: list[Any], outside: Path, random: np.random.Generator) -> None:
    """Put a few wild numbers into a data set."""
    found = [d for d in datasets if d.dtype.kind in "iuf" and d.size]
    if not found:
        return
    dataset = _any(found, random)
    flat = np.atleast_1d(dataset[()]).reshape(-1)
    for _ in range(int(random.integers(1, 5))):
        if flat.dtype.kind == "f":
            new = _any([np.nan, np.inf, -np.inf, 1e308, -1.0, 0.0, 5e-324], random)
        else:
            info = np.iinfo(flat.dtype)
            new = _any([info.min, info.max, 0, 1, len(flat), min(info.max, 10**6)], random)
        flat[int(random.integers(len(flat)))] = new
    dataset[...] = flat.reshape(dataset.shape)


def _resize(file: Any, groups: list[Any], datasets: list[Any], outside: Path, random: np.random.Generator) -> None:
    """Cut or lengthen a data set, its values kept."""
    dataset = _any(datasets, random)
    if not dataset.shape:
        return
    values = dataset[()][: int(random.integers(len(dataset) + 1))]
    if random.random() < 0.5:
        values = np.concatenate([values, values])
    _replace(dataset, data=values)


def _attribute(file: Any, groups: list[Any], datasets: list[Any], outside: Path, random: np.random.Generator) -> None:
    holder = _any([item for item in [*groups, *datasets] if len(item.attrs)], random)
    key = _any(sorted(holder.attrs), random)
    if int(random.integers(3)) == 0:
        del holder.attrs[key]
        return
    wild = [
        2**31 - 1, -1, 0, 2**62, np.nan, np.inf, "text", b"\xff\xfe\0", np.arange(5), np.zeros(0), h5py.Empty("f8"),
        np.array(["a", "b"], dtype=h5py.string_dtype()), file.ref, np.uint64(2**64 - 1), 1.5, "é" * 100, [[1, 2]], True,
    ]  # fmt: skip
    holder.attrs[key] = _any(wild, random)


def _link(file: Any, groups: list[Any], datasets: list[Any], outside: Path, random: np.random.Generator) -> None:
    """Replace an object by a link: into another file, into nothing, around a circle, up the tree."""
    item = _any([*groups[1:], *datasets], random)
    parent, name, path = item.parent, item.name.rsplit("/", 1)[1], item.name
    links = [
        lambda: h5py.ExternalLink(str(outside / BAIT), "/ENS_MAA"),
        lambda: h5py.ExternalLink(f"../{outside.name}/{BAIT}", "/"),
        lambda: h5py.SoftLink(path),
        lambda: h5py.SoftLink("/nowhere"),
        lambda: h5py.SoftLink(f"{path}/../{name}/{name}"),
        lambda: file["/"],
        lambda: parent,
    ]
    link = _any(links, random)()
    if random.random() < 0.3:
        name = "more"
    if name in parent:
        del parent[name]
    parent[name] = link


def _storage(file: Any, groups: list[Any], datasets: list[Any], outside: Path, random: np.random.Generator) -> None:
    """Move a data set's values into another file."""
    dataset = _any(datasets, random)
    dtype = dataset.dtype if dataset.dtype.kind in "iuf" else np.dtype("i4")
    bait = str(outside / BAIT)
    if random.random() < 0.5:
        _replace(dataset, shape=dataset.shape or (1,), dtype=dtype, external=[(bait, 0, h5py.h5f.UNLIMITED)])
        return
    shape, name, parent = dataset.shape or (1,), dataset.name.rsplit("/", 1)[1], dataset.parent
    layout = h5py.VirtualLayout(shape=shape, dtype=dtype)
    layout[...] = h5py.VirtualSource(_any([bait, "."], random), "numbers", shape=shape)
    del parent[name]
    parent.create_virtual_dataset(name, layout)


def _filter(file: Any, groups: list[Any], datasets: list[Any], outside: Path, random: np.random.Generator) -> None:
    """Use another filter, or break a compressed chunk."""
    found = [d for d in datasets if d.dtype.kind in "iuf" and d.size and d.shape]
    if not found:
        return
    dataset = _any(found, random)
    options = _any([{"compression": "lzf"}, {"compression": "gzip"}, {"fletcher32": True}, {"shuffle": True}], random)
    name, values = dataset.name, dataset[()]
    _replace(dataset, data=values, chunks=values.shape, **options)
    if random.random() < 0.6:
        raw = random.integers(0, 256, size=int(random.integers(1, 400)), dtype=np.uint8).tobytes()
        file[name].id.write_direct_chunk((0,) * values.ndim, raw)


def _rename(file: Any, groups: list[Any], datasets: list[Any], outside: Path, random: np.random.Generator) -> None:
    item = _any([*groups[1:], *datasets], random)
    name = _any(NAMES, random)
    parent, old = item.parent, item.name.rsplit("/", 1)[1]
    if name not in parent:
        file.copy(item, parent, name=name)
        if random.random() < 0.7:
            del parent[old]


def _delete(file: Any, groups: list[Any], datasets: list[Any], outside: Path, random: np.random.Generator) -> None:
    del file[_any([*groups[1:], *datasets], random).name]


def _exchange(file: Any, groups: list[Any], datasets: list[Any], outside: Path, random: np.random.Generator) -> None:
    """Put a group where a data set stood, or the other way round."""
    item = _any([*groups[1:], *datasets], random)
    name, was_group = item.name, isinstance(item, h5py.Group)
    del file[name]
    if was_group:
        file[name] = np.arange(4)
    else:
        file.create_group(name)


def _deep(file: Any, groups: list[Any], datasets: list[Any], outside: Path, random: np.random.Generator) -> None:
    """Nest groups, or give a group very many members."""
    group = _any(groups, random)
    if random.random() < 0.5:
        for _ in range(300):
            group = group.require_group("d")
    else:
        for number in range(2000):
            group.create_group(f"m{number}")


CHANGES = (
    _shape, _type, _type, _huge, _values, _values, _values, _resize, _resize, _attribute, _attribute, _attribute,
    _link, _link, _storage, _filter, _rename, _delete, _exchange, _deep,
)  # fmt: skip
