"""``fastcontact mesh``: generate a mesh with named groups and report its quality."""

from __future__ import annotations

import argparse
import inspect
import typing
from collections.abc import Callable
from typing import Any

from fastcontact.cli._arguments import add_verbosity, declare
from fastcontact.cli._outputs import check_outputs, say_written
from fastcontact.cli._terminal import say

HELP = "generate a mesh with named groups and report its quality"
# Help formatter that keeps the line breaks of docstrings.
LINE_BREAKS = argparse.RawDescriptionHelpFormatter
OUTPUT = {"-o --output OUTPUT": ({"required": True}, "mesh file, format by suffix: .med, .msh, .inp, .vtu, ...")}


def add_generators(parser: argparse.ArgumentParser) -> None:
    """Add a subcommand for each generator, whose options are the arguments of the generator."""
    from fastcontact.mesh.generate import GENERATORS

    kinds = parser.add_subparsers(dest="generator", metavar="GENERATOR", required=True)
    for name, generator in GENERATORS.items():
        doc = inspect.getdoc(generator) or ""
        subparser = kinds.add_parser(name, help=doc.splitlines()[0], description=doc, formatter_class=LINE_BREAKS)
        options = (_option(generator, parameter) for parameter in inspect.signature(generator).parameters.values())
        declare(subparser, {**OUTPUT, **dict(options)})
        add_verbosity(subparser, default=argparse.SUPPRESS)  # keeps -q and -v given before the name


def _option(generator: Callable[..., Any], parameter: inspect.Parameter) -> tuple[str, Any]:
    """Return the entry of a table of arguments, as in `declare`, for a parameter of a generator."""
    hint = typing.get_type_hints(generator).get(parameter.name, str)
    types = [member for member in (hint, *typing.get_args(hint)) if member is not type(None)]
    kind: dict[str, Any] = {"type": next((number for number in (float, int) if number in types), str)}
    for member in types:
        if typing.get_origin(member) is tuple:
            entries = [entry for entry in typing.get_args(member) if entry is not Ellipsis]
            kind = {"nargs": len(entries), "type": entries[0]}
    usage = f"--{parameter.name.replace('_', '-')} VALUE"
    return usage, ({**kind, "default": argparse.SUPPRESS}, f"default: {parameter.default}")


def run(options: argparse.Namespace) -> int:
    """Generate the mesh, write it, and print its quality and its groups."""
    from fastcontact.mesh.files.mesh_files import write_mesh
    from fastcontact.mesh.generate import GENERATORS
    from fastcontact.mesh.quality import quality

    check_outputs((), [options.output])
    generator = GENERATORS[options.generator]
    names = inspect.signature(generator).parameters
    arguments = {name: value for name, value in vars(options).items() if name in names}
    mesh = generator(**{name: tuple(value) if isinstance(value, list) else value for name, value in arguments.items()})
    write_mesh(options.output, mesh)
    if not options.quiet:
        say(quality(mesh))
        say(f"groups: {', '.join(mesh.group_names)}")
    say_written(options, options.output)
    return 0
