"""The runner of the benchmark suite; its subjects lie in ``bench/subjects`` of the checkout, one file each."""

from __future__ import annotations

from fastcontact.benchmark.record import compared, environment, lines
from fastcontact.benchmark.subjects import load, names
from fastcontact.benchmark.timing import Work, measured, peak_bytes

__all__ = ["Work", "compared", "environment", "lines", "load", "measured", "names", "peak_bytes"]
