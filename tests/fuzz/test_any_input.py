"""Any bytes, text or table is either read or refused (hypothesis)."""

import tomllib
import warnings

import fuzz_seeds
import fuzz_toml
import numpy as np
import pytest
from fuzz_readers import outcome
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fastcontact._tools.packing import pack, unpack
from fastcontact._tools.toml_text import dump

GOOD = ("read", "refused")
few = settings(
    max_examples=10, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
# What files of a format begin with.
HEADS = {
    ".med": b"\x89HDF\r\n\x1a\n\0\0\0\0\0\x08\x08\0",
    ".vtkhdf": b"\x89HDF\r\n\x1a\n\x02\x08\x08\0",
    ".msh": b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n",
    ".vtu": b'<VTKFile type="UnstructuredGrid" version="0.1"><UnstructuredGrid>',
    ".vtk": b"# vtk DataFile Version 4.2\nx\nASCII\nDATASET UNSTRUCTURED_GRID\n",
    ".inp": b"*NODE\n1, 0.0, 0.0\n",
    ".xdmf": b'<Xdmf Version="3.0"><Domain><Grid>',
    ".toml": b"[mesh]\n",
}


@few
@pytest.mark.usefixtures("meshio_here")
@given(suffix=st.sampled_from(sorted(HEADS)), head=st.booleans(), data=st.binary(max_size=400))
def test_any_bytes(tmp_path, suffix, head, data):
    path = tmp_path / f"any{suffix}"
    path.write_bytes((HEADS[suffix] if head else b"") + data)
    kind, message = outcome(path)
    assert kind in GOOD, message


VALUES = st.recursive(
    st.one_of(
        st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(), st.text(max_size=12),
        st.sampled_from(["half-spheres", "SPHHAU", "CONT1", "mortar", "mesh", "x", "tri3"]),
    ),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=8), inner, max_size=3)),
    max_leaves=6,
)  # fmt: skip


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """A case that is read, as data; its mesh lies beside it."""
    folder = tmp_path_factory.mktemp("case")
    path = fuzz_seeds._case(fuzz_seeds.DATA / "cases" / "forma04a.toml", folder)
    return folder, tomllib.loads(path.read_text(encoding="utf-8"))


@few
@given(place=st.integers(0, 200), key=st.none() | st.text(max_size=8), value=VALUES)
def test_any_value_at_any_place_of_a_case(case, place, key, value):
    folder, data = case
    data = tomllib.loads(dump(data))
    places = list(fuzz_toml._places(data))
    holder, name = places[place % len(places)]
    if key is None or isinstance(holder, list):
        holder[name] = value
    else:
        holder[key] = value
    path = folder / "changed.toml"
    path.write_text(dump(data), encoding="utf-8", errors="replace")
    kind, message = outcome(path)
    assert kind in GOOD, message


ARRAYS = st.builds(
    lambda shape, kind: np.arange(np.prod(shape, dtype=int)).reshape(shape).astype(kind),
    st.lists(st.integers(0, 3), max_size=3), st.sampled_from(["f8", "i4", "u1", "?"]),
)  # fmt: skip
PLAIN = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(allow_nan=False), st.text(), ARRAYS),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=5,
)


def same(one, other):
    if isinstance(one, np.ndarray):
        return isinstance(other, np.ndarray) and one.dtype == other.dtype and np.array_equal(one, other)
    if isinstance(one, (list, dict)):
        keys = one if isinstance(one, dict) else range(len(one))
        return type(one) is type(other) and len(one) == len(other) and all(same(one[k], other[k]) for k in keys)
    return one == other


@few
@given(data=PLAIN, more=st.binary(max_size=20), place=st.integers(0, 10_000), bit=st.integers(0, 7))
def test_what_is_packed_comes_back_and_damage_is_noticed(data, more, place, bit):
    raw = pack(data)
    assert same(unpack(np.concatenate([raw, np.frombuffer(more, np.uint8)])), data)
    changed = raw.copy()
    changed[place % len(raw)] ^= 1 << bit
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = unpack(changed)
        except (ValueError, LookupError, TypeError, AttributeError):
            return
    assert same(found, data)  # a blank or a digit of the head that does not matter
