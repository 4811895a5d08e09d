"""A background thread for one task at a time, whose errors are raised in the thread that waits for it."""

from __future__ import annotations

import threading
from collections.abc import Callable

from fastcontact.results.committed_file import uninterrupted


class Background:
    """A thread that runs one task at a time; signals, such as Ctrl-C, are deferred during `wait`."""

    def __init__(self) -> None:
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None

    def start(self, task: Callable[[], None]) -> None:
        """Run `task` after the previous task has ended; if the previous task failed, raise its error instead."""
        self.wait()
        self._thread = threading.Thread(target=self._run, args=(task,), name="fastcontact-writer")
        self._thread.start()

    def wait(self) -> None:
        """Wait for the task to end, and raise its error unless it has been raised before."""
        if self._thread is None:
            return
        with uninterrupted():
            self._thread.join()
            self._thread = None
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _run(self, task: Callable[[], None]) -> None:
        try:
            task()
        except BaseException as error:  # a thread would discard any error
            self._failure = error
