"""The report of a study: all tables on one self-contained page."""

import re

from fastcontact.studies.convergence import convergence_study


def test_the_report_stands_alone_and_says_everything(root):
    study = convergence_study(root / "data/cases/forma04c.toml", levels=3, workers=1)
    names = [str(series.combination) for series in study.series]
    captions = [caption for caption, _ in study.tables()]
    assert captions[:-1] == [caption for name in names for caption in (name, f"{name}: limits")]
    assert study._repr_html_().count("<tr") == sum(len(rows) for _, rows in study.tables())
    page, text = study.html(), "\n".join(study.lines())
    assert not re.search(r"(src|href)=['\"](?!data:)", page)
    assert "http" not in page
    assert page.count("<img") == page.count("data:image/png;base64,") == 1
    for caption, rows in study.tables():
        assert f"<caption>{caption}</caption>" in page
        assert f"\n{caption}\n" in text
        assert all(f">{cell}<" in page.replace("&plusmn;", "+-") for row in rows for cell in row)
        assert {len(row) for row in rows} == {len(rows[0])}
