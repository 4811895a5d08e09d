"""Positions of nodes along the principal axes of an elliptical contact in 3D, for comparison with `hertz_elliptical`."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array
from fastcontact.results.step import ContactResult

# Largest deviation [radian] of the angle between two planes of symmetry from 90 degrees, or of one plane from 180 degrees.
ANGLE_TOLERANCE = 1e-3


def principal_coordinates(contact: ContactResult, share: float) -> Array | None:
    """Return the positions (m, 2) of the secondary nodes along the major and the minor axis of the contact [length].

    They are relative to the middle. Of the complete contact, the model contains the fraction `share` [-]. In a complete
    contact, the axes are the principal axes of the second moments of the normal forces. In a half or a quarter, they are
    parallel or normal to the planes of symmetry, at which the surface ends. The result is None if the axes are unknown:
    without a mean normal, without pressure, or if the surface does not extend over this fraction of the circumference.
    """
    force, normal = contact.normal_forces, contact.direction
    if normal is None or not float(force.sum()) > 0.0:
        return None
    position = (contact.coordinates - contact.middle) @ np.linalg.svd(normal[None])[2][1:].T
    distance = np.linalg.norm(position, axis=1)
    # The angle of the node in the middle is round-off.
    angle = np.sort(np.arctan2(*position[distance > ANGLE_TOLERANCE * distance.max()].T[::-1]))
    gap = np.diff(angle, append=angle[:1] + 2.0 * np.pi)
    if not len(gap):
        return None
    widest = int(gap.argmax())
    if share == 1.0 and gap[widest] < 0.5 * np.pi:  # nodes on all sides
        moments = np.einsum("n,ni,nj->ij", force, position, position)
        return np.asarray(position @ np.linalg.eigh(moments)[1][:, ::-1])
    if share not in (0.5, 0.25) or abs(2.0 * np.pi * (1.0 - share) - gap[widest]) > ANGLE_TOLERANCE:
        return None
    plane = angle[(widest + 1) % len(angle)]
    along = position @ np.array([[np.cos(plane), -np.sin(plane)], [np.sin(plane), np.cos(plane)]])
    return along[:, np.argsort(force @ along**2)[::-1]]
