"""Calls that must raise an error."""

import pytest


def refused(error, message, call, /, *given, **named):
    """Assert that ``call(*given, **named)`` raises an error whose message matches a regular expression."""
    with pytest.raises(error, match=message):
        call(*given, **named)
