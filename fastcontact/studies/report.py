"""What the reports of all studies share: the case, and the frame of their dictionaries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fastcontact.cases.summary import versions


@dataclass(frozen=True, eq=False)
class Report:
    """A finished study of a case.

    Attributes
    ----------
    name, title, text : str
        Of the case: file name without suffix, title, text of the file.
    units : dict of str to str
        Names of the units of length, force and pressure.
    """

    name: str
    title: str
    text: str
    units: dict[str, str]

    def framed(self, numbers: dict[str, Any]) -> dict[str, Any]:
        """Return the numbers of a study as ``--json`` writes them, between its case and the versions."""
        case = {"case": self.name, "title": self.title, "units": dict(self.units)}
        return {**case, **numbers, "versions": versions()}
