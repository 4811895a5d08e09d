"""A background thread for one task at a time; its errors are raised in the waiting thread."""

from __future__ import annotations

import threading
from collections.abc import Callable

from fastcontact.results.committed_file import uninterrupted


class Background:
    """Runner of one task at a time in a thread; signals, such as Ctrl-C, are deferred during `wait`."""

    def __init__(self) -> None:
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None

    def start(self, task: Callable[[], None]) -> None:
        """Run `task` once the previous one has ended; if that failed, raise its error instead."""
        self.wait()
        self._thread = threading.Thread(target=self._run, args=(task,), name="fastcontact-writer")
        self._thread.start()

    def wait(self) -> None:
        """Wait until no task is running; raise the error of the last task, once."""
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
        except BaseException as error:  # including those that threads would swallow
            self._failure = error
