"""The checks of the package: every place that raises one of its errors, and its text without one of them."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

# Readers raise these too, where a caller turns them into a clear error.
OTHERS = {"ValueError"}


@dataclass(frozen=True)
class Site:
    """A `raise` statement: a name that survives edits elsewhere, its file in the package, first and last line, columns."""

    key: str
    file: str
    first: int
    last: int
    begin: int
    end: int

    def without(self, text: str) -> str:
        """Return the text of the file with `pass` in place of the statement; no line moves."""
        lines = [line.encode() for line in text.splitlines(keepends=True)]  # columns count bytes
        before, after = lines[self.first - 1][: self.begin], lines[self.last - 1][self.end :]
        lines[self.first - 1 : self.last] = [before + b"pass" + after, *[b"\n"] * (self.last - self.first)]
        return b"".join(lines).decode()


def sites(package: Path) -> list[Site]:
    """Return all checks of a package, file by file."""
    kinds = OTHERS | _errors(package)
    found: list[Site] = []
    for path in sorted(package.rglob("*.py")):
        file = str(path.relative_to(package))
        seen: Counter[str] = Counter()
        for owner, node in _raises(ast.parse(path.read_text(encoding="utf-8")), ""):
            if _kind(node) in kinds:
                name = f"{file}::{owner}::{' '.join(ast.unparse(node.exc).split())[:80]}"
                seen[name] += 1
                key = f"{name}#{seen[name]}" if seen[name] > 1 else name
                found.append(Site(key, file, node.lineno, node.end_lineno, node.col_offset, node.end_col_offset))
    return found


def _errors(package: Path) -> set[str]:
    """Return the names of the package's errors, and of functions and variables that stand for one."""
    tree = ast.parse((package / "errors.py").read_text(encoding="utf-8"))
    names = {node.name for node in tree.body if isinstance(node, ast.ClassDef) and node.name.endswith("Error")}
    makers = set()
    for path in package.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.returns is not None and ast.unparse(node.returns) in names:
                makers.add(node.name)
    return names | makers | {"kind", "type(error)"}


def _kind(node: ast.Raise) -> str:
    """Return what is called to make the exception, without the module."""
    if not isinstance(node.exc, ast.Call):
        return ""
    made = ast.unparse(node.exc.func)
    return made if "(" in made else made.rpartition(".")[2]


def _raises(node: ast.AST, owner: str) -> Iterator[tuple[str, ast.Raise]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Raise):
            yield owner, child
        named = isinstance(child, (ast.FunctionDef, ast.ClassDef))
        yield from _raises(child, f"{owner}.{child.name}".lstrip(".") if named else owner)
