"""Messages about compilation if no progress is requested."""

import io
import logging
import sys

import pytest

from fastcontact._jit import compiling


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def told(monkeypatch):
    """What a process that has compiled nothing yet says when two kernels are compiled, given its error output."""
    monkeypatch.setattr(compiling, "_reported", False)
    monkeypatch.setattr(compiling, "listeners", [compiling.tell_who_waits])
    monkeypatch.setattr(compiling.log, "handlers", [])  # those of other tests may be closed
    monkeypatch.setattr(compiling.log, "propagate", False)
    level = compiling.log.level
    compiling.log.setLevel(logging.WARNING)

    def saying(stream):
        monkeypatch.setattr(sys, "stderr", stream)
        compiling.notify()
        compiling.notify()
        return stream.getvalue()

    yield saying
    compiling.log.setLevel(level)


def test_one_line_at_a_terminal(told):
    assert told(Terminal()) == f"fastcontact: {compiling.TEXT}\n"


def test_one_line_in_a_notebook(told, monkeypatch):
    monkeypatch.setitem(sys.modules, "ipykernel", compiling)
    assert told(io.StringIO()) == f"fastcontact: {compiling.TEXT}\n"


def test_nothing_where_nobody_waits(told, monkeypatch):
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    assert told(io.StringIO()) == ""


def test_nothing_without_error_output(told, monkeypatch):
    told(io.StringIO())
    monkeypatch.setattr(sys, "stderr", None)
    monkeypatch.setattr(compiling, "listeners", [compiling.tell_who_waits])
    compiling.notify()
    assert compiling.listeners == []


def test_nothing_in_a_process_that_works_for_another(told, monkeypatch):
    monkeypatch.setattr(compiling.multiprocessing, "parent_process", object)
    assert told(Terminal()) == ""


def test_nothing_where_the_log_tells_it(told):
    compiling.log.setLevel(logging.INFO)
    assert told(Terminal()) == ""


def test_nothing_where_another_listener_tells_it(told):
    heard = []
    compiling.listeners.append(lambda: heard.append(1))
    assert told(Terminal()) == ""
    assert heard == [1, 1]
