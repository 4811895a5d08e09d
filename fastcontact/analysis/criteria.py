"""Convergence criteria and limits of a load step."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fastcontact._tools.argument_types import typed
from fastcontact.errors import ModelError

# Relative error of displacements or forces above which a warning is given. It is also the largest admissible value of
# criteria, because with larger ones the result need not be close to the solution.
NOTABLE = 1e-2
# Ratio, or excess of a ratio over one, above which a warning is given. It applies to
# - the frictional work of nodes in the steps in which they close, relative to the total frictional work;
# - the error of the stiffness due to strains that linear kinematics neglect;
# - strains, because the fraction of a strain that linear kinematics neglect is about as large as the strain;
# - the wear depth, relative to the size of the model;
# - the excess of the largest nodal pressure near the edge over means of neighbouring facets, where bodies yield;
# - the length of the facets of one side, relative to that of the other side.
WARNING_RATIO = 0.1
# Largest number of times that the step of an iteration is halved: the iterations for displacements, for positions of floating
# bodies, and for friction forces.
HALVINGS = 6
# Steps are halved until they reduce a norm by this fraction of the expected reduction (Nocedal and Wright, 2006, equation
# 3.4).
DECREASE = 1e-4
# Estimated relative error of a linear solution, relative to its residual.
LINEAR_ERROR = 10.0
# Largest number of Newton iterations: of a load step, for a friction law, and of the positions of floating bodies.
MAX_NEWTON_ITERATIONS = 40


@typed(ModelError)
@dataclass(frozen=True)
class Criteria:
    """Convergence criteria of a load step.

    Parameters
    ----------
    relative : float
        Largest admissible residual force, divided by the largest applied force, reaction or contact force; at most 0.01 [-]
        (RESI_GLOB_RELA of code_aster). If an iterative linear solver does not reach it, its tolerance is reduced, or a
        factorisation replaces it.
    absolute : float, optional
        Largest admissible residual force, as an alternative to `relative` [force] (RESI_GLOB_MAXI). If all forces vanish,
        the bound is the round-off of the internal forces.
    geometry_updates : int or None
        Number of times that the surfaces are paired on the deformed configuration after the first pairing of a step. By
        default they are paired until the displacements change by less than `geometry` times the largest one.
    geometry : float
        Relative change of the displacements at which the geometry has converged, at most 0.01 [-]. If displacements scatter
        by more than this due to round-off, the step ends as soon as this is detected; ``iterations["scatter"]`` states the
        scatter.
    keep_pairing : bool
        Whether to use the pairing of the undeformed configuration, with its normals and projections, in all steps
        (REAC_GEOM = 'SANS'). This is only valid for small displacements. Without friction the solution then does not depend
        on the load path.
    max_geometry_updates : int
        Largest number of pairings in a step, and of exchanges between contact and heat conduction.
    max_active_set_iterations : int
        Largest number of active-set iterations for a pairing.
    max_halvings : int
        Number of times that a load step that does not converge is halved before the analysis stops (DECOUPE); zero means
        never. With nonlinear bodies it is twice this number, and the size of substeps doubles after each one that took few
        iterations. Substeps are complete load steps, so that friction follows their path, but only the instants of the ramp
        have results; ``iterations["substeps"]`` lists the ends of the substeps.
    friction_while_touching : float, optional
        Load steps in which nodes close and carry more shear than this fraction of the coefficient of friction times the
        normal forces are solved in increments that end where nodes close, with one Delassus operator and with the geometry
        at the end of the step. Slip is then measured from the instant at which a node closes, otherwise from the beginning of
        the step. By default 0.001 in plane and axisymmetric models of linear bodies, at obstacles and between bodies with
        dual mortar multipliers, unless `geometry_updates` is given or only contact restrains a body; elsewhere 1, which
        means that no step is divided. A step takes up to twice the time with the direct solver, more if some dozens of nodes
        close in it, and many times the iterations with multigrid. With nonlinear bodies, steps are halved instead, at most
        `max_halvings` times, as long as such nodes do more than this fraction of the frictional work so far [-].

    Examples
    --------
    Pair the surfaces three times per load step, as code_aster does with REAC_GEOM = 'CONTROLE':

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
                    "with a larger value the result need not be close to the solution"
                )
        updates = self.geometry_updates
        if updates is not None and (updates < 0 or int(updates) != updates):
            raise ModelError(f"geometry_updates = {self.geometry_updates} must be None or a whole number >= 0")
        for name, least in (("max_geometry_updates", 0), ("max_active_set_iterations", 1), ("max_halvings", 0)):
            if getattr(self, name) < least or int(getattr(self, name)) != getattr(self, name):
                raise ModelError(f"{name} = {getattr(self, name)} must be a whole number >= {least}")
        if self.absolute is not None and not 0 <= self.absolute < math.inf:
            raise ModelError(f"the convergence criterion absolute = {self.absolute} must be a force >= 0, or None")
        if self.friction_while_touching is not None and not 0 < self.friction_while_touching <= 1:
            raise ModelError(f"friction_while_touching = {self.friction_while_touching} must be above 0 and at most 1")
        if self.keep_pairing and self.geometry_updates:
            raise ModelError(f"keep_pairing excludes geometry_updates = {self.geometry_updates}: give one or the other")
