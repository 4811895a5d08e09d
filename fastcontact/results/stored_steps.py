"""The steps of a resumed result file, which are read on access, so that resuming a long run needs little memory."""

from __future__ import annotations

from pathlib import Path

from fastcontact.results.reader import Results
from fastcontact.results.step import StepResult
from fastcontact.results.steps import StepSequence


class StoredSteps(StepSequence):
    """The steps that a file contains when it is opened, which are read on access.

    The last step, with its `restart`, is kept in memory. `release` must be called before the file is changed, because HDF5
    does not update its view of an open file. Access to another step opens the file again.
    """

    def __init__(self, results: Results) -> None:
        self._path: Path = results.path
        self._results: Results | None = results
        self._count = len(results)
        self._last = results[-1]

    def release(self) -> None:
        """Close the file; further calls have no effect."""
        if self._results is not None:
            self._results.close()
            self._results = None

    def __len__(self) -> int:
        return self._count

    def _step(self, position: int) -> StepResult:
        if position == self._count - 1:
            return self._last
        if self._results is None:
            self._results = Results(self._path)
        return self._results[position]

    def __repr__(self) -> str:
        return f"StoredSteps('{self._path}': {self._count} steps)"
