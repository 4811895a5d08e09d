"""Pictures: pressure against theory, the deformed shape with its stresses, history over the load.

Every function takes an optional ``ax`` and returns the axes it drew on; save with ``ax.figure.savefig``.
"""

from __future__ import annotations

from fastcontact.results.plot._axes import UNITS
from fastcontact.results.plot.axis import axis_stress
from fastcontact.results.plot.history import contact_zones, history
from fastcontact.results.plot.profile import pressure_profile
from fastcontact.results.plot.shape import deformed_shape
from fastcontact.results.plot.view import view

__all__ = ["UNITS", "axis_stress", "contact_zones", "deformed_shape", "history", "pressure_profile", "view"]


def __dir__() -> list[str]:
    return __all__
