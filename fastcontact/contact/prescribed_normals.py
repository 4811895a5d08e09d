"""Prescribed directions of the gap function: secondary normals, or one vector for the whole side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fastcontact.arrays import Array
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.pairing import Pairing
from fastcontact.contact.projection import nodal_normals
from fastcontact.contact.surface import Surface
from fastcontact.errors import ContactError, unknown

Normals = str | Sequence[float]
KINDS = ("facet", "averaged", "secondary")
# Cosine of the angle beyond which two sides do not face each other: about 85 degrees.
FACING = 0.1


def checked_normals(normals: Normals, points: Array, primary: Surface | RigidSide) -> str | tuple[float, ...]:
    """Return a key of `KINDS`, or a unit vector (dim,); `points` (n_points, dim) are reference coordinates [length].

    Raises
    ------
    ContactError
        If `normals` is neither, if the vector points into the body behind `primary`, or if `primary` is a rigid obstacle,
        which has its own normals.
    """
    dim = points.shape[1]
    if isinstance(normals, str):
        if normals not in KINDS:
            raise ContactError(unknown("kind of normals", normals, [*KINDS, "a vector"]))
        checked: str | tuple[float, ...] = normals
    else:
        vector = np.asarray(normals, float)
        length = np.linalg.norm(vector)
        if vector.shape != (dim,) or not (np.isfinite(length) and length > 0):
            raise ContactError(f"normals = {normals!r} must be one of {', '.join(KINDS)}, or a vector of {dim} numbers")
        checked = tuple((vector / length).tolist())
        if isinstance(primary, Surface) and (nodal_normals(primary, points) @ vector).mean() <= FACING * length:
            raise ContactError(
                f"normals = {normals!r} must point out of the body of '{primary.group}', the primary side: reverse the vector"
            )
    if isinstance(primary, RigidSide) and checked not in ("facet", "averaged"):
        raise ContactError(f"normals = {normals!r} are for contact between bodies: a rigid obstacle has its own")
    return checked


def opposed(pairing: Pairing, normals: Array) -> Pairing:
    """Return a pairing whose normals are opposite to those of the secondary side (n, dim), and face the primary's."""
    facing = np.einsum("nd,nd->n", pairing.normal, normals) < -FACING
    return replace(pairing, normal=np.where(facing[:, None], -normals, pairing.normal), paired=pairing.paired & facing)
