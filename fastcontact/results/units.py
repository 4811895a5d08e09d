"""Names of units in labels of results."""

from __future__ import annotations

from collections.abc import Mapping


def units_of_results(units: Mapping[str, str], kinematics: str) -> dict[str, str]:
    """Return the names of units for the results of a model: forces of plane models are those per unit of thickness.

    A unit of force that is one per length already stays.

    Examples
    --------
    >>> units_of_results({"length": "mm", "force": "N", "pressure": "MPa"}, "plane_strain")
    {'length': 'mm', 'force': 'N/mm', 'pressure': 'MPa'}
    """
    plane = kinematics in ("plane_strain", "plane_stress")
    if plane and units.get("length") and "/" not in (units.get("force") or "/"):
        return {**units, "force": f"{units['force']}/{units['length']}"}
    return {**units}
