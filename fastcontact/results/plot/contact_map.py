"""Maps of pressure, shear traction, slip and other quantities on a contact surface in 3D."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.errors import FastcontactError, check_known
from fastcontact.mesh.flat_pieces import flat_triangles
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import outer_facets
from fastcontact.results.layout import CONTACT_FIELDS
from fastcontact.results.plot._axes import MODEL_UNITS, Axes, Panels, Units, new_panels, units_of
from fastcontact.results.plot.patches import fill
from fastcontact.results.plot.solid import view_axes
from fastcontact.results.step import ContactResult
from fastcontact.results.units import axis_label, value_text

# Margin of the plotted region around the part of the surface that is in contact, relative to the half-width of that part.
MARGIN = 0.15
# Smallest height of a figure relative to that of a square map. The colour bar of a flatter map lies below the map.
FLAT = 0.55
# Ratio of the length to the width of a map beyond which its axes have different scales.
LONG = 5.0
# Smallest magnitude of the mean of the unit normals of a surface for which it can be projected along the mean normal.
LEAST_MEAN = 0.3
# Captions of the fields that can be plotted next to the pressure, and the quantities that determine their units.
SECOND_FIELDS = {
    "shear": ("shear traction", "pressure"),
    **{name.removeprefix("contact_"): texts for name, texts in CONTACT_FIELDS.items() if name != "contact_pressure"},
}


@typed(FastcontactError)
def contact_map(
    mesh: Mesh,
    contact: ContactResult,
    *,
    everything: bool = False,
    beside: str = "shear",
    title: str = "",
    units: Units = MODEL_UNITS,
    axes: Sequence[Axes] | None = None,
) -> Sequence[Axes]:
    """Plot the pressure on the secondary surface of a contact pair in 3D and another quantity, by default shear.

    The surface is plotted in the reference configuration, projected along its mean normal. Dots mark closed nodes. In the
    map of shear traction or slip, the dots of sliding nodes are orange and arrows show the direction.

    Parameters
    ----------
    mesh : Mesh
        A three-dimensional mesh.
    contact : ContactResult
        Result of a contact pair.
    everything : bool
        Whether to plot the entire surface instead of the closed part and its surroundings.
    beside : {"shear", "slip", "slip_total", "wear", "damage", "fluid_pressure"}
        Quantity that is plotted next to the pressure; see `ContactResult`.
    title, units
        Described for `pressure_profile`.
    axes : sequence of matplotlib Axes, optional
        Axes of the pressure and of the other quantity; by default those of a new figure.

    Returns
    -------
    tuple of matplotlib Axes
        Axes of the pressure and, unless it is zero everywhere, of the other quantity.

    Raises
    ------
    FastcontactError
        If the mesh is not three-dimensional or does not contain the contact surface, or if the closed part of the surface
        surrounds a body and cannot be projected.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.box(divisions=(2, 2, 2))
    >>> model = fc.Model(mesh, kinematics="3d")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    >>> model.fix("ZMIN", "xyz")
    >>> ball = fc.obstacles.Sphere(centre=(0.5, 0.5, 3.0), R=2.0)
    >>> model.add_obstacle("ball", secondary="ZMAX", obstacle=ball, motion={"z": -0.05})
    >>> step = fc.solve(model, 1)[-1]
    >>> axes = fc.plot.contact_map(mesh, step.contact["ball"])
    """
    if mesh.dim != 3:
        raise FastcontactError("maps of a contact need a three-dimensional mesh: draw the pressure profile instead")
    blocks = _facets(mesh, contact)
    (basis, labels), units = _projection(contact, blocks), units_of(units, contact)
    flat = contact.coordinates @ basis.T
    if labels is None:
        flat -= contact.middle @ basis.T
        labels = ("across the contact", "up the contact")
    known = [name for name in SECOND_FIELDS if getattr(contact, name) is not None]
    check_known("field beside the pressure", beside, known, FastcontactError)
    caption, quantity, second_values = *SECOND_FIELDS[beside], getattr(contact, beside)
    size = np.linalg.norm(second_values.reshape(len(flat), -1), axis=1)
    two_maps = bool(size.max(initial=0.0) > (1e-9 * contact.pressure_max if beside == "shear" else 0.0))
    panels = _panels(axes, two_maps)
    fields = [(contact.pressure, "contact pressure", "pressure"), (size, caption, quantity)]
    for ax, (values, caption, quantity) in zip(panels, fields, strict=False):
        limits = min(0.0, float(values.min(initial=0.0))), float(values.max(initial=0.0)) or 1.0
        artist = fill(ax, blocks, flat, values, "viridis", limits)
        relative_height = _set_limits(ax, flat, _loaded_nodes(contact, blocks) & (not everything))
        bar = {"location": "bottom", "shrink": 0.6} if relative_height == FLAT else {"shrink": 0.75 * relative_height}
        ax.figure.colorbar(artist, ax=ax, label=axis_label(caption, units, quantity), **bar)
        _mark_nodes(ax, flat, contact, distinguish=two_maps and bool(contact.shear.any()))
        x_label, y_label = (axis_label(label, units, "length") for label in labels)
        ax.set(xlabel=x_label, ylabel=y_label)
        note = "" if ax.get_aspect() == 1.0 else "\nscales of the axes differ"
        ax.set_title(
            f"{caption}\nlargest {value_text(values.max(initial=0.0), units, quantity)}{note}", fontsize="medium"
        )
    if two_maps and second_values.ndim == 2:
        large = size > 0.1 * size.max()  # the direction of small vectors is not shown
        panels[1].quiver(*flat[large].T, *(second_values @ basis.T)[large].T, color="white", width=0.004, pivot="tail")
    if axes is None:
        panels[0].figure.set_figheight(1.6 + 3.0 * relative_height)
    panels[0].figure.suptitle(title or f"Contact '{contact.name}'", fontsize="large")
    if contact.active.any():
        parent, place = (panels[0], "upper right") if axes is not None else (panels[0].figure, "outside lower right")
        parent.legend(*panels[0].get_legend_handles_labels(), loc=place, fontsize=8)
    return Panels(panels)


def _panels(axes: Sequence[Any] | None, two_maps: bool) -> list[Any]:
    """Return the axes of one or two maps, by default those of a new figure. Raises FastcontactError if there are too few."""
    if axes is not None:
        panels = list(np.atleast_1d(np.array(axes, dtype=object)))
        if len(panels) < 1 + two_maps:
            raise FastcontactError(f"the maps of two quantities need two axes, but {len(panels)} are given")
        return panels[: 1 + two_maps]
    panels = list(new_panels(1, 1 + two_maps, (9.6 if two_maps else 5.6, 4.6))[0])
    panels[0].figure.set_layout_engine("compressed")  # places the colour bar next to a narrow map
    return panels


def _facets(mesh: Mesh, contact: ContactResult) -> dict[str, Indices]:
    """Return the facets (n, m) of the secondary surface by element type, as positions in the arrays of the contact."""
    in_mesh = contact.points.max(initial=-1) < mesh.n_points
    row = np.full(max(mesh.n_points, int(contact.points.max(initial=-1)) + 1), -1)
    row[contact.points] = np.arange(len(contact.points))
    rows = {name: row[facets] for name, facets in outer_facets(mesh).items()}
    blocks = {name: facets[(facets >= 0).all(axis=1)] for name, facets in rows.items()}
    if not in_mesh or not any(map(len, blocks.values())):
        raise FastcontactError(f"contact '{contact.name}' is not on the surface of this mesh")
    return blocks


def _projection(contact: ContactResult, blocks: dict[str, Indices]) -> tuple[Array, tuple[str, str] | None]:
    """Return two axes (2, 3) normal to the mean normal, and their names if they are coordinate axes.

    The mean normal is weighted by the pressure of the facets; without pressure all facets have the same weight.
    """
    total, total_area = np.zeros(3), 0.0
    for facets in blocks.values():
        flat = facets[:, flat_triangles(facets.shape[1])].reshape(-1, 3)
        a, b, c = np.moveaxis(contact.coordinates[flat], 1, 0)
        weight = np.maximum(contact.pressure[flat].mean(axis=1), 0.0) if contact.pressure_max > 0.0 else 1.0
        areas = np.cross(b - a, c - a) * np.reshape(weight, (-1, 1))
        total, total_area = total + areas.sum(axis=0), total_area + float(np.linalg.norm(areas, axis=1).sum())
    if np.linalg.norm(total) < LEAST_MEAN * total_area:
        raise FastcontactError(
            f"the surface of contact '{contact.name}' surrounds its body: draw a section, or use view"
        )
    return view_axes(total / np.linalg.norm(total), 0.9)


def _mark_nodes(ax: Any, flat: Array, contact: ContactResult, distinguish: bool) -> None:
    """Mark the closed nodes at their positions `flat` (m, 2); if `distinguish` is true, mark sliding nodes differently."""
    sliding = contact.active & ~contact.sticking & distinguish
    closed = contact.active & ~sliding
    states = (("sticking" if distinguish else "closed", closed, "white"), ("sliding", sliding, "tab:orange"))
    for state, nodes, colour in states:
        if nodes.any():
            ax.plot(*flat[nodes].T, "o", ms=3, mfc=colour, mec="black", mew=0.4, label=state)


def _loaded_nodes(contact: ContactResult, blocks: dict[str, Indices]) -> Mask:
    """Return the mask (m,) of nodes that are closed or belong to a facet with pressure."""
    mask = contact.active.copy()
    for facets in blocks.values():
        mask[facets[(contact.pressure[facets] != 0.0).any(axis=1)]] = True
    return mask


def _set_limits(ax: Any, flat: Array, closed: Mask) -> float:
    """Set the limits of the axes to the closed part with a margin, or to the entire surface if no node is closed.

    The scales of the axes are equal unless the map would be too narrow.

    Returns the height of the figure relative to that of a square map, from FLAT to 1 [-].
    """
    points = flat[closed] if closed.any() else flat
    low, high = points.min(axis=0), points.max(axis=0)
    margin = MARGIN * max(0.5 * float((high - low).max()), 0.02 * float(np.ptp(flat, axis=0).max()))
    low = np.maximum(low - margin, flat.min(axis=0) - 0.05 * margin)
    high = np.minimum(high + margin, flat.max(axis=0) + 0.05 * margin)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    ax.set_facecolor("0.9")
    width, height = high - low
    if max(width, height) > LONG * min(width, height):
        return 1.0
    ax.set_aspect("equal")
    return float(np.clip(1.1 * height / max(width, 1e-300), FLAT, 1.0))
