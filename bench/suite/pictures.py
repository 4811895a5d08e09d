"""Scaling of a benchmark: time and memory over the number of unknowns."""

from __future__ import annotations

from typing import Any

import numpy as np


def scaling(name: str, sizes: list[dict[str, Any]]) -> Any:
    """Return a matplotlib figure, log-log, with the slopes in its legends; needs two sizes or more."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4), layout="constrained")
    time, memory = figure.subplots(1, 2)
    unknowns = np.array([entry["n_dofs"] for entry in sizes], float)
    for work in sizes[0]["works"]:
        _line(time, unknowns, np.array([entry["works"][work]["cpu_s"] for entry in sizes]), work)
    _line(memory, unknowns, np.array([entry["peak_bytes"] for entry in sizes]) / 1e6, "process")
    time.set(xlabel="unknowns", ylabel="CPU time [s]", title=name)
    memory.set(xlabel="unknowns", ylabel="peak memory so far [MB]", title=name)
    for axes in (time, memory):
        axes.legend()
        axes.grid(True, which="both", alpha=0.3)
    return figure


def _line(axes: Any, unknowns: Any, values: Any, label: str) -> None:
    slope = np.polyfit(np.log(unknowns), np.log(np.maximum(values, 1e-9)), 1)[0]
    axes.loglog(unknowns, values, "o-", label=f"{label}: slope {slope:.2f}")
