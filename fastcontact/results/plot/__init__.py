"""Plots: pressure profiles with theory, contact maps, deformed shapes, sections and histories over the load steps.

Most functions have an optional argument ``ax`` and return the axes of the plot, which ``ax.figure.savefig`` saves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastcontact.errors import module_access
from fastcontact.results.plot._axes import UNITS
from fastcontact.results.plot._shape import animate, deformed_shape, section, view
from fastcontact.results.plot.contact_map import contact_map
from fastcontact.results.plot.contact_pairs import contacts
from fastcontact.results.plot.curves import axis_stress, contact_zones, history, pressure_profile

__all__ = [
    "UNITS", "animate", "axis_stress", "contact_map", "contact_zones", "contacts", "deformed_shape", "history",
    "pressure_profile", "section", "view",
]  # fmt: skip


if not TYPE_CHECKING:  # not for type checkers, which report unknown names themselves
    __getattr__, __dir__ = module_access("fastcontact.plot", __all__)
