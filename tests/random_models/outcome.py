"""Outcome of a random model: a checked result, an error of the package, or a finding."""

import re
import time
import traceback
import warnings
from typing import Any

import mechanics
import numpy as np
from drawing import Drawn, drawn
from laws import with_law
from stepping import watching
from wording import reworded

import fastcontact as fc

# What may be left of what vanishes in an exact solution, by figure; see `mechanics`.
BOUNDS = {
    "balance": 1.05e-6,  # the promise of `Criteria.relative`
    "given back": 1e-10,
    "penetration": 1e-8,
    "tension": 1e-8,
    "product": 1e-8,
    "displaced": 1e-8,
    "cone": 1e-8,
    "driving": 1e-8,
    "carried": 1e-9,
    "moment": 1e-2,  # of normals that are means, over the size of the force times the extent of the side
}
# What vanishes with interface laws, too; a layer across a gap transmits tractions along it with a moment.
WITH_LAWS = ("balance", "given back")
# With iterative solvers gaps are as accurate as displacements are.
ITERATIVE = {"penetration": 1e-6, "product": 1e-6, "displaced": 1e-6}


# What another order of the same sums may change: displacements over their largest, forces over the sum of their sizes.
SAME = 1e-7
# Forces below this part of the largest modulus times size and displacement of the model are round-off.
NOTHING = 1e-8
# Round-off of coordinates: interferences and displacements of this part of the size of the model are none.
ROUND_OFF = 16 * float(np.finfo(float).eps)


def outcome(seed: int, law: str = "") -> dict[str, Any]:
    """Return a row about the model of a seed, with an interface law; see `laws`."""
    begin = time.process_time()
    row: dict[str, Any] = {"seed": seed}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", fc.FastcontactWarning)
            warnings.simplefilter("error", RuntimeWarning)
            model = with_law(drawn(seed), law) if law else drawn(seed)
            row |= model.labels
            row |= solved(model)
    except fc.FastcontactError as error:
        row |= {"outcome": "own error", "text": f"{type(error).__name__}: {error}"}
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        row |= {"outcome": "raw error", "text": f"{type(error).__name__}: {error} ({where.filename}:{where.lineno})"}
    return row | {"seconds": round(time.process_time() - begin, 2)}


def solved(given: Drawn) -> dict[str, Any]:
    """Solve a model and check its last step."""
    with watching() as watched:
        steps = fc.solve(given.model, given.ramp, **given.options)
    last, factor = steps[-1], float(np.interp(given.ramp.instants[-1], *zip(*given.ramp.table, strict=True)))
    iterative = given.options.get("linear_solver") == "amg"
    tolerance = 1e-10 * iterative
    found = figures(given.model, last, watched, factor, tolerance)
    bounds = BOUNDS | (ITERATIVE if iterative else {})
    if "law" in given.labels:
        bounds = {name: bounds[name] for name in WITH_LAWS}
    wrong = [name for name, bound in bounds.items() if not found[name] <= bound]
    wrong += unfit(last)
    closed = sum(int(contact.active.sum()) for contact in last.contact.values())
    largest_force = mechanics.out_of_balance(given.model, last, factor, tolerance)[1].force
    found |= said_again(given, last, wrong, _wandering(given, steps[:-1]), largest_force)
    found |= {"closed": closed, "updates": last.iterations["geometry_updates"], "warnings": len(last.warnings)}
    if wrong:
        text = ", ".join(f"{name} {found[name]:.2g}" if name in found else name for name in wrong)
        return {"outcome": "told" if told(wrong, last) else "failed check", "text": text, **found}
    return {"outcome": "result", "text": "", **found}


def _wandering(given: Drawn, before: list[fc.StepResult]) -> bool:
    """Whether later steps depend on positions that nothing determines: friction counts slip from them."""
    free = any(step.iterations.get("regularised", {}).get("undetermined") for step in before)
    return free and any(pair.options.get("friction") for pair in given.model.contact)


def said_again(
    given: Drawn, last: fc.StepResult, wrong: list[str], wandering: bool, largest_force: float
) -> dict[str, Any]:
    """Solve the model in other words; what differs by more than rounding joins what is `wrong`.

    After steps in which bodies had no determined position, results with friction are not unique, and only solved again.
    `largest_force` is infinite where all forces are round-off.
    """
    other = reworded(given.model, np.random.default_rng([given.seed, 7]))
    if other is None:
        return {}
    found: dict[str, Any] = {"words": other.words}
    try:
        again = fc.solve(other.model, given.ramp, **given.options)[-1]
    except fc.FastcontactError as error:
        wrong.append(f"{other.words}: {type(error).__name__}: {error}")
        return found
    apart = _without_undetermined(given.model.mesh, other.back(again.displacement) - last.displacement, last)
    largest, size = np.abs(last.displacement).max(), np.ptp(given.model.mesh.points, axis=0).max()
    found["said again"] = float(np.abs(apart).max() / max(largest, ROUND_OFF / SAME * size))
    # Forces of round-off, of a pair that hardly touches in a model that others load, differ as they like.
    sums = [np.linalg.norm(one.force_vectors, axis=1).sum() for one in last.contact.values()]
    modulus = max(np.max(material.E) for material, _ in given.model.materials)
    least = NOTHING * largest + ROUND_OFF / SAME * size
    stiffness = modulus * (1.0 if given.model.kinematics in ("plane_strain", "plane_stress") else size)
    scale = max(*sums, np.linalg.norm(last.reaction, axis=1).sum(), least * stiffness, largest_force) or 1.0
    changes = [np.linalg.norm(again.contact[name].force @ other.Q - one.force) for name, one in last.contact.items()]
    found["force said again"] = float(max(changes) / scale)
    # Both results may be as far from the exact one as their warnings about scatter tell.
    same = 1e-5 if given.options.get("linear_solver") == "amg" else SAME
    told = [step.iterations.get("scatter", {}) for step in (last, again)]
    for name, key in (("said again", "displacement"), ("force said again", "force")):
        bound = same + 2.0 * sum(scatter.get(key, 0.0) for scatter in told)
        wrong += [] if wandering or found[name] <= bound else [name]
    return found


def _without_undetermined(mesh: fc.Mesh, apart: np.ndarray, step: fc.StepResult) -> np.ndarray:
    """Return differences of displacements (n_points, dim) without rigid motions of bodies whose position is not determined.

    A warning names these bodies: no contact force acts on them along a free motion, so that any position is a solution.
    """
    free, apart, dim = step.iterations.get("regularised", {}).get("undetermined", {}), apart.copy(), mesh.dim
    for name in {name for body in free for name in re.findall("'(.+?)'", body)}:
        if name not in mesh.cell_groups:
            continue
        points = mesh.points_of(name)
        x = mesh.points[points] - mesh.points[points].mean(axis=0)
        turns = [
            np.outer(x[:, i], np.eye(dim)[j]) - np.outer(x[:, j], np.eye(dim)[i]) for i in range(dim) for j in range(i)
        ]
        motions = np.stack([np.tile(along, (len(x), 1)) for along in np.eye(dim)] + turns).reshape(-1, x.size).T
        change = apart[points].ravel()
        apart[points] -= (motions @ np.linalg.lstsq(motions, change, rcond=None)[0]).reshape(x.shape)
    return apart


def figures(model: fc.Model, step: fc.StepResult, watched, factor: float, tolerance: float = 0.0) -> dict[str, float]:
    """Return what must vanish; see `mechanics`."""
    settled = watched.settled
    balance, sizes = mechanics.out_of_balance(model, step, factor, tolerance)
    penetration, tension, product = mechanics.complementarity(settled, sizes)
    cone, driving = mechanics.friction(settled, sizes)
    both = [mechanics.given_back(model, step, sizes, pair.name) for pair in model.contact if pair.obstacle is None]
    return {
        "balance": balance,
        "given back": max((force for force, _ in both), default=0.0),
        "moment": max((moment for _, moment in both), default=0.0),
        "penetration": penetration,
        "tension": tension,
        "product": product,
        "displaced": mechanics.displaced_gaps(settled, watched.u, sizes),
        "cone": cone,
        "driving": driving,
        "carried": max(mechanics.carried(model, step, settled, sizes, name) for name in step.contact),
    }


# Checks that a result may fail where a warning tells so: the moment on curved sides that are as accurate as facets, which are
# too few; pressures of places that are two nodes, whose areas differ by what curved facets do; round-off of stiff bodies that
# move far, with its number.
TOLD = {
    "moment": "across its radius",
    "carried": "where a period or sector begins and ends",
    "balance": "forces are out of balance by",
}


def told(wrong: list[str], step: fc.StepResult) -> bool:
    """Whether a warning tells all that fails."""
    return all(name in TOLD and any(TOLD[name] in text for text in step.warnings) for name in wrong)


def unfit(step: fc.StepResult) -> list[str]:
    """Return what of a result is not finite, or contradicts itself."""
    found = []
    for name in ("displacement", "stress", "von_mises", "reaction"):
        if not np.isfinite(getattr(step, name)).all():
            found.append(f"{name} not finite")
    for contact in step.contact.values():
        for name in ("pressure", "multiplier", "force_vectors", "force", "shear", "place", "middle", "normal"):
            if not np.isfinite(getattr(contact, name)).all():
                found.append(f"{name} not finite")
        if contact.pressure[~contact.active].any():
            found.append("pressure on open nodes")
        if contact.active.any() and contact.force.any() and not contact.radius[0] <= contact.radius[1]:
            found.append(f"radius {contact.radius}")
        if contact.dissipation < -1e-9 * np.linalg.norm(contact.force) * np.abs(step.displacement).max(initial=0.0):
            found.append("negative dissipation")
    return found
