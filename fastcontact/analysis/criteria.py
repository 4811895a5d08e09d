"""Convergence criteria and limits of a load step."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fastcontact.errors import ModelError
from fastcontact.mesh.argument_types import typed

# Criteria beyond this are none: a state that misses them has nothing to do with the solution.
LOOSEST = 1e-2


@typed(ModelError)
@dataclass(frozen=True)
class Criteria:
    """When a load step counts as converged.

    Parameters
    ----------
    relative : float
        Largest out-of-balance force over the largest applied force, reaction or contact force (RESI_GLOB_RELA), at most
        0.01. Where iterative linear solvers miss it, their tolerance is lowered or factors take over.
    absolute : float, optional
        Largest out-of-balance force [force] that is small enough by itself (RESI_GLOB_MAXI). Without forces a relative
        criterion is 0/0; then, and by default, the bound is the round-off of the internal forces.
    geometry_updates : int or None
        How many times to re-pair on the deformed configuration after the first pairing of a step; None: until the
        displacement changes by less than `geometry` of its largest component.
    geometry : float
        See `geometry_updates`; at most 0.01. Where round-off makes displacements scatter by more than that, a step ends as
        soon as it shows, and ``iterations["scatter"]`` says by how much.
    keep_pairing : bool
        Keep the pairing of the undeformed bodies through all steps, with its normals and projections (REAC_GEOM =
        'SANS'); for small motions only. Without friction the state then does not depend on the steps that lead to it.
    max_geometry_updates, max_active_set_iterations : int
        Limits per step, and per pairing.
    max_halvings : int
        How many times a load step that does not converge is cut in halves before the analysis gives up (DECOUPE), twice
        as often with nonlinear bodies. Those go on with parts of that size, and twice it after each that took few iterations.
        Parts of a step are steps of their own, so that friction slides along their path; only the instants of the ramp
        give a result, whose ``iterations["substeps"]`` lists the ends of its parts. 0: never.
    friction_while_touching : float, optional
        A step in which nodes that close in it do more than this fraction of the work of friction so far is cut in halves,
        too, as often as one that does not converge: shear and work of friction depend on where nodes touch, which no step
        knows of nodes that touch in it. By default steps are as long as they are asked for [-].
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
