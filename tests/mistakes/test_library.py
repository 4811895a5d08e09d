"""Each mistake in a call of the library gives at once an error of the right class or a warning, in one sentence."""

import re
import warnings

import library
import pytest

from fastcontact import errors
from fastcontact.analysis import problem


def told(mistake):
    """Make a mistake and return what is said about it: the only error, or the warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            mistake.make()
        except errors.FastcontactError as error:
            return type(error), [str(error)]
    return errors.FastcontactWarning, [str(w.message) for w in caught if w.category is errors.FastcontactWarning]


@pytest.mark.parametrize("mistake", library.MISTAKES, ids=lambda mistake: mistake.name)
def test_a_mistake_in_a_call(mistake, monkeypatch):
    if mistake.name not in library.AFTER:

        def numerics(*_):
            raise RuntimeError("numerics started")

        monkeypatch.setattr(problem, "stiffness", numerics)
    if mistake.kind is errors.FastcontactWarning and mistake.name not in library.AFTER:
        with pytest.warns(errors.FastcontactWarning, match=mistake.pattern) as caught, pytest.raises(RuntimeError):
            mistake.make()
        assert len(caught) == 1
        return
    kind, texts = told(mistake)
    assert kind is mistake.kind, texts
    assert len(texts) == 1, texts
    assert re.search(mistake.pattern, texts[0]), texts[0]
    assert "\n" not in texts[0]


def test_the_models_are_right_but_for_their_mistakes():
    (step,) = library.solved(library.blocks())
    assert step.warnings == ()
    assert library.solved(library.stretched(0.1))[0].warnings == ()
