"""Keyword blocks of a deck: keyword, parameters and data lines; errors with file and line; included files in place."""

from __future__ import annotations

from codecs import BOM_UTF8
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from fastcontact.errors import CaseError, FastcontactError, FileError

# Largest number of bytes of a deck with all included files, and of such files: a deck with more is taken for an error.
LARGEST = 1 << 28
MOST_FILES = 200
# Largest number of characters of a line, or of a keyword with its continuation lines; both programs allow far fewer.
LONGEST_LINE = 1 << 16
_TOO_LONG = f"the line has more than {LONGEST_LINE} characters: end it where its entries end"
LONGEST_QUOTED = 80
LARGEST_WHOLE = 1 << 53  # beyond, not every integer is a floating-point number
Entry = TypeVar("Entry")


@dataclass(frozen=True, slots=True)
class Location:
    """A line of a file, with the keyword it belongs to."""

    file: str
    line: int
    keyword: str

    def refuse(self, text: str) -> CaseError:
        """Return the error for this location with a text."""
        return CaseError(f"{self}: {text}")

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}, *{self.keyword}"


class Located:
    """Base class of deck items with a `location`, which error messages name."""

    __slots__ = ()
    location: Location

    def refuse(self, text: str) -> CaseError:
        """Return an error at the location of the item."""
        return self.location.refuse(text)

    def __str__(self) -> str:
        return str(self.location)


@dataclass(frozen=True, slots=True)
class Item(Located):
    """A deck item that does not change once it is read."""

    location: Location


@dataclass(frozen=True, slots=True)
class Row(Item):
    """A data line: its entries without surrounding blanks, and its location."""

    entries: tuple[str, ...]
    goes_on: bool = False

    def text(self, index: int) -> str:
        """Return an entry, empty where the line ends before it."""
        return self.entries[index] if index < len(self.entries) else ""

    def number(self, index: int, default: float | None = None) -> float:
        """Return an entry as a number, or `default` where it is empty; raises CaseError if it is missing or no number."""
        text = self.text(index)
        if not text:
            if default is None:
                raise self.refuse(f"entry {index + 1} is missing: a number is needed")
            return default
        return as_number(self.location, text)

    def whole(self, index: int, default: int | None = None) -> int:
        """Return an entry as a whole number; errors as for `number`."""
        value = self.number(index, default)
        if value != int(value) or abs(value) > LARGEST_WHOLE:
            raise self.refuse(f"'{self.text(index)[:LONGEST_QUOTED]}' is not a whole number")
        return int(value)

    def positive(self, index: int, quantity: str) -> float:
        """Return an entry as a positive number; the error names the `quantity`."""
        value = self.number(index)
        if not value > 0:
            raise self.refuse(f"the {quantity} {value:g} must be positive")
        return value


@dataclass(frozen=True, slots=True)
class Lines:
    """The data lines of a keyword in the contents of a file, from a line number on; rows are made on demand."""

    location: Location
    contents: bytes = field(repr=False)
    begin: int
    end: int

    def __iter__(self) -> Iterator[Row]:
        for line in _lines(self.contents, self.begin, self.end, self.location.line):
            if not line.text.startswith("**"):
                yield _row(Location(self.location.file, line.number, self.location.keyword), line.text)


@dataclass(frozen=True, slots=True)
class Block(Item):
    """A keyword with its parameters (names in upper case, without values None) and all its data lines."""

    parameters: dict[str, str | None]
    lines: Iterable[Row] = ()

    @property
    def keyword(self) -> str:
        """Return the keyword in upper case, without its asterisk."""
        return self.location.keyword

    @property
    def rows(self) -> list[Row]:
        """Return the data lines that are not empty."""
        return list(self.each())

    def each(self) -> Iterator[Row]:
        """Yield `rows`, one at a time."""
        return (row for row in self.lines if any(row.entries))

    def numbers(self) -> list[float]:
        """Return the entries of all data lines, which are numbers."""
        return [row.number(i) for row in self.each() for i, text in enumerate(row.entries) if text]

    def only(self, why: str = "") -> Row:
        """Return the only data line; raises CaseError if there are several: constants that depend on `why`."""
        rows = self.rows
        if len(rows) != 1:
            text = f"{len(rows)} data lines where one is needed"
            raise self.refuse(text + (f": constants that depend on {why} are not supported" if why else ""))
        return rows[0]

    def get(self, name: str, default: str = "") -> str:
        """Return the value of a parameter, or `default` where it is missing or has no value."""
        return self.parameters.get(name) or default

    def choice(self, name: str, known: tuple[str, ...]) -> str:
        """Return the value of a parameter in upper case, by default the first of `known`; raises CaseError for any other."""
        value = self.get(name, known[0]).upper()
        for option in known:
            if value.replace(" ", "") == option.replace(" ", ""):
                return option
        raise self.refuse(f"{name}={value[:LONGEST_QUOTED]} is not supported; known are {', '.join(known)}")

    def required(self, name: str) -> str:
        """Return the value of a parameter; raises CaseError if there is none."""
        value = self.parameters.get(name)
        if not value:
            raise self.refuse(f"the parameter {name} is missing")
        return value


@dataclass
class Source:
    """State of reading a deck: its folder, whether data lines are kept, the bytes and files read, and the open files."""

    folder: Path
    with_data: bool = True
    size: int = 0
    files: list[Path] = field(default_factory=list)
    open: list[Path] = field(default_factory=list)


def as_number(location: Location, text: str) -> float:
    """Return a text as a finite number, also in Fortran notation (1.D5); raises CaseError if it is none."""
    try:
        value = float(text.upper().replace("D", "E")) if text[:1].upper() not in "IN" else float("nan")
    except ValueError:
        raise location.refuse(f"'{text[:LONGEST_QUOTED]}' is not a number") from None
    if "_" in text or value != value or value in (float("inf"), float("-inf")):
        raise location.refuse(f"'{text[:LONGEST_QUOTED]}' is not a usable number")
    return value


def unquoted(text: str) -> str:
    """Return a name without its quotation marks."""
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text


def folded(name: str) -> str:
    """Return a name in the form used for look-up: in upper case, without quotation marks."""
    return name.replace('"', "").strip().upper()


def read_blocks(path: Path) -> Iterator[Block]:
    """Yield all blocks of a deck, those of included files in place.

    Raises
    ------
    FileError
        If a file cannot be read or all of them are too large.
    CaseError
        If a line is no part of a deck, or an *INCLUDE is refused; the message names file and line.
    """
    source = Source(path.resolve().parent)
    return _blocks(path, path.name, source)


def files_of_deck(path: Path) -> list[Path]:
    """Return a deck and the files that it includes, in reading order; errors as for `read_blocks`."""
    source = Source(path.resolve().parent, with_data=False)
    for _ in _blocks(path, path.name, source):
        pass
    return source.files


class _Line(NamedTuple):
    """A line without surrounding blanks, with its number and the offsets at which it and the next line begin."""

    number: int
    begin: int
    end: int
    text: str


def _contents(path: Path, source: Source) -> bytes:
    """Return the bytes of a file with Unix line ends."""
    source.files.append(path)
    try:
        source.size += path.stat().st_size
        if source.size > LARGEST or len(source.files) > MOST_FILES:
            raise FileError(
                f"'{path}' with what it includes is more than {LARGEST >> 20} MiB or {MOST_FILES} files: too much for a deck"
            )
        contents = path.read_bytes().removeprefix(BOM_UTF8)
    except OSError as error:
        raise FileError(f"cannot read '{path}': {error.strerror or error}") from error
    return contents.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def _lines(contents: bytes, begin: int, end: int, number: int = 1) -> Iterator[_Line]:
    """Yield the lines between two offsets, one at a time: a list of all would take several times their memory."""
    while begin < end:
        after = contents.find(b"\n", begin, end) + 1 or end
        yield _Line(number, begin, after, contents[begin:after].decode("utf-8", "replace").strip())
        number, begin = number + 1, after


def _blocks(path: Path, name: str, source: Source) -> Iterator[Block]:
    """Yield the blocks of one file; data lines before the first keyword are refused."""
    source.open.append(path.resolve())
    current: Block | None = None
    contents = _contents(path, source)
    lines = _lines(contents, 0, len(contents))
    last = _Line(0, 0, 0, "")  # last line of the current keyword
    for line in lines:
        if line.text.startswith("**"):
            continue
        if len(line.text) > LONGEST_LINE:
            keyword = _keyword(line.text) if line.text.startswith("*") else current.keyword if current else ""
            raise Location(name, line.number, keyword).refuse(_TOO_LONG)
        if not line.text.startswith("*"):
            if line.text and current is None:
                raise Location(name, line.number, "").refuse("a data line before any keyword")
            continue
        if current is not None:
            yield _with_lines(current, contents, last, line.begin, source)
        location = Location(name, line.number, _keyword(line.text))
        last = _continued(location, line, lines)
        current = Block(location, _parameters(location, last.text))
        if location.keyword == "INCLUDE":
            yield from _included(current, name, source)
            current = None
    if current is not None:
        yield _with_lines(current, contents, last, len(contents), source)
    source.open.pop()


def _with_lines(block: Block, contents: bytes, last: _Line, end: int, source: Source) -> Block:
    """Return a block with the data lines from the last line of its keyword up to an offset."""
    if not source.with_data or last.end >= end:
        return block
    location = Location(block.location.file, last.number + 1, block.keyword)
    return Block(block.location, block.parameters, Lines(location, contents, last.end, end))


def _continued(location: Location, line: _Line, lines: Iterator[_Line]) -> _Line:
    """Return a keyword line joined with its continuation lines, which follow a line that ends with a comma."""
    while line.text.endswith(","):
        more = next(lines, None)
        if more is None:
            break
        further = "" if more.text.startswith("**") else f" {more.text}"
        line = _Line(more.number, line.begin, more.end, line.text + further)
        if len(line.text) > LONGEST_LINE:
            raise location.refuse(_TOO_LONG)
        if not more.text:
            break
    return line


def _keyword(line: str) -> str:
    return " ".join(line[1:].partition(",")[0].upper().split())[:LONGEST_QUOTED]


def _parts(line: str) -> list[str]:
    """Return the entries between the commas of a line, without surrounding blanks; quoted names keep their commas."""
    if '"' not in line:
        return [part.strip() for part in line.split(",")]
    parts = [""]
    for number, piece in enumerate(line.split('"')):
        if number % 2:  # inside quotation marks
            parts[-1] += f'"{piece}"'
        else:
            first, *others = piece.split(",")
            parts[-1] += first
            parts += others
    return [part.strip() for part in parts]


def _parameters(location: Location, line: str) -> dict[str, str | None]:
    parameters: dict[str, str | None] = {}
    for part in _parts(line)[1:]:
        key, equal, value = part.partition("=")
        key = " ".join(key.upper().split())
        if key in parameters:
            raise location.refuse(f"the parameter {key} is given twice")
        if key:
            parameters[key] = unquoted(value.strip()) if equal else None
    return parameters


def _row(location: Location, line: str) -> Row:
    goes_on = line.endswith(",")
    return Row(location, tuple(_parts(line[:-1] if goes_on else line)), goes_on)


def _included(block: Block, name: str, source: Source) -> Iterator[Block]:
    """Yield the blocks of the file that *INCLUDE names; it must lie below the folder of the deck."""
    given = block.required("INPUT")
    for parameter in block.parameters:
        if parameter != "INPUT":
            raise block.refuse(f"the parameter {parameter} is not supported")
    shown, path = given[:LONGEST_QUOTED], source.folder / given.replace("\\", "/")
    try:
        target = path.resolve()
        inside = target.is_relative_to(source.folder)
        there = inside and target.is_file()
    except (OSError, ValueError, RuntimeError):
        raise block.refuse(f"'{shown}' is not a file name") from None
    if not inside:
        raise block.refuse(
            f"'{shown}' is outside the folder of the deck: refused, copy the file below '{source.folder}'"
        )
    if not there:
        raise block.refuse(f"file '{shown}' not found beside the deck, in '{source.folder}'")
    if target in source.open:
        target_name = "the deck" if target == source.open[0] else f"'{shown}'"
        raise block.refuse(f"{target_name} includes itself")
    yield from _blocks(target, given, source)


@contextmanager
def refusing(at: Location | Located, about: str = "") -> Iterator[None]:
    """Re-raise errors of the package as CaseError at a location of the deck; the message begins with `about`."""
    try:
        yield
    except CaseError:  # has a location already
        raise
    except FastcontactError as error:
        raise at.refuse(f"{about}{error}") from error


def registered(kind: str, name: str, table: dict[str, Entry], entry: Entry, at: Location | Located) -> Entry:
    """Add an entry to a table under its name and return it; raises CaseError if the name is in the table already."""
    if folded(name) in table:
        raise at.refuse(f"{kind} '{name}' is defined twice")
    table[folded(name)] = entry
    return entry


def defined(kind: str, name: str, table: Mapping[str, Any], at: Location | Located) -> Any:
    """Return the entry of a table with a name; raises CaseError with the names of all entries if there is none."""
    if folded(name) not in table:
        known = ", ".join(entry.name for entry in table.values()) or "none"
        raise at.refuse(f"{kind} '{name}' is not defined; {kind.rpartition(' ')[2]}s: {known}")
    return table[folded(name)]
