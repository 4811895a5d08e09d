"""Contacts whose quantities are powers of their radius, as those of Hertz and of rigid punches."""

from __future__ import annotations

from collections.abc import Mapping


def by_power_laws(laws: Mapping[str, tuple[float, float]], name: str, value: float) -> dict[str, float]:
    """Return all quantities that are ``coefficient * radius**exponent``, from the value of one.

    `laws` are coefficient and exponent of each quantity by name.

    Examples
    --------
    >>> by_power_laws({"radius": (1.0, 1.0), "area": (3.0, 2.0)}, "area", 12.0)
    {'radius': 2.0, 'area': 12.0}
    """
    coefficient, exponent = laws[name]
    radius = (value / coefficient) ** (1.0 / exponent)
    return {key: factor * radius**power for key, (factor, power) in laws.items()} | {name: value}
