"""Warnings of the library as lines in the output of a command."""

from __future__ import annotations

import contextlib
import logging
import warnings
from collections.abc import Iterator

from fastcontact.errors import FastcontactWarning

log = logging.getLogger("fastcontact")


@contextlib.contextmanager
def warnings_shown() -> Iterator[list[str]]:
    """Log each distinct warning of the library once, in one line, when it is issued; yield a list of their texts."""
    texts: list[str] = []
    with warnings.catch_warnings():
        warnings.simplefilter("always", FastcontactWarning)
        ordinary = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *rest: object) -> None:
            if not issubclass(category, FastcontactWarning):
                ordinary(message, category, *rest)  # type: ignore[arg-type]
            elif str(message) not in texts:
                texts.append(str(message))
                log.warning("warning: %s", message)

        warnings.showwarning = show  # type: ignore[assignment]
        yield texts
