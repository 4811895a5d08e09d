"""Base class of the reports of studies, with their layout for terminals, HTML pages and notebooks."""

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
from fastcontact.studies import render
from fastcontact.studies.quantities import unit
from fastcontact.studies.render import Rows, aligned

if TYPE_CHECKING:
    import pandas


def of_case(case: Case) -> dict[str, Any]:
    """Return the fields of a `Report` that describe its case."""
    units = units_of_results(case.units, case.model.kinematics)
    return {"name": case.name, "title": case.title, "text": case.text, "units": units}


@dataclass(frozen=True, eq=False, repr=False)
class Report:
    """The result of a study of a case or a function.

    Attributes
    ----------
    kind : str
        Name of the kind of study.
    picture : str
        Description of the figure.
    explanations : tuple of str
        Explanations of the numbers, at the end of the report.
    name : str
        Name of the case file without suffix, or name of the function.
    title : str
        Title of the case, or first line of the docstring of the function.
    text : str
        Text of the case file, or source of the function.
    units : dict of str to str
        Names of the units of results; forces of plane models are per unit thickness.
    """

    kind: ClassVar[str]
    picture: ClassVar[str]
    explanations: ClassVar[tuple[str, ...]] = ()

    name: str
    title: str
    text: str
    units: dict[str, str]

    def tables(self) -> list[tuple[str, Rows]]:
        """Return pairs of a caption and the rows of a table, whose first row is the header."""
        raise NotImplementedError

    def figure(self) -> Any:
        """Return a Matplotlib figure of the results."""
        raise NotImplementedError

    def sentences(self) -> list[str]:
        """Return the conclusions as sentences."""
        return []

    def remarks(self) -> list[str]:
        """Return warnings and the reasons of failures."""
        return []

    def lines(self) -> list[str]:
        """Return the report as lines of text, as the command line prints it."""
        lines = [self.title]
        for caption, rows in self.tables():
            lines += ["", *filter(None, [caption]), *aligned(rows)]
        lines += [f"  {text}" for text in self.remarks()]
        sentences = self.sentences()
        return [*lines, "", *sentences] if sentences else lines

    def html(self) -> str:
        """Return the report as a self-contained HTML page."""
        blocks = [*map(render.paragraph, self.sentences()), render.image(self.figure(), self.picture)]
        blocks += [render.table(rows, caption) for caption, rows in self.tables()]
        blocks += map(render.failure, self.remarks())
        if self.explanations:
            blocks += [render.section("How to read this"), *map(render.paragraph, self.explanations)]
        return render.page(f"{self.kind}: {self.title}", blocks, self.text)

    def table(self) -> AnyArray:
        """Return the numbers as a structured array (n_rows,)."""
        raise NotImplementedError

    @staticmethod
    def structured_known(columns: Mapping[str, Sequence[Any]]) -> AnyArray:
        """Return columns (n_rows,) as a structured array (n_rows,), without columns that contain only NaN."""
        return structured({name: values for name, values in columns.items() if any(v == v for v in values)})

    def to_pandas(self) -> pandas.DataFrame:
        """Return `table` as a ``pandas.DataFrame``.

        Returns
        -------
        pandas.DataFrame
            Table whose ``attrs["units"]`` contains the names of the known units by column.

        Raises
        ------
        FileError
            If pandas is not installed.
        """
        return data_frame(self.table(), {name: unit(name, self.units) for name in self.table().dtype.names or ()})

    def __repr__(self) -> str:
        lines = self.lines()[self.title == self.name :]  # title and name are equal for a function without docstring
        return "\n".join([f"{type(self).__name__} of '{self.name}'", *lines])

    def _repr_html_(self) -> str:
        """Return the tables as HTML for notebooks."""
        return "".join(
            html_table(rows[1:], rows[0], f"{self.title}: {caption}".strip(": ")) for caption, rows in self.tables()
        )

    def framed(self, numbers: dict[str, Any]) -> dict[str, Any]:
        """Return the numbers of a study with its case and the versions of the software, as ``--json`` writes them."""
        case = {"case": self.name, "title": self.title, "units": dict(self.units)}
        return {**case, **numbers, "versions": versions()}
