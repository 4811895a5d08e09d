"""Stiffness of the contact forces of a converged step, which follow the motion of the surfaces.

The multipliers are constant, so that the second variation of the energy is that of ``-multiplier @ gap``: the normals of the
primary side rotate, and the secondary side slides along its curvature.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from fastcontact.analysis.modal.held_contact import configuration_of
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.held_motions import HeldMotions
from fastcontact.contact.integration import areas_of_rule, fine_rule
from fastcontact.contact.linearised_projections import paired_points
from fastcontact.contact.pairing import Candidates
from fastcontact.model.model import Model
from fastcontact.results.step import StepResult


def contact_stiffness(model: Model, step: StepResult, held: HeldMotions) -> csr_array:
    """Return the stiffness (n_dofs, n_dofs) of the contact forces of a step, with the degrees of freedom of obstacles.

    Its unit is [force / length].
    """
    driven = model.force_driven
    K = csr_array((driven.n_dofs, driven.n_dofs))
    for pair in model.contact:
        formulation = model.bind(pair, held, sectors_alike=False)
        if formulation.options.kind not in ("gap_only", "tied"):
            stiffness = _pair_stiffness(formulation, step, pair.name, model.strain == "finite")
            K += driven.contact_stiffness(pair.name, stiffness)
    return K


def _pair_stiffness(pair: Formulation, step: StepResult, name: str, finite: bool) -> csr_array:
    """Return the stiffness (n_dofs, n_dofs) of the pressure on the secondary side of a pair [force / length]."""
    configuration, deformed, pressure = configuration_of(step, name, pair), pair.points + step.displacement, []
    for block in pair.secondary.blocks:
        shape, areas = areas_of_rule(block, deformed if finite else pair.points, pair.axisymmetric)
        pressure.append((areas * (step.contact[name].pressure[block.local] @ shape.T)).ravel())
    force = np.concatenate(pressure)
    candidates = Candidates.in_facets(pair.secondary, [fine_rule(block.element)[0] for block in pair.secondary.blocks])
    pairing = pair.pair_candidates(candidates, configuration)
    rows = np.flatnonzero(pairing.paired & (force != 0.0))
    normals = "facet" if pair.normals == "secondary" else pair.normals
    points = paired_points(candidates, pairing, rows, pair.primary, pair.points, configuration, normals)
    return points.stiffness(force[rows])
