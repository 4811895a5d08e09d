"""A plugin of pytest that notes at which lines of the package each test is told of an error, and how long it takes.

Loaded with ``-p reached``; the folder of its notes is named by MUTATION_NOTES, the package by MUTATION_PACKAGE. Every
process writes a file of its own: by test the seconds and the places (file, line) of all frames of the package below the
making of an error, those of an error being handled included.
"""

from __future__ import annotations

import json
import os
import sys
from collections import defaultdict
from pathlib import Path
from types import FrameType, TracebackType

import pytest

PACKAGE = os.environ["MUTATION_PACKAGE"] + os.sep
places: dict[str, set[tuple[str, int]]] = defaultdict(set)
seconds: dict[str, float] = defaultdict(float)
failed: set[str] = set()


def pytest_configure() -> None:
    """Watch the making of errors."""
    from fastcontact.errors import FastcontactError

    def noting(cls, *given, **named):
        _note()
        return Exception.__new__(cls, *given, **named)

    FastcontactError.__new__ = noting  # type: ignore[assignment]

    # Other errors reach a test by `pytest.raises` only.
    fill = pytest.ExceptionInfo.fill_unfilled

    def noting_too(self, found):
        _note_handled(found[1])
        fill(self, found)

    pytest.ExceptionInfo.fill_unfilled = noting_too


def _note() -> None:
    frame: FrameType | None = sys._getframe(2)
    while frame is not None:
        _add(frame, frame.f_lineno)
        frame = frame.f_back
    _note_handled(sys.exc_info()[1])


def _note_handled(error: BaseException | None) -> None:
    while error is not None:
        trace: TracebackType | None = error.__traceback__
        while trace is not None:
            _add(trace.tb_frame, trace.tb_lineno)
            trace = trace.tb_next
        error = error.__cause__ or error.__context__


def _add(frame: FrameType, line: int) -> None:
    file = frame.f_code.co_filename
    if file.startswith(PACKAGE):
        test = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" (")[0]
        places[test].add((file[len(PACKAGE) :], line))


def pytest_runtest_logreport(report) -> None:
    """Add up what the parts of a test take."""
    seconds[report.nodeid] += report.duration
    if not report.passed:  # such a test would seem to notice everything
        failed.add(report.nodeid)


def pytest_sessionfinish() -> None:
    """Write the notes of this process."""
    notes = {test: [round(seconds[test], 3), sorted(found)] for test, found in places.items() if test in seconds}
    notes = {test: found for test, found in notes.items() if test not in failed}
    if notes:
        Path(os.environ["MUTATION_NOTES"], f"{os.getpid()}.json").write_text(json.dumps(notes), encoding="utf-8")
