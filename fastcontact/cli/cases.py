"""``fastcontact cases``: list, print or copy the ready-made cases."""

from __future__ import annotations

import tomllib
from argparse import Namespace
from pathlib import Path
from typing import Any

from fastcontact._tools.paths import replacing
from fastcontact.cli._outputs import say_written
from fastcontact.cli._terminal import say
from fastcontact.errors import FastcontactError, FileError

HELP = "list the ready-made cases, or print or copy one of them"
ARGUMENTS = {
    "name": ({"nargs": "?"}, "print this case file instead of the list"),
    "--copy NAME": "copy this case file and its mesh file",
    "-o --output FILE": "copy to this file (default: NAME.toml in the current directory)",
}


def run(options: Namespace) -> int:
    """List the ready-made cases, or print or copy one of them."""
    from fastcontact.cases.case import ready_made_case, ready_made_cases

    if options.copy and options.name:
        raise FastcontactError("give either a name to print or --copy NAME, not both")
    if options.output and not options.copy:
        raise FastcontactError("-o needs --copy NAME, the case to copy")
    if options.copy:
        new_paths = copy_case(ready_made_case(options.copy), Path(options.output or f"{options.copy}.toml"))
        say_written(options, *new_paths)
    elif options.name:
        say(ready_made_case(options.name).read_text(encoding="utf-8").rstrip("\n"))
    elif not options.quiet:
        say("\n".join(line for path in ready_made_cases().values() for line in _lines(path)))
        say("solve one with: fastcontact run NAME")
    return 0


def _lines(path: Path) -> list[str]:
    """Return the description of a case and of its checks."""
    from fastcontact.cases.case import read_case
    from fastcontact.cases.summary import count

    case = read_case(path)
    n_cells = sum(map(len, case.mesh.solids.values()))
    kinematics = case.model.kinematics.replace("_", " ")
    return [
        f"{case.name}: {case.title}",
        f"    {kinematics}, {n_cells} {', '.join(case.mesh.solids)}, {count(len(case.ramp), 'load step')}",
        *(f"    checks {check.description()}" for check in case.checks),
    ]


def copy_case(case_path: Path, target: Path) -> list[Path]:
    """Copy a case file and its mesh files, if it has any, and return the new paths. Raises FileError if a path exists."""
    text = case_path.read_text(encoding="utf-8")
    mesh_table: dict[str, Any] = tomllib.loads(text).get("mesh", {})
    files = {target: text.encode()}
    if "file" in mesh_table:
        named = mesh_table["file"]
        for file in [named] if isinstance(named, str) else named:
            source = case_path.parent / file
            text = text.replace(f'"{file}"', f'"{source.name}"')
            files[target.parent / source.name] = source.read_bytes()
        files[target] = text.encode()
    for path in files:
        if path.exists():
            raise FileError(f"'{path}' already exists: name another file with -o, or remove it first")
    for path, content in files.items():
        with replacing(path) as temporary:
            temporary.write_bytes(content)
    return list(files)
