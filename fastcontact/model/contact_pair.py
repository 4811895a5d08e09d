"""Contact pairs as the user describes them, and the rotations of rigid obstacles and supports."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from fastcontact._tools.argument_types import finite_vector
from fastcontact.contact.obstacles import Obstacle
from fastcontact.contact.obstacles.rigid_side import Rotation
from fastcontact.elasticity.loads import check_number
from fastcontact.errors import ModelError, check_known
from fastcontact.model.ramp import Ramp, Table, multiplier, table_of

# Components of the force on an obstacle [force]; None where the displacement is prescribed. Empty if no force is given.
DrivingForce = tuple[float | None, ...]


@dataclass(frozen=True)
class FluidPressure:
    """Fluid that enters a contact from the group `source`.

    `pressure` is the fluid pressure at load multiplier 1 [pressure], and `ramp` is its history; None means the history of
    the analysis.
    """

    pressure: float
    source: str
    ramp: Table | None = None


@dataclass(frozen=True)
class ContactPair:
    """Two groups of facets that may touch, or a group and a rigid obstacle, with a formulation and its options.

    If there is an `obstacle`, `primary` is empty. The displacement of the obstacle at load multiplier 1 is `motion` [length],
    and its history is `ramp`; None means the history of the analysis. Components in which `force` is not None are driven by
    this force instead, which is given at load multiplier 1 [force]. The obstacle rotates by `rotation` with the history
    `rotation_ramp`, by default `ramp`. For automatically detected pairs, `detected_gap` is the smallest gap at detection
    [length].
    """

    name: str
    secondary: str
    primary: str
    formulation: str
    options: dict[str, Any] = field(default_factory=dict)
    obstacle: Obstacle | None = None
    motion: tuple[float, ...] = ()
    ramp: Table | None = None
    force: DrivingForce = ()
    rotation: Rotation | None = None
    rotation_ramp: Table | None = None
    fluid: FluidPressure | None = None
    detected_gap: float | None = None

    @property
    def method(self) -> str:
        """Formulation and, if the pair specifies it, the kind of its multipliers, for messages."""
        return method(self.formulation, self.options)

    @cached_property
    def clearance_ramp(self) -> Table | None:
        """Ramp of the clearance; None if it is constant."""
        return table_of(self.options.get("clearance_ramp"), f"the clearance_ramp of contact '{self.name}'")

    @cached_property
    def friction_ramp(self) -> Table | None:
        """Ramp of the coefficient of friction; None if it is constant."""
        return table_of(self.options.get("friction_ramp"), f"the friction_ramp of contact '{self.name}'")

    @property
    def opposite(self) -> str:
        """Name of the opposite side, for messages."""
        return self.primary if self.obstacle is None else "a rigid obstacle"


def method(formulation: str, options: Mapping[str, Any]) -> str:
    """Return a formulation and the kind of its multipliers, if options specify one."""
    return f"{formulation} with {options['multipliers']} multipliers" if "multipliers" in options else formulation


ROTATION_KEYS = ("angle", "centre", "axis", "ramp")
# Largest rotation of an obstacle with friction in a load step [radian].
LARGEST_ROTATION = 1.0


def rotation_of(caption: str, spec: Mapping[str, Any] | None, kinematics: str) -> tuple[Rotation | None, Table | None]:
    """Return the rotation that `spec` defines, called `caption` in messages, and its ramp; each is None if not given.

    Raises ModelError if the rotation or the ramp is not admissible.
    """
    if spec is None:
        return None, None
    for key in spec:
        check_known(f"key of {caption}", key, ROTATION_KEYS, ModelError)
    if kinematics == "axisymmetric":
        raise ModelError(
            f"{caption}: an axisymmetric model has no displacement around its axis, and tilting is not axisymmetric: use a "
            "three-dimensional model"
        )
    dim = 3 if kinematics == "3d" else 2
    for key in ("angle", "centre", "axis")[:dim]:
        if key not in spec:
            raise ModelError(f"{caption} needs '{key}'")
    if dim == 2 and spec.get("axis") is not None:
        raise ModelError(f"{caption}: in 2D rotations are about z, counter-clockwise: leave out the axis")
    check_number(f"the angle of {caption}", spec["angle"])
    axis = _vector(f"the axis of {caption}", spec["axis"], 3) if dim == 3 else (0.0, 0.0, 1.0)
    if not any(axis):
        raise ModelError(f"the axis of {caption} has no length")
    rotation = Rotation(_vector(f"the centre of {caption}", spec["centre"], dim), axis, float(spec["angle"]))  # type: ignore[arg-type]
    return rotation, table_of(spec.get("ramp"), f"the ramp of {caption}")


def _vector(name: str, values: Sequence[float], size: int) -> tuple[float, ...]:
    """Return `size` numbers as a tuple. Raises ModelError, with the `name` of the vector, if they are not finite numbers."""
    vector = finite_vector(values, size)
    if vector is None:
        raise ModelError(f"{name} must be {size} finite numbers, not {values!r}")
    return tuple(vector.tolist())


def angle_at(pair: ContactPair, ramp: Ramp, instant: float) -> float:
    """Return the rotation of the obstacle of a pair at the load factor `instant` [radian]."""
    if pair.rotation is None:
        return 0.0
    ramp_of_rotation = pair.ramp if pair.rotation_ramp is None else pair.rotation_ramp
    return multiplier(ramp_of_rotation, ramp, instant) * pair.rotation.angle


def check_rotations(pairs: Iterable[ContactPair], ramp: Ramp) -> None:
    """Raise ModelError if an obstacle with friction rotates by more than LARGEST_ROTATION in a load step.

    The slip in a step is computed from the end points of the motion, which is inaccurate for longer arcs.
    """
    for pair in pairs:
        if pair.rotation is None or not pair.options.get("friction"):
            continue
        previous = 0.0
        for instant in ramp.instants:
            angle = angle_at(pair, ramp, instant)
            change = abs(angle - previous)
            if change > LARGEST_ROTATION:
                raise ModelError(
                    f"obstacle '{pair.name}' rotates by {change:.3g} rad in the step that ends at load factor {instant:g}, "
                    f"more than {LARGEST_ROTATION:g} rad: with friction use at least "
                    f"{math.ceil(change / LARGEST_ROTATION)} steps instead"
                )
            previous = angle
