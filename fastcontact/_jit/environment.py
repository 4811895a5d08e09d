"""Checks of the environment before the import of Numba, which would otherwise fail with a traceback."""

from __future__ import annotations

import os

from fastcontact.errors import FastcontactError


def check() -> None:
    """Raise FastcontactError without a working folder, or for NUMBA_NUM_THREADS below 1."""
    try:
        os.getcwd()
    except OSError as error:
        raise FastcontactError(
            f"the working folder is no longer there ({error.strerror}): change to one that exists, such as by 'cd'"
        ) from None
    text = os.environ.get("NUMBA_NUM_THREADS", "1")
    if text.strip().lstrip("+-").isdecimal() and int(text) < 1:
        raise FastcontactError(
            f"the environment variable NUMBA_NUM_THREADS is {text}: set it to a number of threads, 1 or more, or unset it"
        )


check()
