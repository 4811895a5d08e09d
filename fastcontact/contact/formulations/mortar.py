"""Mortar contact: gaps integrated exactly over the segments where two facets overlap.

Two methods share this name. With standard multipliers in two dimensions contact is decided at integration points, see
`_segment_mortar`; between faces in 3D, and with dual multipliers, each node has one weighted gap, see `_weighted_mortar`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fastcontact.contact.formulations._formulation import Formulation
from fastcontact.contact.formulations._segment_mortar import SegmentMortar
from fastcontact.contact.formulations._weighted_mortar import WeightedMortar


class Mortar(SegmentMortar):
    """Mortar formulation as named by the user; `variant` selects the method."""

    @classmethod
    def variant(cls, dim: int, options: Mapping[str, Any]) -> type[Formulation]:
        """Return the method for lines or faces and for the kind of multipliers."""
        weighted = dim == 3 or str(options.get("multipliers", "standard")) != "standard"
        return WeightedMortar if weighted else SegmentMortar


FORMULATION = Mortar
