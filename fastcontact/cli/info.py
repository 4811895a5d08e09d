"""``fastcontact info``: show the content of a mesh, case, deck or result file."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fastcontact._tools.paths import existing_file
from fastcontact.cli._outputs import check_outputs, save
from fastcontact.cli._terminal import say

HELP = "show the content of a mesh, case, deck or result file: groups, sizes, steps, iterations, versions"
ARGUMENTS = {
    "file": "mesh file, case file (.toml), ready-made case, deck (.inp) or result file (.vtkhdf)",
    "--contacts": "show the surfaces of bodies that face each other, instead of the content",
    "--distance LENGTH": (float, "largest gap for --contacts (default: the size of facets)"),
    "--angle DEGREES": (45.0, "largest deviation of normals from opposite directions (45)"),
    "--png FILE": "write a picture of the contacts",
}


def run(options: Namespace) -> int:
    """Print the content of the file."""
    from fastcontact.cases.case import case_path

    file = case_path(options.file)
    options.file, suffix = str(file), file.suffix.lower()
    if options.contacts or options.png:
        return _show_contacts(options)
    if suffix == ".vtkhdf":
        from fastcontact.results.reader import open_results

        with open_results(options.file) as results:
            rows = [*_mesh_lines(results.mesh), *_result_lines(results)]
    elif _is_case(file):
        from fastcontact.cases.case import read_case
        from fastcontact.model.hanging_nodes import hanging_nodes_warning

        case = read_case(options.file)
        rows = [f"{options.file}: {case.title}", repr(case.model)]
        if case.deck is not None:
            rows.append(f"load factors: {', '.join(f'{t:g}' for t in case.ramp.instants)}")
            rows += [f"  note: {text}" for text in case.deck.notes]
        rows += _mesh_lines(case.mesh)
        rows += [f"warning: {text}" for text in (hanging_nodes_warning(case.model),) if text]
    else:
        from fastcontact.mesh.files.mesh_files import read_mesh_report
        from fastcontact.mesh.quality import quality

        mesh, report = read_mesh_report(options.file)
        rows = [str(report), *_mesh_lines(mesh), str(quality(mesh))]
    say("\n".join(rows))
    return 0


def _show_contacts(options: Namespace) -> int:
    """Print the contact pairs detected in a mesh, and draw them if requested."""
    from fastcontact.cases.case import files_of_case, read_case
    from fastcontact.contact.found_contacts import find_contacts
    from fastcontact.results import plot

    is_case = _is_case(Path(options.file))
    check_outputs(files_of_case(options.file) if is_case else [options.file], [], [options.png])
    mesh = read_case(options.file).mesh if is_case else _mesh_of(options.file)
    contacts = find_contacts(mesh, distance=options.distance, angle=options.angle)
    say(str(contacts))
    if options.png:
        save(plot.contacts(contacts), options.png)
        say(f"wrote {options.png}")
    return 0


def _mesh_of(file: str) -> Any:
    """Return the mesh of a result file or a mesh file."""
    if Path(file).suffix.lower() == ".vtkhdf":
        from fastcontact.results.reader import open_results

        with open_results(file) as results:
            return results.mesh
    from fastcontact.mesh.files.mesh_files import read_mesh

    return read_mesh(file)


def _is_case(path: Path) -> bool:
    """Return whether a file is a case file, or an Abaqus file with steps, parts or included files in addition to a mesh."""
    if path.suffix.lower() != ".inp":
        return path.suffix.lower() == ".toml"
    keywords = ("*STEP", "*PART", "*INCLUDE")
    with open(existing_file(path), encoding="utf-8", errors="replace") as file:
        return any(line.lstrip().upper().startswith(keywords) for line in file)


def _mesh_lines(mesh: Any) -> list[str]:
    """Return lines with the numbers of points and cells, and the groups of a mesh."""
    cells = ", ".join(f"{len(block)} {name}" for name, block in mesh.cells.items())
    rows = [f"{mesh.n_points} points in {mesh.dim}D; cells: {cells}"]
    rows += [f"  cells  {name:<16} {len(members):>8}" for name, members in mesh.cell_groups.items()]
    rows += [f"  points {name:<16} {len(members):>8}" for name, members in mesh.point_groups.items()]
    return rows


def _result_lines(results: Any) -> Iterator[str]:
    """Yield lines on the versions, the completeness, the steps and the warnings of a result file."""
    versions = ", ".join(f"{name} {version}" for name, version in results.versions.items())
    yield f"{len(results)} steps, {results.kinematics}; versions: {versions}"
    if results.error:
        yield f"  stopped: {results.error}"
    elif not results.complete:
        yield "  incomplete: the run was killed, or is still running"
    for step in results:
        closed = ", ".join(f"{name}: {int(c.active.sum())} nodes closed" for name, c in step.contact.items())
        counts = step.iterations
        yield (
            f"  step {step.index:>3}  {step.instant:<20} geometry updates "
            f"{counts.get('geometry_updates', 0):>3}  active-set iterations "
            f"{counts.get('active_set_iterations', 0):>3}  linear {counts.get('linear_iterations', 0):>4}  {closed}"
        )
        if "substeps" in counts:
            ends = ", ".join(f"{end:.6g}" for end in counts["substeps"])
            yield f"    did not converge as a whole and was divided at the load factors {ends}"
        yield from (f"    warning: {text}" for text in step.warnings)
    interfaces = results[-1].material_stress if len(results) else None
    if interfaces is not None:
        yield (
            f"  materials meet at {len(set(interfaces.points.tolist()))} nodes: stress there is that of the material with "
            "the largest von Mises stress; material_stress contains that of each material"
        )
