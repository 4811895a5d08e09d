"""Axes of plots, and the fields that they show, by name."""

from __future__ import annotations

import io
import operator
import os
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fastcontact._tools.units import named_units
from fastcontact.arrays import Array, Numbers
from fastcontact.elasticity.recovery import principal_stress, tresca, von_mises, von_mises_signed
from fastcontact.errors import FastcontactError, check_known
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.layout import cells_by_element, contact_slip, separated
from fastcontact.results.step import ContactResult, StepResult
from fastcontact.results.tables import AXES, STRESS_COMPONENTS
from fastcontact.results.units import labelled, valued


@dataclass(frozen=True, eq=False)
class Field:
    """A scalar field at the points of a mesh, which is cut along material interfaces for stresses.

    Attributes
    ----------
    mesh : Mesh
        Mesh with the points of the values.
    node : ndarray of int (m,)
        Node of the original mesh at each of these points.
    values : ndarray (m,)
        Values [unit of `quantity`].
    caption : str
        Name for labels.
    quantity : str
        Kind of unit, ``"pressure"`` or ``"length"``; empty for other fields.
    """

    mesh: Mesh
    node: Numbers
    values: Array
    caption: str
    quantity: str

    @property
    def extreme(self) -> int:
        """Number of the point with the value of largest magnitude."""
        return int(np.argmax(np.abs(self.values)))

    @property
    def range(self) -> tuple[float, float]:
        """Limits of the colours, which are symmetric about zero if the field is `signed`."""
        low, high = float(self.values.min()), float(self.values.max())
        if self.signed:
            return -max(-low, high), max(-low, high)
        return low, high

    @property
    def signed(self) -> bool:
        """Whether the values have both signs and the smaller extreme is more than a tenth of the larger in magnitude."""
        low, high = float(self.values.min()), float(self.values.max())
        return low < 0.0 < high and min(-low, high) > 0.1 * max(-low, high)

    def described(self, value: float, units: Mapping[str, str], where: str = "") -> str:
        """Return a label for an extreme value of the field."""
        kind = "maximum" if value >= 0.0 else "minimum"
        return f"{kind}{where} {valued(float(value), units, self.quantity, 5)}"

    @property
    def colours(self) -> str:
        """Name of the colour map, which diverges from blue through white to red if the field is `signed`."""
        return "RdBu_r" if self.signed else "viridis"


def field_of(mesh: Mesh, step: StepResult, name: str) -> Field:
    """Return a field of a step by its name; FastcontactError if there is no field with this name."""
    fluxes = [flux for key, flux in step.cell_fields.items() if key.startswith("heat_flux_")]
    heat = [*["temperature"] * (step.temperature is not None), *["heat_flux"] * bool(fluxes)]
    check_known("field", name, [*names(mesh), *step.cell_fields, *heat], FastcontactError)
    if name in OF_STRESS and name not in step.cell_fields:
        separate_mesh, node, stress = separated(mesh, step)
        caption, of_stress = OF_STRESS[name]
        values = step.von_mises if name == "von_mises" and separate_mesh is mesh else of_stress(stress)
        return Field(separate_mesh, node, values, caption, "pressure")
    caption, quantity = name, ""
    if name in DISPLACEMENTS:
        caption, quantity = name.replace(".", " along "), "length"
        along = AXES.index(name[-1]) if "." in name else None
        values = np.linalg.norm(step.displacement, axis=1) if along is None else step.displacement[:, along]
    elif name in SLIPS:
        caption, quantity = SLIPS[name], "length"
        values = np.linalg.norm(contact_slip(mesh, step, name.removeprefix("contact_")), axis=1)
    elif name == "temperature" and step.temperature is not None:
        values = step.temperature
    elif name == "heat_flux":
        caption, values = "heat flux", _of_cells(mesh, np.linalg.norm(fluxes, axis=0))
    else:
        caption, values = CELLS.get(name, name), _of_cells(mesh, step.cell_fields[name])
    return Field(mesh, np.arange(mesh.n_points, dtype=np.int32), values, caption, quantity)


def names(mesh: Mesh) -> list[str]:
    """Return the names of the fields that each step on a mesh has."""
    in_space = ("stress.yz", "stress.xz", "displacement.z") if mesh.dim == 2 else ()
    return [name for name in (*OF_STRESS, *DISPLACEMENTS, *SLIPS) if name not in in_space]


def _of_cells(mesh: Mesh, values: Array) -> Array:
    """Return the mean (n_points,) of the values (n_solids,) of the solid cells around each point."""
    total, count, by_element = np.zeros(mesh.n_points), np.zeros(mesh.n_points), cells_by_element(mesh, values)
    for name, block in mesh.solids.items():
        np.add.at(total, block, by_element[name][:, None])
        np.add.at(count, block, 1.0)
    return total / np.maximum(count, 1.0)


# Captions of fields, and functions from stresses (n, 4) or (n, 6) to values (n,) [pressure].
OF_STRESS: dict[str, tuple[str, Callable[[Array], Array]]] = {
    "von_mises": ("von Mises stress", von_mises),
    "von_mises_signed": ("von Mises stress with the sign of the trace", von_mises_signed),
    "tresca": ("Tresca stress (largest minus smallest principal stress)", tresca),
    "stress.principal_max": ("largest principal stress", lambda stress: principal_stress(stress)[:, 2]),
    "stress.principal_mid": ("middle principal stress", lambda stress: principal_stress(stress)[:, 1]),
    "stress.principal_min": ("smallest principal stress", lambda stress: principal_stress(stress)[:, 0]),
    **{
        f"stress.{name}": (f"stress {name}", operator.itemgetter((slice(None), k)))
        for k, name in enumerate(STRESS_COMPONENTS)
    },
}
CELLS = {
    "plastic_strain": "equivalent plastic strain",
    "yield_ratio": "equivalent stress over yield stress",
    **{f"heat_flux_{axis}": f"heat flux along {axis}" for axis in AXES},
    "J": "volume over reference volume",
    "logarithmic_strain": "principal logarithmic strain",
}
SLIPS = {"contact_slip": "slip of the step", "contact_slip_total": "total slip"}
DISPLACEMENTS = ("displacement", "displacement.x", "displacement.y", "displacement.z")


if TYPE_CHECKING:
    from matplotlib.axes import Axes
else:  # Matplotlib is imported only when a plot is drawn
    Axes = Any

Units = str | Mapping[str, str]
UNITS: Mapping[str, str] = {"length": "mm", "force": "N", "pressure": "MPa"}
UNKNOWN: Mapping[str, str] = {}


def units_of(given: Units, result: ContactResult | StepResult) -> Mapping[str, str]:
    """Return the names of units of the caller, by default those of the model; ModelError if they cannot be read."""
    return named_units(given) or result.units


def placed(points: Array, size: float) -> str:
    """Return a position (dim,) [length] as text; coordinates up to a millionth of the `size` of the body become zero."""
    kept = np.where(np.abs(points) <= 1e-6 * size, 0.0, points)
    return f"({', '.join(f'{x:.4g}' for x in kept)})"


def contacts_of(steps: Sequence[StepResult], pair: str) -> list[ContactResult]:
    """Return a contact pair at each step; FastcontactError if there are no steps or a step lacks the pair."""
    if not len(steps):
        raise FastcontactError("there are no steps to draw")
    for step in steps:
        check_known("contact pair", pair, step.contact, FastcontactError)
    return [step.contact[pair] for step in steps]


def mark(axes: Any, at: Array, label: str) -> None:
    """Mark a position (dim,) in a plot."""
    axes.plot(*([x] for x in at), "o", mfc="none", mec="red", ms=9, mew=1.5, label=label, zorder=10)


def png(figure: Any) -> bytes:
    """Return a figure as the bytes of a PNG file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


class Panels(tuple[Any, ...]):
    """The axes of a figure with several panels, which are displayed as the figure in notebooks."""

    __slots__ = ()

    def _repr_png_(self) -> bytes:
        return png(self[0].figure)


def new_axes(ax: Axes | None, size: tuple[float, float], projection: str | None = None) -> Any:
    """Return `ax` or, if it is None, the axes of a new figure; ``projection="3d"`` gives axes in space."""
    if ax is None:
        return new_panels(1, 1, size, subplot_kw={"projection": projection})[0, 0]
    if not (hasattr(ax, "plot") and hasattr(ax, "figure")):
        raise FastcontactError(
            f"pictures are drawn on axes of matplotlib, not on {ax!r}: leave the argument out for new ones"
        )
    return ax


def without_matplotlib(error: Exception) -> FastcontactError:
    """Return the error for a failed import of Matplotlib, which is missing or does not know the backend."""
    if isinstance(error, ImportError):
        return FastcontactError("pictures need matplotlib: pip install 'fastcontact[plot]'")
    backend = os.environ.get("MPLBACKEND")
    return FastcontactError(
        f"matplotlib does not know the backend '{backend}' of the environment variable MPLBACKEND: unset it, or set it to Agg"
    )


def new_panels(rows: int, columns: int, size: tuple[float, float], dpi: int = 150, **options: Any) -> Any:
    """Return the axes (rows, columns) of a new figure of `size` [inch]; `options` are passed to ``Figure.subplots``."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except (ImportError, ValueError) as error:
        raise without_matplotlib(error) from error
    figure = Figure(figsize=size, layout="constrained", dpi=dpi)
    FigureCanvasAgg(figure)
    panels = figure.subplots(rows, columns, squeeze=False, **options)
    for artist in (figure, *figure.axes):  # notebooks show any of them as the figure
        artist._repr_png_ = partial(png, figure)  # type: ignore[attr-defined]
    return panels


def outer_legend(ax: Any, columns: int) -> None:
    """Add a legend below the label of the abscissa, where it does not hide data."""
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=columns, fontsize=8)


def settled(axes: Any) -> Any:
    """Draw axes in space, so that the size of their labels is known to the layout, and return them."""
    axes.figure.draw_without_rendering()
    return axes


LETTER = 0.09  # mean width of a letter of a label [inch]


def size_around(points: Array, least: float = 3.2) -> tuple[float, float]:
    """Return width and height [inch] of a figure for a body, with space for colour bar, labels and title."""
    width, height = np.ptp(points, axis=0) / np.ptp(points, axis=0).max()
    return max(4.2 * float(width) + 1.9, 5.0), max(4.2 * float(height) + 2.0, least)


def part_shown(middle: Array, half: float, points: Array) -> tuple[Array, Array]:
    """Return the lower and upper corners of a square with a centre (2,) and a half width, clipped to points (n, 2)."""
    low, high = points.min(axis=0) - 0.05 * half, points.max(axis=0) + 0.05 * half
    return np.maximum(middle - half, low), np.minimum(middle + half, high)


def framed(
    axes: Any, drawn: Any, shown: Field, heading: str, units: Mapping[str, str], labels: Sequence[str],
    points: Array | None = None, *, alone: bool = True,
) -> Any:  # fmt: skip
    """Add a colour bar, a title, a label for each direction and a legend to axes, and return the axes.

    `points` (n, 2) [length] are the points of a body in the plane, and None for axes in space. `alone` is whether the figure
    has no other axes.
    """
    caption, length, below = labelled(shown.caption, units, shown.quantity), 0.6, 0.02
    if points is not None:
        width, height = np.ptp(points, axis=0)
        caption = textwrap.fill(caption, int(size_around(points)[1] / LETTER))
        length = float(np.clip(2.0 * height / max(width, 1e-300), 0.45, 0.8))  # shorter for flat bodies
        half_inch = -0.5 / max(4.2 * float(height) / max(float(width), float(height)), 0.2)
        below = half_inch if alone else -0.09
        axes.set_aspect("equal")
    axes.figure.colorbar(drawn, ax=axes, label=caption, shrink=length)
    axes.set_title(heading, fontsize="medium", pad=18 if points is None else None)
    axes.set(**{f"{axis}label": labelled(label, units, "length") for axis, label in zip("xyz", labels)})
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, below))
    return axes
