"""Conclusions of a mesh-convergence study as sentences: model error, mesh error and their uncertainty."""

from __future__ import annotations

from fastcontact.studies.fit import CONFIDENCE
from fastcontact.studies.quantities import title
from fastcontact.studies.render.table import number, percent
from fastcontact.studies.series import Series, Split

# Quantities of the sentences, in their order.
MAIN = ("pressure_max", "force")


def sentences(series: Series) -> list[str]:
    """Return sentences about the difference between a combination of element and formulation and theory."""
    if not series.limits:
        return [
            f"{series.combination}: {len(series.levels)} levels were solved, and an extrapolated limit needs three."
        ]
    names = [name for name in series.shown(MAIN) if name in series.limits]
    about = [text for name in names for text in _about_quantity(series, name)]
    return about + _about_equal_force(series)


def _about_quantity(series: Series, quantity: str) -> list[str]:
    split, name = series.split(quantity), title(quantity)
    if split is None:
        off = percent(series.errors(quantity)[-1])
        text = f"{series.combination}: the mesh error of the {name} is {off} on the finest mesh."
        return [text, *_about_settling(series, quantity, name)]
    start = (
        f"{series.combination}: the {name}"
        if series.exact_theory
        else f"{series.combination}: {series.compared} the {name}"
    )
    finest = f"({series.finest.n_dofs} degrees of freedom)"
    bar = f"{100 * split.uncertainty:.2g} %"
    if series.converges_to_theory(quantity) is False:
        texts = [_not_to_theory(series, quantity, start, split)]
    elif split.resolved and not series.exact_theory:
        texts = [
            f"{start} differs from theory by {percent(split.total)}. Of that, "
            f"{percent(split.model, split.uncertainty)} (+- {bar}) is model error, which no mesh removes, and "
            f"{percent(split.mesh)} is mesh error on the finest mesh {finest}, which goes to zero."
        ]
    else:
        texts = [
            f"{start} agrees with theory within the error bar of its limit, {percent(split.model)} +- {bar}; "
            f"{percent(split.mesh)} is mesh error on the finest mesh {finest}."
        ]
    texts += _about_settling(series, quantity, name)
    return texts + _about_cancelling(series, quantity, split) + _about_reference(series, quantity)


def _about_settling(series: Series, quantity: str, name: str) -> list[str]:
    if series.limits[quantity].converging:
        return []
    return [
        f"The {name} does not converge: its changes do not decrease on the finest mesh, and its error bar is meaningless. It "
        "may have no limit, or finer meshes are needed."
    ]


def _not_to_theory(series: Series, quantity: str, start: str, split: Split) -> str:
    """Return the sentence for a formulation that does not converge to a theory that is exact for the model."""
    limit = series.limits[quantity]
    tends = f"tends to {number(limit.value, 6)} +- {number(limit.uncertainty, 2)}"
    return (
        f"{start} {tends} where the theory has {number(split.theory, 6)}. That theory is exact for the bodies of the model, "
        f"so this is not a model error: {series.combination} does not converge to it on these meshes. Compare formulations "
        "(--formulations all), or let the meshes of the two sides match."
    )


def _about_cancelling(series: Series, quantity: str, split: Split) -> list[str]:
    """Return a warning if the mesh error of a level cancels more than half of the model error."""
    off = series.from_theory(quantity)
    best = min(range(len(off)), key=lambda k: abs(off[k]))
    if series.exact_theory or not split.resolved or not abs(off[best]) < 0.5 * abs(split.model):
        return []
    level = series.levels[best]
    return [
        f"Level {level.number} ({level.n_dofs} degrees of freedom) lies only {percent(off[best])} from theory because its "
        f"mesh error of {percent(off[best] - split.model)} cancels model error: the agreement does not prove a good mesh."
    ]


def _about_reference(series: Series, quantity: str) -> list[str]:
    reference, limit = series.reference.get(quantity), series.limits[quantity]
    if reference is None:
        return []
    where = "inside" if limit.contains(reference) else "OUTSIDE"
    return [
        f"The case's mesh-converged solution lies {where} the error bar of the limit ({CONFIDENCE:.0%}), "
        f"{percent(limit.value / reference - 1.0)} from the limit."
    ]


def _about_equal_force(series: Series) -> list[str]:
    same, equal = series.split_equal_force("pressure_max"), series.split("pressure_max")
    if same is None or equal is None:
        return []
    text = (
        f"{series.combination}: at equal force the model error of the largest pressure is {percent(same.model)} (+- "
        f"{100 * same.uncertainty:.2g} %)"
    )
    radius = series.split_equal_force("contact_radius")
    if radius is not None:
        text += f", that of the contact radius {percent(radius.model)} (+- {100 * radius.uncertainty:.2g} %)"
    if abs(same.model) < 0.3 * abs(equal.model) and equal.resolved:
        text += ": most of the difference at equal approach is in the force, not in its distribution"
    return [text + "."]
