"""State of an analysis: all data that a load step changes."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from fastcontact._tools.records import field, record
from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.wear import Worn
from fastcontact.analysis.work import ContactForces, Work
from fastcontact.arrays import Array, Mask
from fastcontact.contact.cohesion import Bond
from fastcontact.contact.wear_compliance import WearCompliance

# Keys of restart data, with the attributes of `State` that they store: data of each contact pair, and numbers. Then the
# attributes that are stored under their names: those with arrays, of which early versions stored only some, and those with
# instances of a class.
PAIR_DATA = {
    "closed": "never_opening", "now": "obstacles", "first_contact": "first_contact", "elastic_slip": "elastic_slip",
    "angle": "angles", "slipped": "slipped", "worn": "worn",
}  # fmt: skip
NUMBERS = {"largest_force": "largest_force", "largest_work": "largest_rigid_force", "round_off": "gap_round_off"}
REQUIRED_ARRAYS, ARRAYS = ("active", "pressure"), ("locked", "history")
CLASSES: dict[str, type[Bond | ContactForces]] = {"bonds": Bond, "forces": ContactForces}


@record
class State:
    """The state at the end of a load step, or before the first one.

    A load step returns a new state and does not modify the old one: arrays are replaced, never written into. The old state
    therefore remains valid, and the step can be repeated from it. `to_dict` returns the data of a restart.

    Below, m is the number of constraints and n_nodes the number of secondary nodes of a contact pair, n_q is the number of
    quadrature points of an element, and n_points the number of points of the mesh.

    Attributes
    ----------
    u : ndarray (n_dofs,)
        Displacements of all points, and then of the force-driven obstacles [length].
    gap_round_off : float
        Bound of the round-off of gaps: coordinates and displacements limit their accuracy [length].
    active : dict of str to ndarray of bool (m,)
        Active set of each contact pair, from which the next step begins.
    pressure : dict of str to ndarray (n_nodes,)
        Nodal pressures of each contact pair at the end of the step [pressure].
    obstacles : dict of str to ndarray (dim,)
        Displacement of the rigid obstacle of each contact pair [length].
    angles : dict of str to float
        Rotation angle of each rotating rigid obstacle, by the name of its contact pair [radian].
    worn : dict of str to Worn
        Wear of each contact pair with a law of wear.
    wear : dict of str to WearCompliance
        Wear of the current load step for each contact pair with a law of wear, while the step is solved.
    slipped : dict of str to ndarray (n_nodes, dim)
        Accumulated slip of the secondary nodes of each contact pair [length].
    never_opening : dict of str to (ndarray (m, dim), ndarray of bool (m,))
        For each contact pair that does not open again once closed, the positions of constraints [length], and which of them
        have closed.
    elastic_slip : dict of str to (ndarray (m, dim), ndarray (m, dim))
        For each contact pair with tangential compliance, the positions of constraints and their elastic slips under the
        current forces [length].
    first_contact : dict of str to (ndarray (dim,), ndarray (dim,))
        For each contact pair in three dimensions, the point of first contact [length] and the unit normal there [-].
    bonds : dict of str to Bond
        State of the cohesive layer, for each contact pair that has one.
    locked : dict of str to ndarray
        Values that were stored when a part of the model became active. For a temporary constraint, such as that of a locked
        pretension section, they are the initial values (m,) of its m equations [length]; for a temperature that begins after
        the first step, the temperature rise (n_points,) at its beginning [temperature].
    extrapolation : Extrapolation
        The last converged steps, from which the displacements of the next one are extrapolated.
    largest_force, largest_rigid_force : float
        The largest nodal force of all steps so far, and the largest generalised force of the loads on a rigid-body motion
        that is free [force].
    touched : frozenset of str
        Contact pairs that were closed at the end of a step.
    work : Work, optional
        Work of all steps so far; None after a restart from data of an earlier version, which did not compute it.
    forces : dict of str to ContactForces
        Contact forces of each pair at the end of the step, from which the next step computes work.
    last_change : (int, float), optional
        The number of geometry updates in the last step, if it was prescribed, and the relative change of the displacements
        in the last of these updates.
    history : dict of str to ndarray (n_cells, n_q, 9)
        History variables of nonlinear bodies, by element type, see `constitutive_kernels`; empty before the first step.
    flow : (float, float)
        Norm of the stresses of all points that yield in a step, and its change if the step were halved, summed over all steps
        but the first [pressure].
    rise : ndarray (n_points,), optional
        Temperature rise above the reference temperature, in models with conduction of heat [temperature].
    instant : float
        Pseudo-time at the end of the step [-].
    halved : int
        Number of times that a load step of nonlinear bodies is halved before its first attempt.
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
    wear: Mapping[str, WearCompliance] = field(default_factory=dict)
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
    history: Mapping[str, Array] = field(default_factory=dict)
    flow: tuple[float, float] = (0.0, 0.0)
    rise: Array | None = None
    instant: float = 0.0
    halved: int = 0
    solver: Mapping[str, Any] = field(default_factory=dict)

    def to_dict(self, n_dofs: int) -> dict[str, Any]:
        """Return the data of a restart.

        They do not include the displacements of the `n_dofs` components of the mesh, which the step result stores.
        """
        return {
            "numbers": {**{key: float(getattr(self, name)) for key, name in NUMBERS.items()}, "halved": self.halved},
            "obstacles": self.u[n_dofs:].copy(),
            "touched": sorted(self.touched),
            "work": None if self.work is None else dataclasses.asdict(self.work),
            "flow": list(self.flow),
            **({} if self.rise is None else {"rise": self.rise.copy(), "instant": self.instant}),
            **{name: dict(getattr(self, name)) for name in (*REQUIRED_ARRAYS, *ARRAYS)},
            **{name: {pair: vars(data) for pair, data in getattr(self, name).items()} for name in CLASSES},
            "pairs": {pair: self._data_of_pair(pair) for pair in self.active},
            "extrapolation": self.extrapolation.to_dict(),
            "solver": self.solver,
        }

    def _data_of_pair(self, pair: str) -> dict[str, Any]:
        """Return the entries of `PAIR_DATA` for a contact pair, with lists instead of tuples."""
        values = {key: getattr(self, name).get(pair) for key, name in PAIR_DATA.items()}
        return {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], displacement: Array, touched: frozenset[str]) -> State:
        """Return the state from restart data.

        Parameters
        ----------
        data : mapping
            The value that `to_dict` returned.
        displacement : ndarray (n_points, dim)
            Displacement at the end of the last step [length].
        touched : frozenset of str
            Contact pairs that were closed at the end of a step, in addition to those in `data`.
        """
        u = np.concatenate([displacement.ravel(), data["obstacles"]])
        pairs, numbers, extrapolation = data["pairs"], data["numbers"], data.get("extrapolation")
        pair_data: dict[str, Any] = {
            name: {pair: _from_list(key, entry[key]) for pair, entry in pairs.items() if entry.get(key) is not None}
            for key, name in PAIR_DATA.items()
        }
        pair_data |= {name: dict(data[name]) for name in REQUIRED_ARRAYS}
        pair_data |= {name: dict(data.get(name, {})) for name in ARRAYS}
        for name, kind in CLASSES.items():
            pair_data[name] = {pair: kind(**entry) for pair, entry in data.get(name, {}).items()}
        return cls(
            u,
            **{name: numbers[key] for key, name in NUMBERS.items()},
            **pair_data,
            flow=tuple(data.get("flow", (0.0, 0.0))),
            rise=data.get("rise"),
            instant=data.get("instant", 0.0),
            halved=int(numbers.get("halved", 0)),
            work=Work(**data["work"]) if data.get("work") else None,
            extrapolation=Extrapolation() if extrapolation is None else Extrapolation.from_dict(extrapolation, u),
            touched=touched.union(data.get("touched", ())),
        )


def _from_list(key: str, value: Any) -> Any:
    """Return the value of an attribute, given its key in `PAIR_DATA` and the stored value, a list for tuples."""
    if key == "worn":
        return Worn(*value)
    return tuple(value) if isinstance(value, list) else value
