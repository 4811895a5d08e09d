"""One period of a vibration as steps, for animations and result files."""

from __future__ import annotations

import math
from dataclasses import replace

from fastcontact.errors import ModelError
from fastcontact.results.step import StepResult


def phases(shape: StepResult, count: int) -> list[StepResult]:
    """Return a vibration with a given shape at `count` equidistant phases, as steps.

    The load factor of a step is its phase in periods, in [0, 1). Raises ModelError if `count` is less than two.
    """
    if count < 2:
        raise ModelError(f"count = {count}: a period needs two phases or more")
    return [_times(shape, k + 1, k / count, math.cos(2.0 * math.pi * k / count)) for k in range(count)]


def _times(shape: StepResult, index: int, phase: float, factor: float) -> StepResult:
    return replace(
        shape, index=index, load_factor=phase, displacement=factor * shape.displacement, stress=factor * shape.stress,
        von_mises=abs(factor) * shape.von_mises, von_mises_signed=factor * shape.von_mises_signed, restart=None,
        iterations={"parameter": "phase"},
    )  # fmt: skip
