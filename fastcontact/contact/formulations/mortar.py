"""Mortar contact: gaps are integrated over the segments in which two facets overlap.

There are two methods of this name. In 2D with standard multipliers, the contact status is determined at integration points,
see `_segment_mortar`. In 3D, or with dual multipliers, each secondary node has one weighted gap, see `_weighted_mortar`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fastcontact.contact.formulations._formulation import Formulation
from fastcontact.contact.formulations._segment_mortar import SegmentMortar
from fastcontact.contact.formulations._weighted_mortar import WeightedMortar


class Mortar(SegmentMortar):
    """The formulation ``"mortar"`` of users; `variant` selects the method."""

    @classmethod
    def variant(cls, dim: int, options: Mapping[str, Any]) -> type[Formulation]:
        """Return the class of the method for `dim` dimensions and the option `multipliers`."""
        weighted = dim == 3 or str(options.get("multipliers", "standard")) != "standard"
        return WeightedMortar if weighted else SegmentMortar


FORMULATION = Mortar
