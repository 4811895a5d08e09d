"""The difference from a theory in two parts: mesh error, which refinement removes, and model error, which it does not."""

from __future__ import annotations

from dataclasses import dataclass

from fastcontact.studies.fit import Limit


@dataclass(frozen=True)
class Split:
    """Differences from a theory, relative to it; ``total = model + mesh``.

    Attributes
    ----------
    theory : float
        The theory's value, in the unit of the quantity.
    model : float
        Model error: difference of the limit from the theory.
    mesh : float
        Mesh error: difference of the finest mesh from the limit.
    uncertainty : float
        Of both, from that of the limit, at 95 %.
    """

    theory: float
    model: float
    mesh: float
    uncertainty: float

    @property
    def total(self) -> float:
        """Difference of the finest mesh from the theory."""
        return self.model + self.mesh

    @property
    def resolved(self) -> bool:
        """Whether the model error is larger than its error bar."""
        return abs(self.model) > self.uncertainty


def split(finest: float, limit: Limit, theory: float) -> Split:
    """Split the difference of the value on the finest mesh from the theory's.

    Examples
    --------
    >>> found = split(104.5, Limit(104.0, 0.1, 1.0, 0.1, 5, True), 100.0)
    >>> round(found.model, 12), round(found.mesh, 12)
    (0.04, 0.005)
    """
    return Split(
        theory=theory,
        model=limit.value / theory - 1.0,
        mesh=(finest - limit.value) / theory,
        uncertainty=limit.uncertainty / abs(theory),
    )


def cancelling(values: list[float], limit: Limit, theory: float) -> int | None:
    """Return the mesh, counted from 0, that is nearer to the theory than half the model error, by mesh error.

    On that mesh two errors cancel: it looks better than it is. None if there is no such mesh.
    """
    found = split(values[-1], limit, theory)
    if not found.resolved:
        return None
    off = [abs(value / theory - 1.0) for value in values]
    best = min(range(len(off)), key=off.__getitem__)
    return best if off[best] < 0.5 * abs(found.model) else None
