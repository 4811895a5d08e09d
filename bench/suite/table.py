"""The results of a run as a table, compared with a stored run; versions and machine."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from typing import Any

from fastcontact._jit import decorators as _jit
from fastcontact.cases.summary import versions

Results = Mapping[str, list[dict[str, Any]]]


def environment() -> dict[str, Any]:
    """Return versions, cores and threads."""
    return {"versions": versions(), "machine": platform.machine(), "cores": os.cpu_count(), "threads": _jit.threads()}


def lines(results: Results, before: Results | None = None) -> list[str]:
    """Return the results as a table; `before` adds the CPU seconds in those of a stored run, where it has the entry."""
    head = f"{'benchmark':<12} {'work':<22} {'unknowns':>9} {'CPU s':>10} {'wall s':>10} {'ratio':>8} {'peak MB':>8}"
    table = [head + (f" {'to stored':>10}" if before is not None else "")]
    stored = compared(results, before) if before is not None else {}
    for name, sizes in results.items():
        for entry in sizes:
            for work, found in entry["works"].items():
                row = (
                    f"{name:<12} {work:<22} {entry['n_dofs']:>9} {found['cpu_s']:>10.4g} {found['wall_s']:>10.4g} "
                    f"{found['ratio']:>8.3g} {entry['peak_bytes'] / 1e6:>8.0f}"
                )
                factor = stored.get((name, work, entry["n_dofs"]))
                table.append(row + (f" {factor:>10.2f}" if factor is not None else ""))
    return table


def compared(results: Results, before: Results) -> dict[tuple[str, str, int], float]:
    """Return CPU seconds in those of a stored run, by benchmark, work and number of unknowns, where both have it."""
    old = _seconds(before)
    return {key: cpu / old[key] for key, cpu in _seconds(results).items() if old.get(key)}


def _seconds(results: Results) -> dict[tuple[str, str, int], float]:
    return {
        (name, work, entry["n_dofs"]): found["cpu_s"]
        for name, sizes in results.items()
        for entry in sizes
        for work, found in entry["works"].items()
    }
