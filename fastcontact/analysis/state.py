"""State of an analysis: everything that a load step changes."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.floating_bodies import RigidPosition
from fastcontact.analysis.slip import Worn
from fastcontact.analysis.work import ContactForces, Work
from fastcontact.arrays import Array, Mask
from fastcontact.contact.cohesion import Bond

# Key and attribute of the data of each contact pair, and of the numbers, in a restart.
OF_PAIRS = {
    "closed": "never_opening", "now": "obstacles", "first_contact": "first_contact", "elastic_slip": "elastic_slip",
    "angle": "angles", "slipped": "slipped", "worn": "worn",
}  # fmt: skip
NUMBERS = {"largest_force": "largest_force", "largest_work": "largest_rigid_force", "round_off": "gap_round_off"}


@dataclass(frozen=True, eq=False)
class State:
    """The state at the end of a load step, or before the first one.

    A load step returns a new state and does not modify this one: arrays are replaced, never written into. A state is
    therefore its own snapshot, and its `to_dict` the content of a restart.

    Attributes
    ----------
    u : ndarray (n_dofs,)
        Displacements of all points, then of the force-driven obstacles [length].
    active : dict of str to ndarray of bool (m,)
        Initial active set of each contact pair.
    pressure : dict of str to ndarray (n_nodes,)
        Last nodal pressures of each contact pair [pressure].
    obstacles : dict of str to ndarray (dim,)
        Displacement of the rigid obstacle of each contact pair [length].
    angles : dict of str to float
        Rotation of the rigid obstacle of each contact pair, where one rotates [radian].
    worn : dict of str to Worn
        Wear of each contact pair that wears.
    slipped : dict of str to ndarray (m, dim)
        Accumulated slip of the secondary nodes of each contact pair [length].
    never_opening : dict of str to (ndarray (m, dim), ndarray of bool (m,))
        For each contact pair without separation, the positions of constraints [length] and which of them have closed.
    elastic_slip : dict of str to (ndarray (m, dim), ndarray (m, dim))
        For each contact pair with tangential compliance, the positions of constraints and their elastic slips under the
        current forces [length].
    first_contact : dict of str to (ndarray (dim,), ndarray (dim,))
        For each contact pair in three dimensions, the point of first contact [length] and the normal there [-].
    bonds : dict of str to Bond
        State of the cohesive layer of each contact pair with one.
    locked : dict of str to float or ndarray (m,)
        Shortening at locking of each locked pretension section [length]; initial values of each temporary constraint; initial
        temperature rise (n_points,) of each temperature that began later [temperature].
    extrapolation : Extrapolation
        The last two converged steps.
    gap_round_off : float
        Gaps are no more accurate than this [length].
    largest_force, largest_rigid_force : float
        The largest force of all steps so far, and the largest force of loads on a free rigid motion [force].
    touched : frozenset of str
        Contact pairs that were closed at the end of a step.
    work : Work, optional
        Work of all steps so far; None after steps of a version that did not compute it.
    forces : dict of str to ContactForces
        Contact forces of each pair, for the work of the next step.
    last_change : (int, float), optional
        The fixed number of geometry updates of the last step, and the relative change by the last one.
    rigid : RigidPosition, optional
        Rigid position of floating bodies in the last step.
    history : dict of str to ndarray (n_cells, n_q, 9)
        History of each solid element of nonlinear bodies, see `constitutive_kernels`; empty before the first step.
    rise : ndarray (n_points,), optional
        Temperature rise over the reference, where heat is conducted [temperature].
    instant : float
        Pseudo-time.
    halved : int
        Number of times that load steps of nonlinear bodies are halved before they are tried.
    solver : dict
        Snapshot of the linear solver, see `LinearSolver.snapshot`.
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
        """Return the state with these contact pairs marked as touched; pairs that touched before keep their first contact."""
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
            "bonds": {name: vars(entry) for name, entry in self.bonds.items()},
            "work": None if self.work is None else dataclasses.asdict(self.work),
            "forces": {name: vars(entry) for name, entry in self.forces.items()},
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
    def from_dict(cls, data: Mapping[str, Any], displacement: Array, touched: frozenset[str]) -> State:
        """Return the state saved by `to_dict`.

        Parameters
        ----------
        data : mapping
        displacement : ndarray (n_points, dim)
            Displacement at the end of the last step [length].
        touched : frozenset of str
            Contact pairs that were closed at the end of a step, in addition to those in `data`.
        """
        u = np.concatenate([displacement.ravel(), data["obstacles"]])
        pairs, numbers = data["pairs"], data["numbers"]
        of_pairs: dict[str, Any] = {
            name: {pair: _from_list(key, entry[key]) for pair, entry in pairs.items() if entry.get(key) is not None}
            for key, name in OF_PAIRS.items()
        }
        return cls(
            u,
            **{name: numbers[key] for key, name in NUMBERS.items()},
            **of_pairs,
            history=dict(data.get("history", {})),
            rise=data.get("rise"),
            instant=data.get("instant", 0.0),
            halved=int(numbers.get("halved", 0)),
            active=dict(data["active"]),
            pressure=dict(data["pressure"]),
            locked=dict(data.get("locked", {})),
            bonds={name: Bond(**entry) for name, entry in data.get("bonds", {}).items()},
            work=Work(**data["work"]) if data.get("work") else None,
            forces={name: ContactForces(**entry) for name, entry in data.get("forces", {}).items()},
            extrapolation=Extrapolation.from_dict(data["extrapolation"], u)
            if "extrapolation" in data
            else Extrapolation(),
            touched=touched.union(data.get("touched", ())),
        )


def _listed(value: Any) -> Any:
    """Return the value of an attribute as lists, arrays and numbers."""
    if isinstance(value, Worn):
        return [value.depth, value.pressure, value.pace]
    return list(value) if isinstance(value, tuple) else value


def _from_list(key: str, value: Any) -> Any:
    """Return the value that `_listed` converted."""
    if key == "worn":
        return Worn(*value)
    return tuple(value) if isinstance(value, list) else value
