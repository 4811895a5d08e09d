"""Keyword blocks of a deck and its included files, with their parameters and data lines, and errors with file and line."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar

from fastcontact.errors import CaseError, FastcontactError, FileError

# Largest size [byte] and largest number of files of a deck with all included files. A larger deck is treated as an error.
MAX_SIZE = 1 << 28
MAX_FILES = 200
# Largest number of characters of a line, or of a keyword with its continuation lines. Abaqus and CalculiX allow far fewer.
LONGEST_LINE = 1 << 16
_BLANKS = rb"(?:[^\S\n]|\xc2\xa0)*"  # also no-break spaces
_KEYWORD_LINE = re.compile(rb"^(?=%s\*(?!\*))" % _BLANKS, re.MULTILINE)
_LONG_LINE = re.compile(rb"^(?!%s\*\*)[^\n]{%d}" % (_BLANKS, LONGEST_LINE + 1), re.MULTILINE)
_TOO_LONG = f"the line has more than {LONGEST_LINE} characters: break it between two entries"
LONGEST_QUOTED = 80  # length to which messages cut names and entries
LARGEST_INTEGER = 1 << 53  # every integer up to this one is exact in double precision
Entry = TypeVar("Entry")


@dataclass(frozen=True, slots=True)
class Location:
    """A line of a file, with its keyword."""

    file: str
    line: int
    keyword: str

    def error(self, text: str) -> CaseError:
        """Return a CaseError whose message is the location followed by `text`."""
        return CaseError(f"{self}: {text}")

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}, *{self.keyword}"


class Located:
    """Base class of deck items with a location, which error messages name."""

    __slots__ = ()
    location: Location

    def error(self, text: str) -> CaseError:
        """Return a CaseError whose message is the location of the item followed by `text`."""
        return self.location.error(text)

    def __str__(self) -> str:
        return str(self.location)


@dataclass(frozen=True, slots=True)
class Item(Located):
    """Base class of deck items that do not change after they are read."""

    location: Location


@dataclass(frozen=True, slots=True)
class Row(Item):
    """A data line: its entries without surrounding blanks, and whether the line ends with a comma (`continued`)."""

    entries: tuple[str, ...]
    continued: bool = False

    def text(self, index: int) -> str:
        """Return an entry, or an empty string if the line has fewer entries."""
        return self.entries[index] if index < len(self.entries) else ""

    def number(self, index: int, default: float | None = None) -> float:
        """Return an entry as a number, or `default` if it is empty.

        Raises CaseError if the entry is not a number, or is empty without a default.
        """
        text = self.text(index)
        if not text:
            if default is None:
                raise self.error(f"entry {index + 1} is missing: a number is needed")
            return default
        return as_number(self.location, text)

    def integer(self, index: int, default: int | None = None) -> int:
        """Return an entry as an integer. Raises CaseError as for `number`, and if the entry is not an integer."""
        value = self.number(index, default)
        if value != int(value) or abs(value) > LARGEST_INTEGER:
            raise self.error(f"'{self.text(index)[:LONGEST_QUOTED]}' is not a whole number")
        return int(value)

    def positive(self, index: int, quantity: str, default: float | None = None) -> float:
        """Return an entry as a positive number; otherwise raise CaseError with the name of the `quantity`."""
        value = self.number(index, default)
        if not value > 0:
            raise self.error(f"the {quantity} {value:g} must be positive")
        return value


@dataclass(frozen=True, slots=True)
class Lines:
    """The data lines of a keyword, from which iteration yields one row at a time; `location` is that of the first line."""

    location: Location
    contents: bytes = field(repr=False)

    def __iter__(self) -> Iterator[Row]:
        # A list of all rows would take several times the memory of the file.
        for number, line in enumerate(BytesIO(self.contents), start=self.location.line):
            text = _text(line)
            if not text.startswith("**"):
                location = Location(self.location.file, number, self.location.keyword)
                yield Row(location, tuple(_entries(text.removesuffix(","))), text.endswith(","))


@dataclass(frozen=True, slots=True)
class Block(Item):
    """A keyword with its parameters and its data lines.

    The names of parameters are in upper case. The value of a parameter without an equals sign is None.
    """

    parameters: dict[str, str | None]
    lines: Iterable[Row] = ()

    @property
    def keyword(self) -> str:
        """The keyword in upper case, without its asterisk."""
        return self.location.keyword

    @property
    def removes_earlier(self) -> bool:
        """Whether OP=NEW removes earlier supports, loads or temperatures of the keyword."""
        return self.choice("OP", ("MOD", "NEW")) == "NEW"

    @property
    def rows(self) -> list[Row]:
        """The data lines that are not empty."""
        return list(self.iter_rows())

    def iter_rows(self) -> Iterator[Row]:
        """Return an iterator over the data lines that are not empty."""
        return (row for row in self.lines if any(row.entries))

    def numbers(self) -> list[float]:
        """Return the numbers in all data lines. Raises CaseError if an entry is not a number."""
        return [row.number(i) for row in self.iter_rows() for i, text in enumerate(row.entries) if text]

    def only_row(self, variable: str = "") -> Row:
        """Return the only data line. Raises CaseError unless there is exactly one.

        If `variable` is given, the message adds that constants that depend on it are not supported.
        """
        rows = self.rows
        if len(rows) != 1:
            text = f"{len(rows)} data lines, but one is needed"
            raise self.error(text + (f": constants that depend on {variable} are not supported" if variable else ""))
        return rows[0]

    def get(self, name: str, default: str = "") -> str:
        """Return the value of a parameter, or `default` if it is missing or has no value."""
        return self.parameters.get(name) or default

    def choice(self, name: str, known: tuple[str, ...]) -> str:
        """Return a parameter as one of the `known` values, by default the first. Raises CaseError for any other value."""
        value = self.get(name, known[0]).upper()
        for option in known:
            if value.replace(" ", "") == option.replace(" ", ""):
                return option
        raise self.error(f"{name}={value[:LONGEST_QUOTED]} is not supported; expected one of {', '.join(known)}")

    def required(self, name: str) -> str:
        """Return the value of a parameter. Raises CaseError if it is missing or has no value."""
        value = self.parameters.get(name)
        if not value:
            raise self.error(f"the parameter {name} is missing")
        return value


@dataclass
class Source:
    """State of reading: folder of the deck, size [byte] and paths of the files read so far, and files being read."""

    folder: Path
    size: int = 0
    files: list[Path] = field(default_factory=list)
    open_files: list[Path] = field(default_factory=list)


def as_number(location: Location, text: str) -> float:
    """Return the number that `text` states, also in Fortran notation (1.D5).

    Raises CaseError unless it is a finite number.
    """
    try:
        value = float(text.upper().replace("D", "E")) if text[:1].upper() not in "IN" else float("nan")
    except ValueError:
        raise location.error(f"'{text[:LONGEST_QUOTED]}' is not a number") from None
    if "_" in text or value != value or value in (float("inf"), float("-inf")):
        raise location.error(f"'{text[:LONGEST_QUOTED]}' is not a usable number")
    return value


def unquoted(text: str) -> str:
    """Return a name without the quotation marks around it."""
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text


def key_of(name: str) -> str:
    """Return a name in the form used for look-up: in upper case, without quotation marks."""
    return name.replace('"', "").strip().upper()


def read_blocks(path: Path) -> Iterator[Block]:
    """Return an iterator over the blocks of a deck, with each *INCLUDE replaced by the blocks of its file.

    Raises
    ------
    FileError
        If a file cannot be read, or if there are too many files or they are too large.
    CaseError
        If a line is invalid or the file of an *INCLUDE is not accepted; the message names file and line.
    """
    return _blocks(path, path.name, Source(path.resolve().parent))


def files_of_deck(path: Path) -> list[Path]:
    """Return the paths of a deck and of its included files in reading order; errors as for `read_blocks`."""
    source = Source(path.resolve().parent)
    for _ in _blocks(path, path.name, source):
        pass
    return source.files


def _contents(path: Path, source: Source) -> bytes:
    """Return the contents of a file with Unix line endings.

    Raises FileError if it cannot be read or the deck becomes too large.
    """
    source.files.append(path)
    try:
        source.size += path.stat().st_size
        if source.size > MAX_SIZE or len(source.files) > MAX_FILES:
            raise FileError(f"'{path}' and its included files have more than {MAX_SIZE >> 20} MiB or {MAX_FILES} files")
        contents = path.read_bytes().removeprefix(BOM_UTF8)
    except OSError as error:
        raise FileError(f"cannot read '{path}': {error.strerror or error}") from error
    return contents.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _blocks(path: Path, name: str, source: Source) -> Iterator[Block]:
    """Yield the blocks of a file and of its included files. Raises CaseError if data precede the first keyword."""
    source.open_files.append(path.resolve())
    preamble, *blocks = _KEYWORD_LINE.split(_contents(path, source))
    start = Location(name, 1, "")
    _check_lengths(start, preamble)
    _check_empty(Lines(start, preamble))
    number = 1 + preamble.count(b"\n")
    for contents in blocks:
        block = _block(name, number, contents)
        if block.keyword == "INCLUDE":
            yield from _included_blocks(block, source)
            _check_empty(block.lines)
        else:
            yield block
        number += contents.count(b"\n")
    source.open_files.pop()


def _check_lengths(location: Location, contents: bytes) -> None:
    """Raise CaseError if a line of `contents`, which begin at a location, is too long."""
    if match := _LONG_LINE.search(contents):
        raise replace(location, line=location.line + contents.count(b"\n", 0, match.start())).error(_TOO_LONG)


def _check_empty(lines: Iterable[Row]) -> None:
    """Raise CaseError if there are data in lines that belong to no keyword."""
    for row in lines:
        if any(row.entries):
            raise replace(row.location, keyword="").error("a data line before any keyword")


def _block(name: str, number: int, contents: bytes) -> Block:
    """Return the block that begins in line `number` of a file: a keyword line with its continuation lines, and data lines.

    A keyword line that ends with a comma is continued in the next line.
    """
    lines = BytesIO(contents)
    text, n_lines = _text(lines.readline()), 1
    location = Location(name, number, _keyword(text))
    _check_lengths(location, contents)
    while text.endswith(",") and (line := lines.readline()):
        n_lines += 1
        if not (continuation := _text(line)).startswith("**"):
            text += f" {continuation}"
        if len(text) > LONGEST_LINE:
            raise location.error(_TOO_LONG)
    return Block(location, _parameters(location, text), Lines(replace(location, line=number + n_lines), lines.read()))


def _text(line: bytes) -> str:
    """Return the text of a line without surrounding blanks."""
    return line.decode("utf-8", "replace").strip()


def _keyword(line: str) -> str:
    """Return the keyword of a line in upper case, without its asterisk."""
    return " ".join(line[1:].partition(",")[0].upper().split())[:LONGEST_QUOTED]


def _entries(line: str) -> list[str]:
    """Return the entries of a line, which are separated by commas outside quotation marks, without surrounding blanks."""
    if '"' not in line:
        return [entry.strip() for entry in line.split(",")]
    entries = [""]
    for number, piece in enumerate(line.split('"')):
        if number % 2:  # between quotation marks
            entries[-1] += f'"{piece}"'
        else:
            first, *others = piece.split(",")
            entries[-1] += first
            entries += others
    return [entry.strip() for entry in entries]


def _parameters(location: Location, line: str) -> dict[str, str | None]:
    """Return the parameters of a keyword line. Raises CaseError if a parameter is repeated."""
    parameters: dict[str, str | None] = {}
    for entry in _entries(line)[1:]:
        key, equal, value = entry.partition("=")
        key = " ".join(key.upper().split())
        if key in parameters:
            raise location.error(f"the parameter {key} is given twice")
        if key:
            parameters[key] = unquoted(value.strip()) if equal else None
    return parameters


def _included_blocks(block: Block, source: Source) -> Iterator[Block]:
    """Yield the blocks of the file that an *INCLUDE names.

    Raises CaseError unless the file exists in the folder of the deck or below.
    """
    file_name = block.required("INPUT")
    for parameter in block.parameters:
        if parameter != "INPUT":
            raise block.error(f"the parameter {parameter} is not supported")
    shown, path = file_name[:LONGEST_QUOTED], source.folder / file_name.replace("\\", "/")
    try:
        target = path.resolve()
        inside = target.is_relative_to(source.folder)
        exists = inside and target.is_file()
    except (OSError, ValueError, RuntimeError):
        raise block.error(f"'{shown}' is not a file name") from None
    if not inside:
        raise block.error(f"'{shown}' is outside the folder of the deck: copy the file into or below '{source.folder}'")
    if not exists:
        raise block.error(f"file '{shown}' not found beside the deck, in '{source.folder}'")
    if target in source.open_files:
        target_name = "the deck" if target == source.open_files[0] else f"'{shown}'"
        raise block.error(f"{target_name} includes itself")
    yield from _blocks(target, file_name, source)


@contextmanager
def errors_at(location: Location | Located, prefix: str = "") -> Iterator[None]:
    """Convert errors of the package in a ``with`` block to CaseError at a location; `prefix` precedes the message."""
    try:
        yield
    except CaseError:  # its message already names a location
        raise
    except FastcontactError as error:
        raise location.error(f"{prefix}{error}") from error


def register(kind: str, name: str, table: dict[str, Entry], entry: Entry, location: Location | Located) -> Entry:
    """Add an entry to a table by its name and return the entry. Raises CaseError if the table already has the name.

    `kind` describes the entry in messages, for example "orientation".
    """
    if key_of(name) in table:
        raise location.error(f"{kind} '{name}' is defined twice")
    table[key_of(name)] = entry
    return entry


def look_up(kind: str, name: str, table: Mapping[str, Any], location: Location | Located) -> Any:
    """Return an entry of a table by its name. Raises CaseError, with the names of all entries, if there is none."""
    if key_of(name) not in table:
        names = ", ".join(entry.name for entry in table.values()) or "none"
        raise location.error(f"{kind} '{name}' is not defined; {kind.rpartition(' ')[2]}s: {names}")
    return table[key_of(name)]
