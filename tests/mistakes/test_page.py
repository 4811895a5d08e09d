"""The page on mistakes agrees with the catalogue, and describes the behaviour of other programs for each."""

from collections import Counter

import page
import pytest
from otherwise import OTHERWISE


def test_each_mistake_is_on_the_page_with_what_happens_otherwise():
    given = Counter(name for names in OTHERWISE.values() for name in names)
    assert max(given.values()) == 1
    assert set(given) == {entry[0] for _, _, entries in page.SECTIONS for entry in entries}


def test_the_page_is_that_of_the_catalogue():
    """Write it anew with: python tests/mistakes/page.py."""
    assert page.PAGE.read_text(encoding="utf-8") == page.page()


@pytest.mark.parametrize(
    ("pattern", "text"),
    [
        (r"point \d+ \[.*\] lies at \(0\.5, 0\)", "point ... [...] lies at (0.5, 0)"),
        (r"by \d\.\d% of (it|them)\.$", "by ...% of ...."),
        (r"'case\.toml' is wrong: did you mean 'a'\?", "'case.toml' is wrong: did you mean 'a'?"),
    ],
)
def test_patterns_become_readable(pattern, text):
    assert page.readable(pattern) == text
