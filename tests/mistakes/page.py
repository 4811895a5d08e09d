"""Generate the documentation page on mistakes from the catalogue: ``python tests/mistakes/page.py``."""

import re
import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1]))  # case texts that all tests share

import library
from accidents import ACCIDENTS
from catalogue import CASES, COMMANDS
from doubtful import DOUBTS
from otherwise import OTHERWISE
from spoilt import MESHES

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "mistakes.md"
HEAD = """# Mistakes and their messages

This page lists common mistakes and the messages that report them. Each message is a single line that states the cause
and the remedy.

- **Errors in the input** are reported before the analysis starts. A command ends with exit code 1. The library raises
  one of its [exceptions](errors.md) with the same text.
- **Doubtful input** that can be solved causes a warning, which states the size of the effect. In Python, the warning is
  a `FastcontactWarning`. Commands show it on the terminal. The log, the summary written by `--json` and the result file
  (`open_results(path).warnings`) also contain it.

The tables show messages or parts of messages; three dots stand for text that varies. The tables are generated from
tests that make each mistake and compare the message. The last column describes a common response of other
finite-element programs to the same mistake. The responses of individual programs differ.
"""
SECTIONS = (
    ("In a case file", "`fastcontact run` solves the ready-made case FORMA04 A with one change:", CASES),
    ("In a mesh file", "`fastcontact run` solves the same case with a damaged copy of its mesh:", MESHES),
    ("On the command line", "", COMMANDS),
    ("Where results are written", "", ACCIDENTS),
    ("In Python: meshes", "", library.MESH),
    ("In Python: materials and units", "", library.MATERIALS),
    ("In Python: supports", "", library.SUPPORTS),
    ("In Python: contact", "", library.CONTACT),
    ("In Python: loads", "", library.LOADS),
    ("In Python: ramp and options", "", [*library.RAMP, *library.OPTIONS]),
    ("Warnings", "In these cases the analysis runs, but its result is doubtful:", DOUBTS),
)
CONSEQUENCE = {name: text for text, names in OTHERWISE.items() for name in names}


def page() -> str:
    """Return the text of the page."""
    parts = [HEAD]
    for title, remark, entries in SECTIONS:
        rows = [f"| {name} | {cell(said)} | {CONSEQUENCE[name]} |" for name, said in map(named, entries)]
        table = "\n".join(["| mistake | message | common behaviour of other programs |", "| --- | --- | --- |", *rows])
        parts.append("\n\n".join(text for text in (f"## {title}", remark, table) if text) + "\n")
    return "\n".join(parts)


def named(entry) -> tuple[str, str]:
    """Return the name of a mistake and its message, with the kind of error where the library raises one."""
    name, patterns = entry[0], entry[-1]
    text = "; ".join(map(readable, [patterns] if isinstance(patterns, str) else patterns))
    if not isinstance(entry, library.Mistake):
        return name, text
    return name, f"{entry.kind.__name__}: {text}"


def readable(pattern: str) -> str:
    """Return what a pattern of a message looks like: what differs from run to run as three dots."""
    text = re.sub(r"(?<!\\)\$$", "", pattern).replace("elements?", "elements")
    text = re.sub(r"\((\w+(?:\|\w+)+)\)", "...", text)
    text = re.sub(r"(?<!\\)\\(?:d|w|S)\+?(?:\\\.\\d\+?)?(?:e-\\d\\d|e-\\d)?", "...", text)
    text = re.sub(r"(?<!\\)(\.|\[[^\]]*\]| )[*+]", "...", text)
    text = re.sub(r"\\(.)", r"\1", text)
    return re.sub(r"(\.\.\.[\s.]*)*\.\.\.(?:\.\.\.)*", "...", text)


def cell(text: str) -> str:
    """Return a text that no table takes for one of its own marks."""
    return "`" + text.replace("|", "\\|").replace("`", "'") + "`"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
