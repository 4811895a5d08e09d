"""Check that docstrings give shape and unit of every array argument and result.

What counts are parameters, results, properties and attributes whose annotation, or documented type, is an array, or a
function of positions. A shape is a parenthesis such as ``(n_points, dim)``, ``(...)`` standing for any shape; a unit is a
bracket such as ``[length]``, ``[force / length^2]`` or ``[-]``. Indices, numbers of things and booleans have no unit.
An entry of a numpydoc section holds both in its type or its text. Outside of sections an argument is written as
```x` (n,) [length]``, and a result as a shape and a unit that belong to no argument. ``as for `other``` and ``see `other```
refer to the docstring of another function or class, the name of a type to the docstring of the module that explains it.

``python tests/docs/arrays.py [PATH ...]`` prints the figures of the public names, or those of all functions and classes of
the modules under these paths of the package, and what is missing.
"""

import importlib
import inspect
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import fastcontact as fc

PACKAGE = Path(fc.__file__).parent
NAMESPACES = [fc.analytic, fc.generate, fc.obstacles, fc.plot, fc.recovery, fc.topology]
SIZE = r"(?:\.\.\.|(?:[a-z]\w*|[1-9]\d?)(?: [+*-] (?:[a-z]\w*|[1-9]\d?))*)"
SHAPE = re.compile(rf"\(\.\.\.\)|\({SIZE},\)|\({SIZE}(?:, {SIZE})+\)")
UNIT = re.compile(
    r"\[(?:-|(?:length|force|pressure|energy|radian|degrees|mass|power|temperature|1 /|units? of)[^\]]*)\]"
)
TYPED = re.compile(r"ndarray|array_like|csr_array|bsr_array")
AFTER = r"((?: \([^)]*\))?(?: of int| of bool|(?: \[[^\]]*\])?))"  # the name of an argument: its shape, its unit
ROWS = re.compile(r"structured array, one row")  # the units of its columns are another matter
WHOLE = re.compile(r"structured|of (?:int|bool)|bool_|np\.u?int|AnyArray|Indices|Numbers|Mask|intp|integer")


@dataclass(frozen=True)
class Entry:
    """An array that a docstring should describe: where, its name, what the docstring says, whether it has a unit."""

    where: str
    name: str
    text: str
    whole: bool

    @property
    def shape(self) -> bool:
        """Whether the shape is given."""
        return (SHAPE.search(self.text) or ROWS.search(self.text)) is not None

    @property
    def unit(self) -> bool:
        """Whether the unit is given, or there is none."""
        return self.whole or UNIT.search(self.text) is not None


@dataclass(frozen=True)
class Docstring:
    """A docstring, parted into its text and the entries of its sections."""

    text: str

    @cached_property
    def sections(self) -> dict[str, str]:
        """The text of each section by its title; that before them under ""."""
        parts = re.split(r"^(\w[\w ]*)\n-{3,}\n", inspect.cleandoc(self.text), flags=re.MULTILINE)
        return {"": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}

    @cached_property
    def entries(self) -> dict[str, str]:
        """Type and text of each parameter and attribute by its name."""
        found = {}
        for title in ("Parameters", "Attributes"):
            for names, kind, text in _items(self.sections.get(title, "")):
                found.update(dict.fromkeys(re.split(r", *", names), f"{kind}\n{text}"))
        return found

    def argument(self, name: str) -> str:
        """What is said of an argument: its entry, or the shape and unit that follow its name in the text."""
        found = [match[1] for match in re.finditer(rf"`{name}`{AFTER}", self.sections[""])]
        return self.entries.get(name) or max(found, key=len, default="")

    @property
    def result(self) -> str:
        """What is said of the result."""
        return self.sections.get("Returns") or re.sub(rf"`\w+`{AFTER}", "", self.sections[""])

    @property
    def references(self) -> list[str]:
        """The functions and classes that the docstring refers to for what it leaves out."""
        return re.findall(r"(?:as (?:for|in)|[Ss]ee) `(\w[\w.]*)`", self.text)


@dataclass(frozen=True)
class Source:
    """Where a docstring stands: what it says itself, and then what it refers to."""

    function: Callable[..., Any]
    doc: Docstring

    @cached_property
    def others(self) -> list[Docstring]:
        """The docstrings that it refers to: of functions, or of the method of the same name of another class."""
        found = []
        for name in self.doc.references:
            home = self.function.__module__
            first, *rest = name.split(".")
            value = next(
                (v for m in (home, home.rpartition(".")[0]) if (v := getattr(sys.modules[m], first, None))), None
            )
            for part in rest:
                value = getattr(value, part, None)
            value = getattr(value, self.function.__name__, value) if inspect.isclass(value) else value
            found.append(Docstring(getattr(value, "__doc__", None) or ""))
        return found

    def argument(self, name: str, note: str) -> str:
        """What is said of an argument: here, where the docstring refers to, or of its type."""
        return self._first([*(doc.argument(name) for doc in (self.doc, *self.others)), *self._types(note)])

    def result(self, note: str) -> str:
        """What is said of the result: here, where the docstring refers to, or of its type."""
        return self._first([*(doc.result for doc in (self.doc, *self.others)), *self._types(note)])

    def _first(self, texts: list[str]) -> str:
        return next((text for text in texts if SHAPE.search(text)), texts[0])

    def _types(self, note: str) -> list[str]:
        """The paragraphs of the module's docstring that explain a type of an annotation."""
        paragraphs = inspect.cleandoc(sys.modules[self.function.__module__].__doc__ or "").split("\n\n")
        return [text for text in paragraphs if any(f"`{word}`" in text for word in re.findall(r"\w+", note))]


def _items(section: str) -> Iterator[tuple[str, str, str]]:
    """Names, type and text of the items of a section."""
    for item in re.split(r"^(?=\S)", section, flags=re.MULTILINE):
        head, _, text = item.partition("\n")
        names, _, kind = head.partition(" : ")
        if names:
            yield names.strip(" *"), kind, text


def is_array(annotation: Any, module: Any) -> bool:
    """Whether an annotation, as it stands in the code, is an array, or a function of arrays."""
    words = set(re.findall(r"[A-Za-z_]\w*", str(annotation)))
    known = {
        word
        for word in words
        if "ndarray" in repr(vars(module).get(word)).lower() and not inspect.isfunction(vars(module)[word])
    }
    return bool(words & {"ArrayLike", "NDArray", "ndarray", "csr_array", "bsr_array"} or known)


def of_function(function: Callable[..., Any], where: str, inherited: Docstring | None = None) -> Iterator[Entry]:
    """The entries of a function or method; those of a constructor stand in the docstring of its class."""
    module = sys.modules[function.__module__]
    source = Source(function, inherited or Docstring(function.__doc__ or ""))
    for name, parameter in inspect.signature(inspect.unwrap(function)).parameters.items():
        note = "" if parameter.annotation is parameter.empty else str(parameter.annotation)
        said = source.argument(name, note)
        if is_array(note, module) or TYPED.search(said.partition("\n")[0]):
            yield Entry(where, name, said, bool(WHOLE.search(note) or WHOLE.search(said)))
    note = str(inspect.signature(function).return_annotation)
    if is_array(note, module) and inherited is None:
        said = source.result(note)
        yield Entry(where, "return", said, bool(WHOLE.search(note) or WHOLE.search(said)))


def of_class(kind: type, where: str) -> Iterator[Entry]:
    """The entries of a class: its fields and its public methods and properties."""
    doc = Docstring(kind.__doc__ or "")
    module, fields = sys.modules[kind.__module__], inspect.get_annotations(kind)
    for name in dict.fromkeys([*fields, *doc.entries]):
        note = str(fields.get(name, ""))
        said = Source(kind, doc).argument(name, note)
        if not name.startswith("_") and (is_array(note, module) or TYPED.search(said.partition("\n")[0])):
            yield Entry(where, name, said, bool(WHOLE.search(note) or WHOLE.search(said)))
    if "__init__" in vars(kind) and inspect.isfunction(kind.__init__) and kind.__init__.__module__ == kind.__module__:
        yield from (entry for entry in of_function(kind.__init__, where, doc) if entry.name not in doc.entries)
    for name, member in vars(kind).items():
        function = getattr(member, "fget", None) or getattr(member, "func", None) or getattr(member, "__func__", member)
        if (not name.startswith("_") or name == "__call__") and inspect.isfunction(function):
            yield from of_function(function, f"{where}.{name}")


def of_value(value: Any) -> Iterator[Entry]:
    """The entries of a function or a class; nothing of anything else."""
    function = inspect.unwrap(value) if callable(value) else value
    where = f"{getattr(function, '__module__', '')}.{getattr(function, '__qualname__', '')}"
    if inspect.isclass(value):
        for kind in reversed([k for k in value.__mro__ if k.__module__.startswith("fastcontact")]):
            yield from of_class(kind, f"{kind.__module__}.{kind.__qualname__}")
    elif inspect.isfunction(function):
        yield from of_function(function, where)


def public_values() -> list[Any]:
    """The public functions and classes, and the classes that public functions return."""
    values = [getattr(fc, name) for name in fc.__all__]
    values = [value for value in values if not inspect.ismodule(value)]
    for module in NAMESPACES:
        values += [getattr(module, name) for name in getattr(module, "__all__", _own(module))]
    for function in [value for value in values if inspect.isfunction(value)]:
        home, note = vars(sys.modules[function.__module__]), str(inspect.signature(function).return_annotation)
        values += [
            home[word] for word in re.findall(r"\w+", note) if inspect.isclass(home.get(word)) and _ours(home[word])
        ]
    return values


def _ours(value: Any) -> bool:
    return str(getattr(value, "__module__", "")).startswith("fastcontact")


def _own(module: Any) -> list[str]:
    """The names that a module defines itself, without those with an underscore."""
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith("_") and getattr(value, "__module__", "") == module.__name__
    ]


def values_under(*paths: str) -> list[Any]:
    """The functions and classes that the modules under some paths of the package define; kernels are not among them."""
    values = []
    for start in paths:
        for path in sorted((PACKAGE / start).rglob("*.py")) if (PACKAGE / start).is_dir() else [PACKAGE / start]:
            if not path.stem.endswith(("_kernels", "_llvm", "__main__")):
                name = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
                module = importlib.import_module(name)
                values += [getattr(module, own) for own in _own(module)]
    return values


def entries(values: list[Any]) -> list[Entry]:
    """The entries of functions and classes, each once."""
    return list({(entry.where, entry.name): entry for value in values for entry in of_value(value)}.values())


def figures(found: list[Entry]) -> str:
    """The share of array arguments and results with a shape and with a unit, in words."""
    shapes, units = (sum(kind(entry) for entry in found) for kind in (lambda e: e.shape, lambda e: e.unit))
    return f"{len(found)} arrays: {shapes / len(found):.0%} with a shape, {units / len(found):.0%} with a unit"


def missing(found: list[Entry]) -> list[str]:
    """What each docstring lacks."""
    return [
        f"{entry.where}: {entry.name} has no {' and no '.join(what)}"
        for entry in found
        if (what := [word for word, there in (("shape", entry.shape), ("unit", entry.unit)) if not there])
    ]


if __name__ == "__main__":
    measured = entries(values_under(*sys.argv[1:]) if sys.argv[1:] else public_values())
    print("\n".join([*missing(measured), figures(measured)]))
