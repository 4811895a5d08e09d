"""The command `fastcontact bench`: run subjects, print the table, write figures and pictures."""

import json
from pathlib import Path

from fastcontact.cli._outputs import check_outputs, write_json
from fastcontact.cli._terminal import say, stderr_is_terminal
from fastcontact.errors import FastcontactError, FileError

from . import pictures, subjects, table, timing


def run(options):
    """Run the benchmarks, print the table, write the files of the options."""
    if any(size < 1 for size in [*(options.sizes or ()), *([] if options.dofs is None else [options.dofs])]):
        raise FastcontactError("--sizes and --dofs must be positive: give about how many unknowns the problem has")
    check_outputs([options.compare], [options.json])
    if options.problem or options.dofs:
        return _contact(options)
    before = _stored(options.compare) if options.compare else None
    results = {}
    tables = {}
    show = stderr_is_terminal() and not options.quiet
    for name in options.names or subjects.names():
        subject = subjects.load(name)
        if hasattr(subject, "entries"):  # a table of its own
            tables[name] = _table(subject, name, options, show)
            continue
        sizes = subject.SIZES[:1] if options.smallest else options.sizes or subject.SIZES
        for size in sizes:
            if show:
                say(f"{name} {size} ...", error=True)
            measured = timing.measured(subject, size, 1 if options.smallest else 3)
            results.setdefault(name, []).append(measured)
    if results and not options.quiet:
        say("\n".join(table.lines(results, before)))
    if options.json:
        write_json(options.json, {"environment": table.environment(), "results": results, "tables": tables}, indent=1)
    if options.png:
        draw(options.png, results)
    return 0


def _table(subject, name, options, show):
    """Return the rows of a subject that has a table of its own, and print them."""

    def tell(text):
        if show:
            say(f"{name} {text} ...", error=True)

    rows = subject.entries(options.smallest, tell, options.sizes)
    if not options.quiet:
        say("\n".join(subject.lines(rows)))
    return rows


def _contact(options):
    if options.names != ["contact"] or not options.problem or not options.dofs:
        raise FastcontactError("--problem and --dofs go together, with the benchmark 'contact' alone")
    given = {"solver": options.linear, "tolerance": options.tolerance}
    chosen = {key: value for key, value in given.items() if value is not None}
    result = subjects.load("contact").detailed(options.problem, options.dofs, **chosen)
    if not options.quiet:
        say(json.dumps(result, indent=1))
    if options.json:
        write_json(options.json, result, indent=1)
    return 0


def _stored(path):
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))["results"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FileError(f"'{path}' is no stored run of the benchmarks ({error}): make one with --json") from error


def draw(path, results):
    """Draw every benchmark of several sizes into a folder; raises FileError if a picture cannot be written."""
    for name, sizes in results.items():
        if len({entry["n_dofs"] for entry in sizes}) > 1:
            try:
                Path(path).mkdir(parents=True, exist_ok=True)
                pictures.scaling(name, sizes).savefig(Path(path) / f"{name}.png")
            except OSError as error:
                raise FileError(f"cannot write the picture of '{name}' in '{path}': {error}") from error
