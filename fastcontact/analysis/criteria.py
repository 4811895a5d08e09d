"""Convergence criteria and limits of a load step."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fastcontact._tools.argument_types import typed
from fastcontact.errors import ModelError

# Fraction of the largest displacement or force above which errors are notable: a warning is given, and no criterion is
# larger, because a state need not resemble the solution beyond it.
NOTABLE = 1e-2


@typed(ModelError)
@dataclass(frozen=True)
class Criteria:
    """Convergence criteria of a load step.

    Parameters
    ----------
    relative : float
        Largest residual force divided by the largest applied force, reaction or contact force (RESI_GLOB_RELA), at most
        0.01. If an iterative linear solver misses it, its tolerance is lowered or a factorisation takes over.
    absolute : float, optional
        Largest admissible residual force [force] (RESI_GLOB_MAXI), an alternative to `relative`. By default, and if
        there are no forces, the bound is the round-off of the internal forces.
    geometry_updates : int or None
        Number of contact detections on the deformed configuration after the first one of a step; None: until the
        displacement changes by less than `geometry` times its largest component.
    geometry : float
        See `geometry_updates`; at most 0.01. If round-off makes the displacement scatter by more than that, the step ends
        as soon as this is detected, and ``iterations["scatter"]`` holds the amount.
    keep_pairing : bool
        Keep the pairing of the undeformed configuration, with its normals and projections, in all steps (REAC_GEOM =
        'SANS'); for small motions only. Without friction the solution is then independent of the load path.
    max_geometry_updates, max_active_set_iterations : int
        Limits per step, and per pairing; the former also limits the exchanges between contact and heat conduction.
    max_halvings : int
        How many times a load step that does not converge is halved before the analysis stops (DECOUPE); twice as many
        with nonlinear bodies, whose substeps double in size after each one that took few iterations. Substeps are
        complete load steps, with friction along their path, but only the instants of the ramp yield results;
        ``iterations["substeps"]`` lists the ends of the substeps. 0: never.
    friction_while_touching : float, optional
        If given, friction is solved along the path of load steps in which nodes close and slide: in increments with
        one Delassus operator and the geometry at the end of the step. The increments are so small that in each the
        shear of these nodes is at most this fraction of the friction capacity. Nodes then slide only from the instant
        of contact on, and work of friction and shear are those of many steps. A value of 0.01 leaves errors of a few
        percent; a step takes up to twice the time with the direct solver, and up to six times the iterations with
        multigrid. With nonlinear bodies, steps are halved instead, at most
        `max_halvings` times, while such nodes do more than this fraction of the work of friction so far. By default
        slip is counted from the beginning of each step [-].

    Examples
    --------
    Contact detection three times per load step, as code_aster does by default:

    >>> import fastcontact as fc
    >>> criteria = fc.Criteria(geometry_updates=2)
    """

    relative: float = 1e-6
    absolute: float | None = None
    geometry_updates: int | None = None
    geometry: float = 1e-11
    keep_pairing: bool = False
    max_geometry_updates: int = 60
    max_active_set_iterations: int = 200
    max_halvings: int = 4
    friction_while_touching: float | None = None

    def __post_init__(self) -> None:
        for name in ("relative", "geometry"):
            if not 0 < getattr(self, name) <= NOTABLE:
                raise ModelError(
                    f"the convergence criterion {name} = {getattr(self, name)} must be positive and at most {NOTABLE}: "
                    "beyond that nothing has converged"
                )
        updates = self.geometry_updates
        if updates is not None and (updates < 0 or int(updates) != updates):
            raise ModelError(f"geometry_updates = {self.geometry_updates} must be None or a whole number >= 0")
        for name, least in (("max_geometry_updates", 0), ("max_active_set_iterations", 1)):
            if getattr(self, name) < least or int(getattr(self, name)) != getattr(self, name):
                raise ModelError(f"{name} = {getattr(self, name)} must be a whole number >= {least}")
        if self.absolute is not None and not 0 <= self.absolute < math.inf:
            raise ModelError(f"the convergence criterion absolute = {self.absolute} must be a force >= 0, or None")
        if self.max_halvings < 0 or int(self.max_halvings) != self.max_halvings:
            raise ModelError(f"max_halvings = {self.max_halvings} must be a whole number >= 0")
        if self.friction_while_touching is not None and not 0 < self.friction_while_touching <= 1:
            raise ModelError(
                f"friction_while_touching = {self.friction_while_touching} must be a fraction, above 0, up to 1"
            )
        if self.keep_pairing and self.geometry_updates:
            raise ModelError(
                f"keep_pairing leaves no room for geometry_updates = {self.geometry_updates}: give one or the other"
            )
