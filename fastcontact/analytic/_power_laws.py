"""Contacts whose quantities are power laws of the contact radius, such as Hertzian contacts and rigid punches."""

from __future__ import annotations

from collections.abc import Mapping


def by_power_laws(laws: Mapping[str, tuple[float, float]], name: str, value: float) -> dict[str, float]:
    """Return all quantities ``coefficient * radius**exponent`` from the value of one of them.

    `laws` contains the coefficient and the exponent of each quantity by its name.

    Examples
    --------
    >>> by_power_laws({"radius": (1.0, 1.0), "area": (3.0, 2.0)}, "area", 12.0)
    {'radius': 2.0, 'area': 12.0}
    """
    coefficient, exponent = laws[name]
    radius = (value / coefficient) ** (1.0 / exponent)
    return {key: factor * radius**power for key, (factor, power) in laws.items()} | {name: value}
