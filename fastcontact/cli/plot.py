"""``fastcontact plot``: pictures and animations of the deformed mesh, of sections, and of the contact and its history."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from fastcontact.cli import _results
from fastcontact.cli._outputs import check_outputs, save, say_written
from fastcontact.errors import CaseError

HELP = "plot the deformed mesh with a field, a section, the contact, or its history over the load steps"
# Options that plot a contact pair instead of the bodies.
CONTACT_PLOTS = ("history", "axis", "zones", "map")
ARGUMENTS = {
    **_results.ARGUMENTS,
    "--png FILE": "write the picture to this file",
    "": {
        "--history": "force and contact radius over the load steps instead of the mesh",
        "--axis": "stresses along the axis below the contact, compared with theory",
        "--zones": "where the contact is open, closed or sliding, over the load steps",
        "--map": "pressure and shear (or --field contact_slip) over the contact (3D)",
        "--section PLANE": "a section, such as y=0 or x=12.5 (3D)",
        "--animate FILE": "an animation over the load steps: .gif, or .mp4 if ffmpeg is installed",
        "--view": "an interactive window (PyVista) instead of a picture",
    },
    "--field NAME": (
        "von_mises",
        "field that colours the mesh: von_mises (default), stress.xx, stress.principal_min, contact_damage ...",
    ),
    "--phases N": (int, "with --animate: one period of the vibration mode selected by --step, in N frames"),
    "--zoom LENGTH": (float, "half-width of the region that is drawn around the largest value"),
    "--mirrored": "draw the mirror image about the axis as well",
    "--scale SCALE": (
        float,
        "factor by which displacements are multiplied (default 1; mode shapes are scaled to a tenth of the mesh size)",
    ),
}


def run(options: Namespace) -> int:
    """Write the picture or the animation, or show the interactive window."""
    from fastcontact.results import plot
    from fastcontact.results.reader import open_results

    if not (options.png or options.view or options.animate):
        raise CaseError("name the picture to write with --png FILE, or request a window with --view")
    check_outputs([options.file], [options.animate], [options.png])
    if options.phases is not None and not options.animate:
        raise CaseError("--phases N needs an animation: name its file with --animate FILE")
    if options.png and options.animate:
        raise CaseError("--animate FILE names the file to write: leave out --png")
    plane = _plane(options.section) if options.section else None
    with open_results(options.file) as results:
        step = _results.select_step(results, options.step)
        case = _results.case_data(results)
        if options.view:
            plot.view(results, step, scale=options.scale, title=case["title"], screenshot=options.png)
            return 0
        if options.animate:
            _animate(options, results, step, case)
        elif any(getattr(options, name) for name in CONTACT_PLOTS):
            save(_contact_plot(options, results, step, case), options.png)
        else:
            save(_body_plot(options, results, step, case, plane), options.png)
    say_written(options, options.animate or options.png)
    return 0


def _plane(text: str) -> tuple[int, float]:
    """Return the axis and the coordinate [length] of a plane such as ``y=0``; CaseError for any other text."""
    name, _, value = text.partition("=")
    try:
        return "xyz".index(name.strip()), float(value)
    except ValueError:
        raise CaseError(f"'{text}' is not a plane: write for example y=0") from None


def _animate(options: Namespace, results: Any, step: Any, case: dict[str, Any]) -> None:
    """Write the animation over the load steps or, with ``--phases``, over a period of vibration."""
    from fastcontact.results import plot
    from fastcontact.results.step import phases

    frames = list(results) if options.phases is None else phases(step, options.phases)
    plot.animate(
        results.mesh, frames, options.animate, field=options.field, scale=options.scale,
        mirrored=options.mirrored, title=case["title"], pictures_per_second=5 if options.phases is None else 12,
    )  # fmt: skip


def _body_plot(
    options: Namespace, results: Any, step: Any, case: dict[str, Any], plane: tuple[int, float] | None
) -> Any:
    """Return a plot of the deformed mesh, or of a section through it."""
    from fastcontact.results import plot
    from fastcontact.results.plot._shape import scale_of

    section = f"section {options.section}, " if plane else ""
    scale = scale_of(options.scale, results.mesh, [step])
    title = f"{case['title']}\n{section}{step.instant}, displacements x {scale:g}".strip()
    keywords = {"field": options.field, "scale": scale, "zoom": options.zoom, "title": title}
    if plane is None:
        return plot.deformed_shape(results.mesh, step, mirrored=options.mirrored, **keywords)
    point, normal = [0.0] * 3, [0.0] * 3
    point[plane[0]], normal[plane[0]] = plane[1], 1.0
    return plot.section(results.mesh, step, point, normal, **keywords)


def _contact_plot(options: Namespace, results: Any, step: Any, case: dict[str, Any]) -> Any:
    """Return a plot of the map, the zones or the history of a contact pair, or of the stresses on the axis below it."""
    from fastcontact.results import plot

    keywords = {"title": case["title"]}
    name = _results.select_contact(options, step)
    theories = case["theories"].get(name, {})
    if options.map:
        keywords["title"] = f"{case['title']}\ncontact '{name}', {step.instant}".strip()
        field = options.field.removeprefix("contact_") if options.field.startswith("contact_") else "shear"
        return plot.contact_map(results.mesh, step.contact[name], beside=field, **keywords)[0]
    if options.zones:
        return plot.contact_zones(list(results), name, **keywords)
    if options.history:
        reference = {"approach": case["approach"].get(name), "share": theories.get("share", 1.0)}
        return plot.history(list(results), name, law=_results.approach_law(theories), **reference, **keywords)[0]
    keywords["title"] = f"{case['title']}\nstresses on the axis, {step.instant}".strip()
    return plot.axis_stress(results.mesh, step, name, _axis_curves(theories, step, name, case), **keywords)


def _axis_curves(theories: dict[str, Any], step: Any, name: str, case: dict[str, Any]) -> dict[str, Any]:
    """Return theories of the stresses on the axis, at equal approach and at equal force, by label in the legend."""
    theory = theories.get("theory")
    theory = getattr(theory, "hertz", theory)
    if theory is None or not hasattr(theory, "stress_on_axis"):
        return {}
    state = {"approach": case["approach"].get(name), "load": _results.load_multiplier(case["ramp"], step)}
    curves = _results.theories_at_equal_load("theory", theory, step.contact[name], theories["share"], **state)
    return curves or {"theory": theory}
