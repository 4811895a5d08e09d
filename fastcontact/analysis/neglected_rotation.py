"""Strains that linear kinematics neglect in bodies that rotate, compared by the work of the stresses.

In a rotation by a small angle, linear kinematics neglect the strain ``0.5 W.T @ W``, where W is the antisymmetric part of
the displacement gradient. The work of the stresses on it, relative to that on the linear strain, shows whether it matters:
it vanishes for a beam in bending, whose stresses cancel over the thickness, but not for a belt in tension.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fastcontact.analysis.problem import Problem
from fastcontact.arrays import Array
from fastcontact.elasticity.energy import gradients_at
from fastcontact.elasticity.recovery import BATCH
from fastcontact.mesh import elements
from fastcontact.mesh.topology import bodies
from fastcontact.model.rigid_motions import body_name
from fastcontact.results.step import StepResult
from fastcontact.round_off import SINGLE_PRECISION, TINY

# Work of the stresses on neglected strains over that on strains, and equivalent strain, above which linear kinematics give a
# warning: the fraction that they neglect of a strain is about as large as that strain. So does wear of this part of
# the size of the model.
NEGLECTED = 0.1


def neglected_rotation(problem: Problem, last: StepResult, angle: float) -> Iterator[str]:
    """Yield a warning for the body in which linear kinematics neglect most; `angle` is the largest rotation [radian]."""
    mesh = problem.model.mesh
    neglected, strained = _works(problem, last)
    # Bodies whose work on strains is round-off of that of other bodies are free of stress.
    ratio = np.abs(neglected) / np.maximum(strained, max(SINGLE_PRECISION * strained.max(initial=0.0), TINY))
    worst = int(np.argmax(ratio))
    if ratio[worst] > NEGLECTED:
        name = body_name(mesh, bodies(mesh)[1], worst)
        yield (
            f"rotations of up to {angle:.2g} radian matter in body {name}: on the strains that linear kinematics neglect its "
            f"stresses would do {ratio[worst]:.0%} of their work on strains. Solve the model with strain='finite'"
        )


def _works(problem: Problem, last: StepResult) -> tuple[Array, Array]:
    """Return the work of the stresses on neglected strains, and its absolute value on strains, both (n_bodies,) [energy]."""
    mesh, dim, axisymmetric = problem.model.mesh, problem.model.mesh.dim, problem.model.kinematics == "axisymmetric"
    count, body = bodies(mesh)
    neglected, strained = np.zeros((2, count))
    pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]
    for name, block in mesh.solids.items():
        element = elements.get(name)
        places, weights = element.quadrature
        N, dN = element.shape(places), element.gradient(places)
        for cells in np.array_split(block, len(block) * dN.nbytes // BATCH + 1):
            gradient, volume = gradients_at(mesh.points[cells], dN)
            stress, volume = N @ last.stress[cells], np.abs(volume) * weights
            slope = np.einsum("cad,cqak->cqdk", last.displacement[cells], gradient, optimize=True)
            tensor = np.zeros_like(slope)
            for column, (i, j) in enumerate(pairs[: stress.shape[2]]):
                if max(i, j) < dim:
                    tensor[..., i, j] = tensor[..., j, i] = stress[..., column]
            on_strain = (tensor * slope).sum(axis=(2, 3))
            if axisymmetric:
                radius, outward = (values[cells][..., 0] @ N.T for values in (mesh.points, last.displacement))
                volume, on_strain = volume * radius, on_strain + stress[..., 2] * outward / radius
            turn = 0.5 * (slope - slope.transpose(0, 1, 3, 2))
            on_rest = 0.5 * (tensor * (turn.transpose(0, 1, 3, 2) @ turn)).sum(axis=(2, 3))
            np.add.at(neglected, body[cells[:, 0]], (on_rest * volume).sum(axis=1))
            np.add.at(strained, body[cells[:, 0]], (np.abs(on_strain) * volume).sum(axis=1))
    return neglected, strained
