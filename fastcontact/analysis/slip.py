"""Slip increment of the secondary nodes of a contact pair."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.pairing import Candidates, tangents
from fastcontact.results.step import ContactResult

# In facet lengths: nodes up to this distance beyond the other side may still carry pressure, by parts of their facets.
STANDS_OUT = 3.0


def slip_in_step(pair: Formulation, at: Configuration, contact: ContactResult) -> Array:
    """Return the slip (m, dim) of the closed nodes in a step that ends at the configuration `at` [length]."""
    if pair.options.tied or not contact.active.any():
        return np.zeros_like(contact.coordinates)
    held = contact.sticking & bool(pair.friction) & (pair.options.tangential_penalty is None)
    return np.where((contact.active & ~held)[:, None], slip_of_nodes(pair, at), 0.0)


def slip_of_nodes(pair: Formulation, at: Configuration) -> Array:
    """Return the slip increment (m, dim) of the secondary nodes, zero where they face nothing [length]."""
    nodes = Candidates.nodes_of(pair.secondary)
    pairing = pair.facing(nodes, at, max(pair.projection_tolerance or 0.0, STANDS_OUT))
    directions = tangents(pairing.normal)
    rows, slip0 = pair.slips(nodes, pairing, directions, at)
    along = np.stack([row @ (at.displacement - at.start).ravel() for row in rows])
    along += 0.0 if slip0 is None else slip0
    slip = np.einsum("kn,knd->nd", along, np.stack(directions))
    return np.where(pairing.paired[:, None], slip, 0.0)
