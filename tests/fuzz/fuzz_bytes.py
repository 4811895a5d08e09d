"""Byte-level damage: the same seed gives the same damage."""

import re

import numpy as np

INTEGERS = [0, 1, -1, 127, 128, 255, 256, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63 - 1, -(2**63)]
WORDS = [
    b"999999999999", b"-1", b"0", b"1e308", b"nan", b"inf", b"18446744073709551615", b"4294967297", b"1" * 500,
    b"\xff\xfe", b"../../outside/bait", b"/etc/hostname", b"\0", b"\n" * 50, b"[" * 400, b'"', b"2147483647",
]  # fmt: skip
NUMBER = re.compile(rb"\d+(?:\.\d+)?")


def damaged(data: bytes, random: np.random.Generator, others: list[bytes]) -> bytes:
    """Return `data` with one to six kinds of damage; `others` are files to splice from."""
    for _ in range(1 + int(random.integers(6)) * int(random.integers(2))):
        data = DAMAGES[int(random.integers(len(DAMAGES)))](data, random, others)
    return data


def _place(data: bytes, random: np.random.Generator) -> int:
    # Headers decide most: a third of the damage goes there.
    end = min(len(data), 512) if random.random() < 0.35 else len(data)
    return int(random.integers(max(end, 1)))


def _flip(data: bytes, random: np.random.Generator, others: list[bytes]) -> bytes:
    out = bytearray(data)
    for _ in range(int(random.integers(1, 9))):
        if out:
            out[_place(data, random)] ^= 1 << int(random.integers(8))
    return bytes(out)


def _truncate(data: bytes, random: np.random.Generator, others: list[bytes]) -> bytes:
    return data[: int(random.integers(len(data) + 1))]


def _splice(data: bytes, random: np.random.Generator, others: list[bytes]) -> bytes:
    other = others[int(random.integers(len(others)))]
    return data[: _place(data, random)] + other[_place(other, random) :]


def _repeat(data: bytes, random: np.random.Generator, others: list[bytes]) -> bytes:
    start = _place(data, random)
    block = data[start : start + int(random.integers(1, 200))]
    return data[:start] + block * int(random.integers(2, 40)) + data[start:]


def _delete(data: bytes, random: np.random.Generator, others: list[bytes]) -> bytes:
    start = _place(data, random)
    return data[:start] + data[start + int(random.integers(1, 200)) :]


def _integer(data: bytes, random: np.random.Generator, others: list[bytes]) -> bytes:
    size = int(random.choice([1, 2, 4, 8]))
    value = INTEGERS[int(random.integers(len(INTEGERS)))] % 2 ** (8 * size)
    raw = value.to_bytes(size, "little" if random.random() < 0.7 else "big")
    start = _place(data, random) // size * size
    return data[:start] + raw + data[start + size :]


def _word(data: bytes, random: np.random.Generator, others: list[bytes]) -> bytes:
    start = _place(data, random)
    return data[:start] + WORDS[int(random.integers(len(WORDS)))] + data[start:]


def _number(data: bytes, random: np.random.Generator, others: list[bytes]) -> bytes:
    """Replace one of the numbers of a text."""
    found = list(NUMBER.finditer(data[:200_000]))
    if not found:
        return _integer(data, random, others)
    one = found[int(random.integers(len(found) if random.random() < 0.6 else min(len(found), 20)))]
    return data[: one.start()] + WORDS[int(random.integers(len(WORDS)))] + data[one.end() :]


def _lines(data: bytes, random: np.random.Generator, others: list[bytes]) -> bytes:
    """Swap two lines."""
    lines = data.split(b"\n")
    i, j = random.integers(len(lines), size=2)
    lines[i], lines[j] = lines[j], lines[i]
    return b"\n".join(lines)


DAMAGES = (_flip, _flip, _truncate, _splice, _repeat, _delete, _integer, _integer, _word, _number, _number, _lines)
