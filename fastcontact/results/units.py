"""Names of units in labels of results."""

from __future__ import annotations

from collections.abc import Mapping


def units_of_results(units: Mapping[str, str], kinematics: str) -> dict[str, str]:
    """Return the names of units for the results of a model: forces of plane models are those per unit of thickness.

    A unit of force that is one per length already stays, and so do dashes, which stand for units that nobody named.

    Examples
    --------
    >>> units_of_results({"length": "mm", "force": "N", "pressure": "MPa"}, "plane_strain")
    {'length': 'mm', 'force': 'N/mm', 'pressure': 'MPa'}
    """
    plane = kinematics in ("plane_strain", "plane_stress")
    named = all(units.get(key) not in (None, "", "-") for key in ("length", "force"))
    if plane and named and "/" not in units["force"]:
        return {**units, "force": f"{units['force']}/{units['length']}"}
    return {**units}
