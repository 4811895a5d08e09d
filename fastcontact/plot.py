"""Pictures: pressure against theory, the deformed shape with its stresses, history over the load.

Every function takes an optional ``ax`` and returns the axes it drew on; save with ``ax.figure.savefig``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastcontact import elements
from fastcontact.errors import FastcontactError
from fastcontact.mesh import Mesh
from fastcontact.results import ContactResult, StepResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
Units = Mapping[str, str]
UNITS: Units = {"length": "mm", "force": "N", "pressure": "MPa"}


def _new_axes(ax: Axes | None, size: tuple[float, float]) -> Axes:
    if ax is not None:
        return ax
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise FastcontactError("pictures need matplotlib: pip install 'fastcontact[plot]'") from error
    figure = Figure(figsize=size, layout="constrained", dpi=150)
    FigureCanvasAgg(figure)
    return figure.add_subplot()


def pressure_profile(
    contact: ContactResult,
    theory: Any = None,
    *,
    other_theories: Mapping[str, Any] | None = None,
    stress: Array | None = None,
    title: str = "",
    units: Units = UNITS,
    ax: Axes | None = None,
) -> Axes:
    """Plot the contact pressure over the distance from the axis, with theory beside it.

    Parameters
    ----------
    contact : ContactResult
    theory : object with ``pressure(r)``, ``pressure_max`` and ``radius``, optional
        E.g. `analytic.hertz_point`.
    other_theories : mapping of str to such an object, optional
        Further curves by legend.
    stress : ndarray (m,), optional
        Normal stress at the contact nodes (compression negative), drawn with the opposite sign [pressure].
    title : str
    units : mapping
        Names of the units of ``length`` and ``pressure`` for the labels.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes
    """
    ax = _new_axes(ax, (7.0, 4.6))
    r = np.abs(contact.coordinates[:, 0])
    theories = {**({"Hertz, equal approach": theory} if theory is not None else {}), **(other_theories or {})}
    reach = max([contact.radius[1] if np.isfinite(contact.radius[1]) else 0.0, *(t.radius for t in theories.values())])
    reach = 1.35 * reach or float(r.max())
    shown = r <= reach
    for style, (legend, curve) in zip(("-", "--", ":", "-."), theories.items(), strict=False):
        x = np.append(np.linspace(0.0, curve.radius, 400), reach)
        ax.plot(
            x,
            curve.pressure(x),
            style,
            color="black",
            lw=1.1,
            label=f"{legend} ($p_0$ = {curve.pressure_max:.1f})",
        )
    label = f"{contact.formulation.replace('_', '-')} ($p$ max = {contact.pressure_max:.1f})"
    ax.plot(r[shown], contact.pressure[shown], "o-", color="tab:blue", ms=4, lw=0.8, label=label)
    if stress is not None:
        ax.plot(r[shown], -stress[shown], "x", color="tab:red", ms=5, label=r"$-\sigma_{yy}$ at the nodes")
    inside, outside = contact.radius
    if np.isfinite(inside) and np.isfinite(outside):
        ax.axvspan(inside, outside, color="tab:blue", alpha=0.15, lw=0, label=f"edge: {inside:.2f} to {outside:.2f}")
    ax.set_xlabel(f"distance from the axis [{units['length']}]")
    ax.set_ylabel(f"contact pressure [{units['pressure']}]")
    ax.set_title(title or f"Contact '{contact.name}'")
    ax.set_xlim(0.0, reach)
    ax.set_ylim(bottom=0.0)
    ax.grid(alpha=0.3)
    ax.legend()
    return ax


def deformed_shape(
    mesh: Mesh,
    step: StepResult,
    *,
    scale: float = 1.0,
    edges: bool | None = None,
    title: str = "",
    units: Units = UNITS,
    ax: Axes | None = None,
) -> Axes:
    """Plot the deformed mesh coloured by the von Mises stress, its maximum marked.

    Parameters
    ----------
    mesh : Mesh
        Two-dimensional.
    step : StepResult
    scale : float
        Factor on the displacements.
    edges : bool, optional
        Draw the cells' edges; by default up to 5000 cells.
    title, units, ax
        As in `pressure_profile`.

    Returns
    -------
    matplotlib Axes
    """
    from matplotlib.collections import PolyCollection
    from matplotlib.tri import Triangulation

    ax = _new_axes(ax, (7.0, 7.0))
    xy = mesh.points + scale * step.displacement
    loops = [cells[:, _outline(name)] for name, cells in mesh.solids.items()]
    triangles = np.concatenate([_fan(name, cells) for name, cells in mesh.solids.items()])
    shape = Triangulation(xy[:, 0], xy[:, 1], triangles)
    field = ax.tripcolor(shape, step.von_mises, shading="gouraud", cmap="viridis")
    if edges if edges is not None else sum(map(len, loops)) <= 5000:
        for loop in loops:
            ax.add_collection(PolyCollection(list(xy[loop]), facecolors="none", edgecolors="black", lw=0.15, alpha=0.6))
    top = int(np.argmax(step.von_mises))
    where = f"({mesh.points[top, 0]:.2f}, {mesh.points[top, 1]:.2f})"
    ax.plot(
        *xy[top],
        "o",
        mfc="none",
        mec="red",
        ms=9,
        mew=1.5,
        label=f"maximum {step.von_mises[top]:.1f} at {where}",
    )
    ax.figure.colorbar(field, ax=ax, label=f"von Mises stress [{units['pressure']}]", shrink=0.8)
    ax.set_aspect("equal")
    ax.set_xlabel(f"x [{units['length']}]")
    ax.set_ylabel(f"y [{units['length']}]")
    ax.set_title(title or f"Deformed shape (displacements x {scale:g}), load factor {step.load_factor:g}")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.09))
    return ax


def _outline(name: str) -> list[int]:
    """Return the nodes of a 2D element in order around it."""
    element = elements.get(name)
    if element.order == 1:
        return list(range(element.n_corners))
    return [node for facet in element.facets for node in (facet[0], facet[2])]


def _fan(name: str, cells: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return triangles (n, 3) that cover the cells: corner triangles and the inner rest for quadratic ones."""
    outline = _outline(name)
    if elements.get(name).order == 1:
        parts = [(outline[0], outline[i], outline[i + 1]) for i in range(1, len(outline) - 1)]
    else:
        middle = outline[1::2]
        parts = [(outline[i - 1], outline[i], outline[i + 1]) for i in range(0, len(outline) - 1, 2)]
        parts[0] = (outline[-1], outline[0], outline[1])
        parts += [(middle[0], middle[i], middle[i + 1]) for i in range(1, len(middle) - 1)]
    return np.concatenate([cells[:, list(part)] for part in parts])


def history(
    steps: Sequence[StepResult],
    pair: str,
    *,
    law: Any = None,
    approach: float | None = None,
    title: str = "",
    units: Units = UNITS,
    axes: Sequence[Axes] | None = None,
) -> Sequence[Axes]:
    """Plot force and contact radius of a contact pair over the load.

    Parameters
    ----------
    steps : sequence of StepResult
    pair : str
        Name of the contact pair.
    law : object with ``at_approach(d)``, optional
        A theory, drawn where `approach` is given.
    approach : float, optional
        Approach of the bodies at load factor 1 [length]; the abscissa is then the approach.
    title, units
        As in `pressure_profile`.
    axes : two matplotlib Axes, optional

    Returns
    -------
    two matplotlib Axes
    """
    if axes is None:
        first = _new_axes(None, (7.0, 6.4))
        figure = first.figure
        first.remove()
        axes = figure.subplots(2, 1, sharex=True)
    upper, lower = axes
    x = np.array([step.load_factor for step in steps]) * (approach or 1.0)
    contacts = [step.contact[pair] for step in steps]
    upper.plot(x, [np.linalg.norm(c.force) for c in contacts], "o-", ms=4, label="computed")
    bracket = np.array([c.radius for c in contacts])
    legend = "computed (between closed and open)"
    lower.fill_between(x, bracket[:, 0], bracket[:, 1], alpha=0.3, label=legend, step="mid")
    if law is not None and approach is not None:
        fine = np.linspace(1e-3, 1.0, 200) * x[-1]
        curves = [law.at_approach(d) for d in fine]
        upper.plot(fine, [c.force for c in curves], "k-", lw=1, label="Hertz, equal approach")
        lower.plot(fine, [c.radius for c in curves], "k-", lw=1, label="Hertz, equal approach")
    upper.set_ylabel(f"contact force [{units['force']}]")
    lower.set_ylabel(f"contact radius [{units['length']}]")
    lower.set_xlabel(f"approach [{units['length']}]" if approach else "load factor")
    upper.set_title(title or f"Contact '{pair}' over the load")
    for ax in axes:
        ax.grid(alpha=0.3)
        ax.legend()
        ax.set_ylim(bottom=0.0)
    return axes
