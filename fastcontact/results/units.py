"""Units in labels, tables and texts of results."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

# Quantities of the columns of tables, by the beginnings of their names.
COLUMNS = {
    **dict.fromkeys(("abscissa", "radius", "place", "gap", "displacement_", "slip_", "wear"), "length"),
    **dict.fromkeys(("pressure", "stress_", "normal_stress", "von_mises", "shear_", "fluid_pressure"), "pressure"),
    "force_": "force",
}


def known_units(units: Mapping[str, str]) -> dict[str, str]:
    """Return the names of units, always including length, force and pressure. Missing names and dashes become empty strings.

    Examples
    --------
    >>> known_units({"length": "mm", "force": "-"})
    {'length': 'mm', 'force': '', 'pressure': ''}
    """
    names = {"length": "", "force": "", "pressure": "", **units}
    return {key: "" if name == "-" else name for key, name in names.items()}


def units_of_results(units: Mapping[str, str], kinematics: str) -> dict[str, str]:
    """Return the names of units for the results of a model, including those of moments, stiffnesses and penalties.

    Forces of plane models are per unit thickness; a unit of force that contains a slash is taken to be per unit thickness and
    is unchanged. The names of unknown units are empty.

    Examples
    --------
    >>> units_of_results({"length": "mm", "force": "N", "pressure": "MPa"}, "plane_strain")
    {'length': 'mm', 'force': 'N/mm', 'pressure': 'MPa', 'penalty': 'MPa/mm', 'moment': 'N mm/mm', 'stiffness': 'N/mm^2'}
    >>> units_of_results({"length": "m", "force": "N"}, "3d")
    {'length': 'm', 'force': 'N', 'pressure': '', 'penalty': '', 'moment': 'N m', 'stiffness': 'N/m'}
    """
    names = known_units(units)
    length, force, pressure = names["length"], names["force"], names["pressure"]
    names["penalty"] = f"{pressure}/{length}" if pressure and length else ""
    if not (length and force):
        return {**names, "moment": "", "stiffness": ""}
    if kinematics not in ("plane_strain", "plane_stress") or "/" in force:
        return {**names, "moment": f"{force} {length}", "stiffness": f"{force}/{length}"}
    per_thickness = {"moment": f"{force} {length}/{length}", "stiffness": f"{force}/{length}^2"}
    return {**names, "force": f"{force}/{length}", **per_thickness}


def column_units(columns: Iterable[str], units: Mapping[str, str]) -> dict[str, str]:
    """Return the names of the known units of columns of tables.

    Examples
    --------
    >>> column_units(["point", "x", "stress_xx"], {"length": "mm", "force": "N", "pressure": "MPa"})
    {'x': 'mm', 'stress_xx': 'MPa'}
    """
    kinds = {
        name: "length" if name in ("x", "y", "z") else next((COLUMNS[k] for k in COLUMNS if name.startswith(k)), "")
        for name in columns
    }
    return {name: units[kind] for name, kind in kinds.items() if units.get(kind)}


def axis_label(text: str, units: Mapping[str, str], quantity: str) -> str:
    """Return a label with the unit of its quantity in brackets, if the unit is known."""
    unit = units.get(quantity, "")
    return f"{text} [{unit}]" if unit and unit != "-" else text


def value_text(value: float, units: Mapping[str, str], quantity: str, digits: int = 4) -> str:
    """Return a value as text, with its unit if the unit is known.

    The text has `digits` significant digits, but values from ``10**digits`` to a million are rounded to integers.

    Examples
    --------
    >>> value_text(10541.9, {"pressure": "MPa"}, "pressure"), value_text(2.5e-7, {}, "length")
    ('10542 MPa', '2.5e-07')
    """
    as_integer = 10.0**digits - 0.5 <= abs(value) < 1e6
    return with_unit(f"{value:.0f}" if as_integer else f"{value:.{digits}g}", units, quantity)


def with_unit(text: str, units: Mapping[str, str], quantity: str) -> str:
    """Return the `text` of one or several values, followed by their unit if it is known."""
    return f"{text} {units.get(quantity, '')}".removesuffix(" -").rstrip()
