"""Labels of the quantities of interest in tables and figures: their titles and units."""

from __future__ import annotations

from collections.abc import Mapping

# Of the standard quantities, which every study shows where they are known: title, and kind of the unit, empty for ratios.
LABELS = {
    "force": ("contact force", "force"),
    "pressure_max": ("largest pressure", "pressure"),
    "pressure_pole": ("pressure at the axis", "pressure"),
    "contact_radius": ("contact radius", "length"),
    "von_mises_max": ("largest von Mises stress", "pressure"),
    "von_mises_depth": ("depth of the largest von Mises stress", "length"),
    "pressure_error": ("pressure against theory at equal approach, relative L2 norm", ""),
    "pressure_error_equal_force": ("pressure against theory at equal force, relative L2 norm", ""),
}


def title(quantity: str) -> str:
    """Return a quantity in words; ``"C1.stress.yy"`` and the like stay as they are."""
    return LABELS[quantity][0] if quantity in LABELS else quantity


def unit(quantity: str, units: Mapping[str, str]) -> str:
    """Return the name of a quantity's unit, empty for ratios."""
    kind = LABELS[quantity][1] if quantity in LABELS else "length" if ".displacement." in quantity else "pressure"
    return units[kind] if kind else ""


def column(label: str, quantity: str, units: Mapping[str, str]) -> str:
    """Return the header of a column or axis: a label and the unit of its quantity, ``[1]`` for ratios."""
    return f"{label} [{unit(quantity, units) or '1'}]"
