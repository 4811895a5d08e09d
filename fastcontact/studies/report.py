"""Base of the reports of all studies: the case, and the layout of tables and sentences for terminals, pages and notebooks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from fastcontact._tools.html_table import html_table
from fastcontact._tools.versions import versions
from fastcontact.arrays import AnyArray
from fastcontact.cases.case import Case
from fastcontact.results.conversions import data_frame
from fastcontact.results.tables import structured
from fastcontact.results.units import units_of_results
from fastcontact.studies.quantities import unit
from fastcontact.studies.render import page
from fastcontact.studies.render.table import Rows, aligned

if TYPE_CHECKING:
    import pandas


def of_case(case: Case) -> dict[str, Any]:
    """Return the fields of a `Report` that describe its case."""
    units = units_of_results(case.units, case.model.kinematics)
    return {"name": case.name, "title": case.title, "text": case.text, "units": units}


@dataclass(frozen=True, eq=False, repr=False)
class Report:
    """A finished study of a case or a function.

    Attributes
    ----------
    kind, picture : str
        Names of the kind of study and of its figure.
    explanations : tuple of str
        Explanations of the numbers, at the end of the report.
    name, title, text : str
        For a case, file name without suffix, title and text of the file; for a function, its name, the first line of
        its docstring and its source.
    units : dict of str to str
        Names of the units of length, force and pressure; in plane models with forces per thickness.
    """

    kind: ClassVar[str]
    picture: ClassVar[str]
    explanations: ClassVar[tuple[str, ...]] = ()

    name: str
    title: str
    text: str
    units: dict[str, str]

    def tables(self) -> list[tuple[str, Rows]]:
        """Return the tables, each with its caption; the first row is a header."""
        raise NotImplementedError

    def figure(self) -> Any:
        """Return a matplotlib figure."""
        raise NotImplementedError

    def sentences(self) -> list[str]:
        """Return the conclusions as sentences."""
        return []

    def remarks(self) -> list[str]:
        """Return warnings and failures."""
        return []

    def lines(self) -> list[str]:
        """Return tables and sentences as lines of text, as the command line prints them."""
        lines = [self.title]
        for caption, rows in self.tables():
            lines += ["", *filter(None, [caption]), *aligned(rows)]
        lines += [f"  {text}" for text in self.remarks()]
        sentences = self.sentences()
        return [*lines, "", *sentences] if sentences else lines

    def html(self) -> str:
        """Return the study as one self-contained HTML page."""
        blocks = [*map(page.paragraph, self.sentences()), page.image(self.figure(), self.picture)]
        blocks += [page.table(rows, caption) for caption, rows in self.tables()]
        blocks += map(page.failure, self.remarks())
        if self.explanations:
            blocks += [page.section("How to read this"), *map(page.paragraph, self.explanations)]
        return page.page(f"{self.kind}: {self.title}", blocks, self.text)

    def table(self) -> AnyArray:
        """Return the numbers as a structured array (n_rows,)."""
        raise NotImplementedError

    @staticmethod
    def structured_known(columns: Mapping[str, Sequence[Any]]) -> AnyArray:
        """Return columns (n_rows,) as a structured array (n_rows,), without those that contain only NaN."""
        return structured({name: values for name, values in columns.items() if any(v == v for v in values)})

    def to_pandas(self) -> pandas.DataFrame:
        """Return `table` as a ``pandas.DataFrame``; FileError if pandas is not installed.

        ``attrs["units"]`` holds the names of units by column, if they are known.
        """
        return data_frame(self.table(), {name: unit(name, self.units) for name in self.table().dtype.names or ()})

    def __repr__(self) -> str:
        lines = self.lines()[self.title == self.name :]  # equal for a function without docstring
        return "\n".join([f"{type(self).__name__} of '{self.name}'", *lines])

    def _repr_html_(self) -> str:
        """Return the tables for notebooks."""
        return "".join(
            html_table(rows[1:], rows[0], f"{self.title}: {caption}".strip(": ")) for caption, rows in self.tables()
        )

    def framed(self, numbers: dict[str, Any]) -> dict[str, Any]:
        """Return the numbers of a study with its case and the versions, as ``--json`` writes them."""
        case = {"case": self.name, "title": self.title, "units": dict(self.units)}
        return {**case, **numbers, "versions": versions()}
