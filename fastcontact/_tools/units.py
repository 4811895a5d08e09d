"""Names of the units of a model, and a check of their consistency."""

from __future__ import annotations

from collections.abc import Mapping

from fastcontact.errors import ModelError, check_known

# Values of units in SI units, by quantity and name.
UNITS: dict[str, dict[str, float]] = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "in": 0.0254},
    "force": {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "lbf": 4.448222},
    "pressure": {
        **{"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/mm2": 1e6, "N/mm^2": 1e6},
        **{"psi": 6894.757, "ksi": 6894757.0},
    },
}
EXPECTED = "units of length, force and pressure in this order, such as 'mm, N, MPa'"


def named_units(units: str | Mapping[str, str]) -> dict[str, str]:
    """Return the names of units by quantity, from a string in the order of `UNITS` or from a mapping.

    Raises ModelError for other arguments, and for a name that is known as the unit of another quantity.

    Examples
    --------
    >>> named_units("mm, N, MPa")
    {'length': 'mm', 'force': 'N', 'pressure': 'MPa'}
    """
    if isinstance(units, str):
        names = [name.strip() for name in units.split(",")]
        if len(names) != len(UNITS) or not all(names):
            raise ModelError(f"units = '{units}' must be the {EXPECTED}")
        units = dict(zip(UNITS, names, strict=True))
    for kind, name in units.items():
        check_known("kind of unit", kind, UNITS, ModelError)
        for other_kind, known_units in UNITS.items():
            if name in known_units and other_kind != kind:
                raise ModelError(f"'{name}' is a unit of {other_kind}, not of {kind}: give the {EXPECTED}")
    return dict(units)


def si_value(units: Mapping[str, str], kind: str) -> float | None:
    """Return the unit of the quantity `kind` in SI units; None if the unit has no name or an unknown name."""
    return UNITS[kind].get(units.get(kind, ""))


def inconsistency_message(units: Mapping[str, str]) -> str:
    """Return a message if the unit of force divided by the square of the unit of length is not the unit of pressure.

    The message is empty if the units are consistent, or if one of them is unknown.
    """
    length, force, pressure = (si_value(units, kind) for kind in UNITS)
    if length is None or force is None or pressure is None or 0.99 < (ratio := force / length**2 / pressure) < 1.01:
        return ""
    return (
        f"the units are inconsistent: 1 {units['force']}/{units['length']}^2 is {ratio:.6g} {units['pressure']}; "
        "change one of the three"
    )
