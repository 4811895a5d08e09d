"""The report of a study: numbers as exact as their error bars, and one page that needs nothing from outside."""

import re

import pytest

from fastcontact.studies.convergence import convergence_study
from fastcontact.studies.render.table import with_error_bar


@pytest.mark.parametrize(("value", "bar", "text"), [
    (2908.1012, 28.7, "2908 +- 29"), (659_895.57, 1132.0, "659900 +- 1100"), (5.6347185, 0.0341, "5.635 +- 0.034"),
    (-2910.2335, 6.63, "-2910.2 +- 6.6"), (10.0, 0.0, "10"), (1e-20, 1e-22, "1e-20 +- 1e-22"),
])  # fmt: skip
def test_a_limit_has_no_more_digits_than_its_error_bar(value, bar, text):
    assert with_error_bar(value, bar) == text


def test_the_report_stands_alone_and_says_everything(root):
    study = convergence_study(root / "data/cases/forma04c.toml", levels=3, workers=1)
    assert [caption for caption, _ in study.tables()] == [str(series.combination) for series in study.series]
    assert study._repr_html_().count("<tr") == sum(len(rows) for _, rows in study.tables())
    page = study.html()
    assert not re.search(r"(src|href)=['\"](?!data:)", page)
    assert "http" not in page
    assert page.count("<img") == page.count("data:image/png;base64,") == 3
    for series in study.series:
        assert page.count(f">{series.combination}<") == 3  # in two tables and as a heading
        limit = series.limits["force"]
        assert with_error_bar(limit.value, limit.uncertainty).replace("+-", "&plusmn;") in page
    rows = re.findall(r"<tr>(.*?)</tr>", page)
    for table in re.findall(r"<table>.*?</table>", page):
        widths = {len(re.findall(r"<t[hd]>", row)) for row in re.findall(r"<tr>(.*?)</tr>", table)}
        assert len(widths) == 1
    assert len(rows) > 20
