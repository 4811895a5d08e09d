"""Convergence criteria and limits of a load step."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fastcontact._tools.argument_types import typed
from fastcontact.errors import ModelError

# Upper bound of the criteria: beyond it a state need not resemble the solution.
LOOSEST = 1e-2
# Fraction of the largest displacement above which a warning is given.
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
        Largest residual force [force] that is accepted by itself (RESI_GLOB_MAXI). Without forces a relative criterion is
        0/0; then, and by default, the bound is the round-off of the internal forces.
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
        Limits per step, and per pairing.
    max_halvings : int
        How many times a load step that does not converge is halved before the analysis stops (DECOUPE), twice as often
        with nonlinear bodies; these continue with substeps of that size, doubled after each one that took few iterations.
        Substeps are complete load steps, along whose path friction slides, but only the instants of the ramp yield
        results; ``iterations["substeps"]`` lists the ends of the substeps. 0: never.
    friction_while_touching : float, optional
        Solve friction along the path of load steps in which nodes slide while they close: with the geometry of their end, in
        increments on one Delassus operator, so many that in each the shear at such nodes is at most this fraction of what
        friction can carry in all. Nodes then slide from where they touch on only, so that work of friction and shear are
        those of many steps: 0.01 leaves errors of a per cent or two, for up to twice the time of the step with factors, up to
        four times the iterations with multigrid, whose increments are less accurate. Nonlinear bodies have no increments:
        their steps are halved instead, at most `max_halvings` times, while such nodes do more than this fraction of the
        frictional work so far. By default slip counts from the beginning of each step [-].

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
            if not 0 < getattr(self, name) <= LOOSEST:
                raise ModelError(
                    f"the convergence criterion {name} = {getattr(self, name)} must be positive and at most {LOOSEST}: "
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
