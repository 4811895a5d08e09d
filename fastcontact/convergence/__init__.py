"""Studies of many runs: mesh convergence with model error told from mesh error, and parameter sweeps."""

from __future__ import annotations

from fastcontact.convergence.adaptive import AdaptiveStudy, adaptive_study
from fastcontact.convergence.execute import Progress
from fastcontact.convergence.fit import Limit, fit_limit
from fastcontact.convergence.split import Split, split
from fastcontact.convergence.study import Study, convergence_study
from fastcontact.convergence.sweep import Sweep, parameter_sweep

__all__ = [
    "AdaptiveStudy",
    "Limit",
    "Progress",
    "Split",
    "Study",
    "Sweep",
    "adaptive_study",
    "convergence_study",
    "fit_limit",
    "parameter_sweep",
    "split",
]
