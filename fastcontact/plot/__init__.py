"""Pictures: pressure against theory, the deformed shape with its stresses, history over the load.

Every function takes an optional ``ax`` and returns the axes it drew on; save with ``ax.figure.savefig``.
"""

from __future__ import annotations

from fastcontact.plot._axes import UNITS
from fastcontact.plot.axis import axis_stress
from fastcontact.plot.history import history
from fastcontact.plot.profile import pressure_profile
from fastcontact.plot.shape import deformed_shape
from fastcontact.plot.view import view
from fastcontact.plot.zones import contact_zones

__all__ = ["UNITS", "axis_stress", "contact_zones", "deformed_shape", "history", "pressure_profile", "view"]
