"""``fastcontact mesh``: generate a mesh with named groups."""

from __future__ import annotations

import argparse
import inspect
import typing
from collections.abc import Callable
from typing import Any

from fastcontact.cli._arguments import add_loudness, declare
from fastcontact.cli._outputs import check_outputs, say_written
from fastcontact.cli._terminal import say

HELP = "generate a mesh with named groups and report its quality"


def add_generators(parser: argparse.ArgumentParser) -> None:
    """Add a subcommand for each generator, with options from the signature of the generator."""
    from fastcontact.mesh.generate import GENERATORS

    kinds = parser.add_subparsers(dest="generator", metavar="GENERATOR", required=True)
    for name, make in GENERATORS.items():
        doc = (inspect.getdoc(make) or "").splitlines()[0]
        sub = kinds.add_parser(name, help=doc, description=inspect.getdoc(make), formatter_class=_Raw)
        declare(
            sub,
            {"-o --output OUTPUT": ({"required": True}, "mesh file, format by suffix: .med, .msh, .inp, .vtu, ...")},
        )
        declare(sub, dict(_option(make, parameter) for parameter in inspect.signature(make).parameters.values()))
        add_loudness(sub, default=argparse.SUPPRESS)  # keeps -q and -v given before the name of the generator


class _Raw(argparse.RawDescriptionHelpFormatter):
    """Help formatter that keeps the line breaks of docstrings."""


def _option(make: Callable[..., Any], parameter: inspect.Parameter) -> tuple[str, Any]:
    """Return the entry of an `Arguments` table for a parameter of a generator."""
    hint = typing.get_type_hints(make).get(parameter.name, str)
    options = [kind for kind in (hint, *typing.get_args(hint)) if kind is not type(None)]
    kind: dict[str, Any] = {"type": next((kind for kind in (float, int) if kind in options), str)}
    for option in options:
        if typing.get_origin(option) is tuple:
            members = [member for member in typing.get_args(option) if member is not Ellipsis]
            kind = {"nargs": len(members), "type": members[0]}
    usage = f"--{parameter.name.replace('_', '-')} VALUE"
    return usage, ({**kind, "default": argparse.SUPPRESS}, f"default: {parameter.default}")


def run(options: argparse.Namespace) -> int:
    """Generate the mesh, write it and print its quality."""
    from fastcontact.mesh.files.mesh_files import write_mesh
    from fastcontact.mesh.generate import GENERATORS
    from fastcontact.mesh.quality import quality

    check_outputs((), [options.output])
    make = GENERATORS[options.generator]
    names = inspect.signature(make).parameters
    arguments = {name: value for name, value in vars(options).items() if name in names}
    mesh = make(**{name: tuple(value) if isinstance(value, list) else value for name, value in arguments.items()})
    write_mesh(options.output, mesh)
    if not options.quiet:
        say(quality(mesh))
        say(f"groups: {', '.join(mesh.group_names)}")
    say_written(options, options.output)
    return 0
