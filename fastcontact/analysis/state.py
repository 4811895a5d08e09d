"""State of an analysis: everything that a load step changes."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.floating_bodies import RigidPosition
from fastcontact.analysis.wear import Worn
from fastcontact.analysis.work import ContactForces, Work
from fastcontact.arrays import Array, Mask
from fastcontact.contact.cohesion import Bond

# What a restart stores of each contact pair, and of numbers: key and attribute.
OF_PAIRS = {
    "closed": "never_opening", "now": "obstacles", "first_contact": "first_contact", "elastic_slip": "elastic_slip",
    "angle": "angles", "slipped": "slipped", "worn": "worn",
}  # fmt: skip
NUMBERS = {"largest_force": "largest_force", "largest_work": "largest_rigid_force", "round_off": "gap_round_off"}


@dataclass(frozen=True, eq=False)
class State:
    """The state at the end of a load step, or before the first one.

    A load step returns a new state and leaves this one as it is: arrays are replaced, never written into. So a state is its
    own snapshot, and its `to_dict` is what a restart stores.

    Attributes
    ----------
    u : ndarray (n_dofs,)
        Displacements of all points, then of the obstacles that forces drive [length].
    active : dict of str to ndarray of bool (m,)
        By contact pair, the constraints to start from as active.
    pressure : dict of str to ndarray (n_nodes,)
        By contact pair, the last nodal pressures [pressure].
    obstacles : dict of str to ndarray (dim,)
        By contact pair, the displacement of its rigid obstacle [length].
    angles : dict of str to float
        By contact pair, by how much its rigid obstacle has turned, where one does [radian].
    worn : dict of str to Worn
        By contact pair that wears, what has been worn off.
    slipped : dict of str to ndarray (m, dim)
        By contact pair, the slip of its secondary nodes so far [length].
    never_opening : dict of str to (ndarray (m, dim), ndarray of bool (m,))
        By contact pair that is bilateral once closed, places of constraints [length] and which of them are closed for good.
    elastic_slip : dict of str to (ndarray (m, dim), ndarray (m, dim))
        By contact pair whose sticking constraints have a compliance of their own, places of constraints and the slips by
        which they give way to the present forces [length].
    first_contact : dict of str to (ndarray (dim,), ndarray (dim,))
        By contact pair in space, where the bodies met first [length] and the normal there [-].
    bonds : dict of str to Bond
        By contact pair with a cohesive layer, what that is like.
    locked : dict of str to float or ndarray (m,)
        By locked pretension section, its shortening from when it was locked [length]; by temporary relation, the values that
        it began with; by temperature that began later, the rise (n_points,) of then [temperature].
    extrapolation : Extrapolation
        The last two converged steps.
    gap_round_off : float
        Gaps are no more accurate than this [length].
    largest_force, largest_rigid_force : float
        Of all steps so far: the largest force [force], and the largest force of loads on a free rigid motion [force].
    touched : frozenset of str
        Contact pairs that were closed at the end of a step.
    work : Work, optional
        Of all steps so far; None behind steps of a version that did not count it.
    forces : dict of str to ContactForces
        By contact pair, what the work of the next step needs.
    last_change : (int, float), optional
        The fixed number of geometry updates of the last step, and the relative change by the last one.
    rigid : RigidPosition, optional
        Rigid position of floating bodies in the last step.
    history : dict of str to ndarray (n_cells, n_q, 9)
        By solid element of nonlinear bodies, see `constitutive_kernels`; none before the first step.
    rise : ndarray (n_points,), optional
        Of the temperature over the reference, where heat is conducted [temperature].
    instant : float
        Pseudo-time.
    halved : int
        How often load steps of nonlinear bodies are halved before they are tried.
    solver : dict
        All that later solutions owe to earlier ones, see `LinearSolver.snapshot`.
    """

    u: Array
    gap_round_off: float
    active: Mapping[str, Mask] = field(default_factory=dict)
    pressure: Mapping[str, Array] = field(default_factory=dict)
    obstacles: Mapping[str, Array] = field(default_factory=dict)
    angles: Mapping[str, float] = field(default_factory=dict)
    worn: Mapping[str, Worn] = field(default_factory=dict)
    slipped: Mapping[str, Array] = field(default_factory=dict)
    never_opening: Mapping[str, tuple[Array, Mask]] = field(default_factory=dict)
    first_contact: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)
    elastic_slip: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)
    bonds: Mapping[str, Bond] = field(default_factory=dict)
    locked: Mapping[str, Any] = field(default_factory=dict)
    extrapolation: Extrapolation = field(default_factory=Extrapolation)
    largest_force: float = 0.0
    largest_rigid_force: float = 0.0
    touched: frozenset[str] = frozenset()
    work: Work | None = None
    forces: Mapping[str, ContactForces] = field(default_factory=dict)
    last_change: tuple[int, float] | None = None
    rigid: RigidPosition | None = None
    history: Mapping[str, Array] = field(default_factory=dict)
    rise: Array | None = None
    instant: float = 0.0
    halved: int = 0
    solver: Mapping[str, Any] = field(default_factory=dict)

    def after_touching(self, pairs: Iterable[str]) -> State:
        """Return the state with these contact pairs closed; pairs that have touched keep their first contact."""
        touched = self.touched.union(pairs)
        met = {name: positions for name, positions in self.first_contact.items() if name in touched}
        return dataclasses.replace(self, touched=touched, first_contact=met)

    def to_dict(self, n_dofs: int) -> dict[str, Any]:
        """Return the restart data, without the displacements of the `n_dofs` components of the mesh."""
        return {
            "numbers": {**{key: float(getattr(self, name)) for key, name in NUMBERS.items()}, "halved": self.halved},
            "obstacles": self.u[n_dofs:].copy(),
            "touched": sorted(self.touched),
            "locked": dict(self.locked),
            "bonds": {name: vars(own) for name, own in self.bonds.items()},
            "work": None if self.work is None else dataclasses.asdict(self.work),
            "forces": {name: vars(own) for name, own in self.forces.items()},
            "history": dict(self.history),
            **({} if self.rise is None else {"rise": self.rise.copy(), "instant": self.instant}),
            "active": dict(self.active),
            "pressure": dict(self.pressure),
            "pairs": {
                pair: {key: _listed(getattr(self, name).get(pair)) for key, name in OF_PAIRS.items()}
                for pair in self.active
            },
            "extrapolation": self.extrapolation.to_dict(),
            "solver": self.solver,
        }

    @classmethod
    def from_dict(cls, kept: Mapping[str, Any], displacement: Array, touched: frozenset[str]) -> State:
        """Return the state that `to_dict` kept.

        Parameters
        ----------
        kept : mapping
        displacement : ndarray (n_points, dim)
            At the end of the last step [length].
        touched : frozenset of str
            Contact pairs that were closed at the end of a step, beside those that it knows itself.
        """
        u = np.concatenate([displacement.ravel(), kept["obstacles"]])
        pairs, numbers = kept["pairs"], kept["numbers"]
        of_pairs: dict[str, Any] = {
            name: {pair: _from_list(key, own[key]) for pair, own in pairs.items() if own.get(key) is not None}
            for key, name in OF_PAIRS.items()
        }
        return cls(
            u,
            **{name: numbers[key] for key, name in NUMBERS.items()},
            **of_pairs,
            history=dict(kept.get("history", {})),
            rise=kept.get("rise"),
            instant=kept.get("instant", 0.0),
            halved=int(numbers.get("halved", 0)),
            active=dict(kept["active"]),
            pressure=dict(kept["pressure"]),
            locked=dict(kept.get("locked", {})),
            bonds={name: Bond(**own) for name, own in kept.get("bonds", {}).items()},
            work=Work(**kept["work"]) if kept.get("work") else None,
            forces={name: ContactForces(**own) for name, own in kept.get("forces", {}).items()},
            extrapolation=Extrapolation.from_dict(kept["extrapolation"], u)
            if "extrapolation" in kept
            else Extrapolation(),
            touched=touched.union(kept.get("touched", ())),
        )


def _listed(value: Any) -> Any:
    """Return the value of an attribute as lists, arrays and numbers."""
    if isinstance(value, Worn):
        return [value.depth, value.pressure, value.pace]
    return list(value) if isinstance(value, tuple) else value


def _from_list(key: str, value: Any) -> Any:
    """Return what `_listed` was given."""
    if key == "worn":
        return Worn(*value)
    return tuple(value) if isinstance(value, list) else value
