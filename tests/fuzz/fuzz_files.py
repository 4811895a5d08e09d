"""A damaged file from a seed and a number, always the same."""

import contextlib
import shutil
import zlib
from pathlib import Path

import fuzz_bytes
import fuzz_hdf5
import fuzz_texts
import fuzz_toml
import numpy as np

HDF5 = (".med", ".rmed", ".vtkhdf", ".h5m", ".hmf", ".cgns")
# Our own formats come more often than those of others.
WEIGHTS = {".med": 16, ".rmed": 16, ".vtkhdf": 32, ".toml": 4, ".deck": 24, ".msh": 6, ".vtu": 6}


def kinds(seeds: dict[str, Path]) -> list[str]:
    """Return the names of the seeds, each as often as it shall come."""
    return [name for name, path in sorted(seeds.items()) for _ in range(WEIGHTS.get(path.suffix, 2))]


def chosen(number: int, seed: int, seeds: dict[str, Path]) -> tuple[np.random.Generator, str, str]:
    """Return the random numbers of file `number`, the name of the seed it is made from, and its own name."""
    random = np.random.default_rng([seed, number])
    every = kinds(seeds)
    name = every[int(random.integers(len(every)))]
    suffixes = seeds[name].suffixes
    return random, name, f"{number}{''.join(suffixes[-2:] if suffixes[-1] == '.gz' else suffixes[-1:])}"


def make_file(number: int, seed: int, seeds: dict[str, Path], folder: Path, outside: Path) -> tuple[str, Path]:
    """Write damaged file `number` into `folder`; return the name of its seed and its path."""
    random, name, file_name = chosen(number, seed, seeds)
    source, target = seeds[name], folder / file_name
    shutil.copy(source, target)
    for sibling in source.parent.glob(f"{source.stem}.*"):  # parts of formats of several files
        if sibling.suffix in (".h5", ".ele", ".bin") and source.suffix in (".xdmf", ".node"):
            shutil.copy(sibling, folder / sibling.name)
            target.with_suffix(sibling.suffix).write_bytes(sibling.read_bytes())
    for mesh in source.parent.glob("*.med") if source.suffix == ".toml" else ():
        if not (folder / mesh.name).exists():
            shutil.copy(mesh, folder / mesh.name)
    structured = random.random() < 0.6
    if structured and source.suffix in HDF5:
        with contextlib.suppress(Exception):  # some changes exclude each other; what was done so far stays
            fuzz_hdf5.damage(target, outside, random)
    elif structured and source.suffix == ".toml":
        target.write_text(fuzz_toml.damaged(source.read_text(encoding="utf-8"), random), encoding="utf-8")
    elif structured and source.suffix in fuzz_texts.CHANGED and _is_text(source):
        changed = fuzz_texts.CHANGED[source.suffix](source.read_text(encoding="utf-8"), random)
        target.write_text(changed, encoding="utf-8")
    else:
        others = [seeds[other].read_bytes() for other in _near(name, seeds)]
        target.write_bytes(fuzz_bytes.damaged(source.read_bytes(), random, others)[: 1 << 22])
    return name, target


def _is_text(path: Path) -> bool:
    return b"\0" not in path.read_bytes()


def _near(name: str, seeds: dict[str, Path]) -> list[str]:
    """Return files to splice from: those of the same suffix, and one of any."""
    same = [other for other in sorted(seeds) if seeds[other].suffix == seeds[name].suffix]
    names = sorted(seeds)
    return [*same, names[zlib.crc32(name.encode()) % len(names)]]
