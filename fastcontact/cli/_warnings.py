"""Warnings of the library on screen: each once, in one line, as soon as it is given."""

from __future__ import annotations

import contextlib
import logging
import warnings
from collections.abc import Callable, Iterator

from fastcontact.errors import FastcontactWarning

log = logging.getLogger("fastcontact")


@contextlib.contextmanager
def told(before: Callable[[], None] = lambda: None) -> Iterator[list[str]]:
    """Show the warnings given inside the block and collect their texts; `before` makes room on the screen."""
    texts: list[str] = []
    with warnings.catch_warnings():
        warnings.simplefilter("always", FastcontactWarning)
        show = warnings.showwarning

        def tell(message: Warning | str, category: type[Warning], *rest: object) -> None:
            if not issubclass(category, FastcontactWarning):
                show(message, category, *rest)  # type: ignore[arg-type]
            elif str(message) not in texts:
                texts.append(str(message))
                before()
                log.warning("warning: %s", message)

        warnings.showwarning = tell  # type: ignore[assignment]
        yield texts
