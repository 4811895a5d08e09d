"""Checks of the environment before Numba is imported, because its import would fail with a traceback."""

from __future__ import annotations

import os

from fastcontact.errors import FastcontactError


def check() -> None:
    """Raise FastcontactError if the working directory no longer exists, or NUMBA_NUM_THREADS is below 1."""
    try:
        os.getcwd()
    except OSError as error:
        raise FastcontactError(
            f"the working directory no longer exists ({error.strerror}): change to an existing one, for example with 'cd'"
        ) from None
    text = os.environ.get("NUMBA_NUM_THREADS", "1")
    if text.strip().lstrip("+-").isdecimal() and int(text) < 1:
        raise FastcontactError(
            f"the environment variable NUMBA_NUM_THREADS is {text}: set it to a number of threads, 1 or more, or unset it"
        )


check()
