"""What a study found, in sentences."""

from __future__ import annotations

from fastcontact.studies.fit import CONFIDENCE
from fastcontact.studies.model_error import cancelling
from fastcontact.studies.quantities import title
from fastcontact.studies.study import Series

# The quantities a sentence is worth, in this order.
SPOKEN = ("pressure_max", "force")


def percent(value: float, uncertainty: float | None = None) -> str:
    """Return a relative difference in percent with sign, with as many digits as its error bar is worth.

    Examples
    --------
    >>> percent(0.04005, 0.00003), percent(0.5)
    ('+4.005 %', '+50.000 %')
    """
    digits = 3
    if uncertainty is not None and 0 < uncertainty < 1e-5:
        digits = 4
    return f"{100 * value:+.{digits}f} %"


def sentences(series: Series) -> list[str]:
    """Return what a combination of element and formulation says about the difference from theory."""
    if not series.limits:
        return [f"{series.combination}: {len(series.levels)} levels were solved, and a limit takes three."]
    found = []
    for quantity in SPOKEN:
        found += _of_quantity(series, quantity)
    return found + _equal_force(series)


def _of_quantity(series: Series, quantity: str) -> list[str]:
    found = series.split(quantity)
    name, limit = title(quantity), series.limits.get(quantity)
    if limit is None:
        return []
    if found is None:
        off = series.errors(quantity)[-1]
        return [f"{series.combination}: the mesh error of the {name} is {percent(off)} on the finest mesh."]
    texts = []
    if found.resolved:
        texts.append(
            f"{series.combination}: at equal approach the {name} differs from theory by {percent(found.total)}. Of that, "
            f"{percent(found.model, found.uncertainty)} (+- {100 * found.uncertainty:.2g} %) is model error, which no "
            f"mesh removes, and {percent(found.mesh)} is mesh error on the finest mesh ({series.finest.n_dofs} degrees "
            "of freedom), which goes to zero."
        )
    else:
        texts.append(
            f"{series.combination}: at equal approach the {name} agrees with theory within the error bar of its limit, "
            f"{percent(found.model)} +- {100 * found.uncertainty:.2g} %; {percent(found.mesh)} is mesh error on the "
            f"finest mesh ({series.finest.n_dofs} degrees of freedom)."
        )
    if not limit.converging:
        texts.append(f"The {name} does not settle: its last change is the largest, so finer meshes are needed.")
    return texts + _cancelling(series, quantity) + _reference(series, quantity)


def _cancelling(series: Series, quantity: str) -> list[str]:
    """Say so where a mesh looks better than it is."""
    theory = series.theory[quantity]
    values = series.values(quantity)
    best = cancelling(values, series.limits[quantity], theory)
    found = series.split(quantity)
    if best is None or found is None:
        return []
    level = series.levels[best]
    off = values[best] / theory - 1.0
    return [
        f"Level {level.number} ({level.n_dofs} degrees of freedom) lies only {percent(off)} from theory because its mesh "
        f"error of {percent(off - found.model)} cancels model error: that it agrees is no proof of a good mesh."
    ]


def _reference(series: Series, quantity: str) -> list[str]:
    reference, limit = series.reference.get(quantity), series.limits[quantity]
    if reference is None:
        return []
    where = "inside" if limit.contains(reference) else "OUTSIDE"
    return [
        f"The case's mesh-converged solution lies {where} the error bar of the limit ({CONFIDENCE:.0%}), "
        f"{percent(limit.value / reference - 1.0)} from the limit."
    ]


def _equal_force(series: Series) -> list[str]:
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
        text += ": what differs at equal approach is mostly the force that it takes, not how the force is spread"
    return [text + "."]
