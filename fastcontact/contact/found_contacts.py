"""Automatic contact detection: pairs of bodies whose surfaces face each other, with facet groups for both sides."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fastcontact._tools.argument_types import typed
from fastcontact._tools.html_table import html_table
from fastcontact._tools.lazy import import_library
from fastcontact.arrays import Array, Indices, Numbers
from fastcontact.contact.facing_facets import FacingPoints, OuterFacets, facing_points
from fastcontact.errors import ContactError
from fastcontact.mesh.mesh import OPPOSITE, Mesh
from fastcontact.mesh.topology import bodies

if TYPE_CHECKING:
    import pandas

# Relative difference of node distances, moduli or areas below which two sides count as equal. Without it, the finer of two
# similar meshes would count more than the softer body (`test_softer_bodies_are_secondary_and_pairs_by_name_stay`).
EQUALITY_TOLERANCE = 0.1
# Ratio of moduli above which the softer side is secondary, even if its mesh is coarser. With linear facets twice as fine on
# the secondary side, pressures of mortar contact alternate by 0.03, 0.06, 0.10 and 0.14 of their mean if the secondary body
# is 1, 3, 10 and 100 times as stiff as the other one; with the sides exchanged, by 0.01 or less.
NOTABLE_MODULUS_RATIO = 3.0
_COLUMNS = (
    "contact", "secondary", "primary", "secondary facets", "primary facets", "secondary spacing", "primary spacing",
    "smallest gap", "largest gap", "reason",
)  # fmt: skip


@dataclass(frozen=True)
class FoundContact:
    """Two surfaces that face each other.

    Attributes
    ----------
    name : str
        Name of the pair: both bodies, and a number if they have several pairs.
    bodies : (str, str)
        Names of the secondary and the primary body: the cell group of the body, ``"A+B"`` if the groups A and B form it, or
        ``"body 1"`` and so on.
    secondary, primary : str
        Groups of facets in `FoundContacts.mesh`.
    facets : (int, int)
        Number of facets of each side.
    spacing : (float, float)
        Distance between nodes of each side, the geometric mean over the facing part [length].
    gap : (float, float)
        Smallest and largest gap, negative if bodies overlap [length].
    reason : str
        Property by which the secondary side was chosen: ``"finer"``, ``"softer"``, ``"smaller"``, or ``"alike"`` for an
        arbitrary choice.
    """

    name: str
    bodies: tuple[str, str]
    secondary: str
    primary: str
    facets: tuple[int, int]
    spacing: tuple[float, float]
    gap: tuple[float, float]
    reason: str


@dataclass(frozen=True, eq=False, repr=False)
class FoundContacts(Sequence[FoundContact]):
    """Result of `find_contacts`: a sequence of `FoundContact` that is printed as a table.

    Attributes
    ----------
    mesh : Mesh
        The mesh with a group of facets for each side.
    pairs : tuple of FoundContact
    units : mapping of str to str
        Names of units of the model, as described for `Model`.

    Examples
    --------
    >>> import fastcontact as fc
    >>> contacts = fc.find_contacts(fc.generate.block_on_block())
    >>> [(pair.secondary, pair.primary) for pair in contacts]
    [('LOWER on UPPER (secondary)', 'LOWER on UPPER (primary)')]
    """

    mesh: Mesh
    pairs: tuple[FoundContact, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.pairs)

    def __getitem__(self, index: Any) -> Any:
        return self.pairs[index]

    def __repr__(self) -> str:
        if not self.pairs:
            return "no bodies that face each other"
        rows = [_COLUMNS, *self._rows("{:.4g}")]
        widths = [max(len(str(row[k])) for row in rows) for k in range(len(_COLUMNS))]
        return "\n".join("  ".join(str(text).ljust(width) for text, width in zip(row, widths)).rstrip() for row in rows)

    def _repr_html_(self) -> str:
        return html_table(self._rows("{:.4g}"), _COLUMNS, "Contacts found")

    def to_pandas(self) -> pandas.DataFrame:
        """Return the table as a ``pandas.DataFrame`` with lengths as numbers.

        Raises FileError if pandas is not installed.
        """
        library = import_library("pandas", "pandas", "'fastcontact[table]'")
        return cast("pandas.DataFrame", library.DataFrame(self._rows(None), columns=list(_COLUMNS)))

    def _rows(self, number_format: str | None) -> list[tuple[Any, ...]]:
        """Return the rows of the table, with lengths as strings in this format, or as numbers if it is None."""

        def formatted(value: float) -> Any:
            return value if number_format is None else number_format.format(value)

        return [(p.name, *p.bodies, *p.facets, *map(formatted, (*p.spacing, *p.gap)), p.reason) for p in self.pairs]


@typed(ContactError)
def find_contacts(
    mesh: Mesh,
    *,
    distance: float | None = None,
    angle: float = 45.0,
    groups: Sequence[str] | None = None,
    moduli: Mapping[str, ArrayLike] | None = None,
) -> FoundContacts:
    """Find the surfaces of different bodies that face each other, and choose the secondary side of each pair.

    Sample points of all outer facets are projected onto the closest facet of any other body. Two facets face each other
    if the distance along their normals is small enough and the normals are opposed. A surface with edges at which the
    normals differ by 48 degrees or more is split into one pair for each smooth face, since a side of a pair has one
    normal at each node. The secondary side is that of the softer body if the moduli differ by more than a factor of three,
    otherwise the one with the finer mesh. If both meshes are equally fine, it is the side of the softer body, and if both
    bodies are equally stiff, the smaller side.

    Parameters
    ----------
    mesh : Mesh
    distance : float, optional
        Largest gap or overlap [length]. By default, smooth faces of two bodies form a pair if, at some point, their distance
        is at most the size of the larger of the two facets there. The pair then extends as far as the normals are opposed.
    angle : float
        Largest deviation of the normals from opposite directions, more than 0 and less than 90 [degrees].
    groups : sequence of str, optional
        Groups of solid cells that form the bodies; by default each connected set of cells is a body. Self-contact of a body
        is not detected.
    moduli : mapping of str to array_like (n_cells,), optional
        Moduli of the solid cells, by element type [pressure]; `Model.add_contacts` takes them from the materials.

    Returns
    -------
    FoundContacts
        The pairs, and a mesh with groups for both sides of every pair.

    Raises
    ------
    ContactError
        If a number is out of range, groups share cells, or a group contains no solid cells.

    Examples
    --------
    >>> import fastcontact as fc
    >>> lower = fc.generate.block((2.0, 1.0), (4, 2))
    >>> upper = fc.generate.block((1.0, 1.0), (4, 4))
    >>> found = fc.find_contacts(fc.generate.union(lower, fc.generate.transformed(upper, translate=(0.5, 1.0))))
    >>> [(pair.name, pair.facets) for pair in found]
    [('body 2 on body 1', (4, 2))]
    """
    if distance is not None and not 0.0 <= distance < np.inf:
        raise ContactError(f"distance = {distance:g} must be a length, at least 0")
    if not 0.0 < angle < 90.0:
        raise ContactError(f"angle = {angle:g} must be more than 0 and less than 90 degrees")
    body = _bodies_of_cells(mesh, groups)
    if body.max(initial=-1) < 1:
        return FoundContacts(mesh)
    outer = OuterFacets.of(mesh, body)
    points = facing_points(outer, distance, angle)
    modulus = np.ones(mesh.n_cells)
    for name, values in (moduli or {}).items():
        modulus[mesh.offsets[name] : mesh.offsets[name] + len(mesh.cells[name])] = values
    names = list(groups) if groups is not None else _names(mesh, body)
    pairs: list[FoundContact] = []
    sides: dict[str, Mapping[str, ArrayLike]] = {}
    for pair, facets in _pairs(outer, points, modulus, names):
        sides.update(zip((pair.secondary, pair.primary), map(outer.facets, facets)))
        pairs.append(pair)
    return FoundContacts(mesh.with_facets(sides), tuple(pairs))


def no_contacts_message(mesh: Mesh, distance: float | None, angle: float, groups: Sequence[str] | None) -> str:
    """Return a message that explains why `find_contacts` finds no pairs, and states the remedy."""
    if groups is None and _whole_bodies(mesh).max() < 1:
        return (
            "the mesh is one body, since nodes connect all of its cells: name groups of cells as bodies, or duplicate the "
            "nodes where they touch"
        )
    size = float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    distant = find_contacts(mesh, distance=size, angle=angle, groups=groups)
    if not distant.pairs:
        return f"no surfaces of different bodies face each other within {angle:g} degrees: name the sides of contacts"
    nearest = min((pair.gap for pair in distant), key=lambda gap: abs(gap[0]))[0]
    within = "the size of their facets" if distance is None else f"{distance:.4g}"
    return (
        f"no bodies face each other within {within}: the nearest are {abs(nearest):.4g} apart; give distance = "
        f"{1.1 * abs(nearest):.3g} or more"
    )


def _bodies_of_cells(mesh: Mesh, groups: Sequence[str] | None) -> Indices:
    """Return the body (n_cells,) of each cell, -1 for facets and for cells in none of the groups."""
    body_of_cell = np.full(mesh.n_cells, -1, np.intp)
    if groups is None:
        body = _whole_bodies(mesh)
        for name, block in mesh.solids.items():
            body_of_cell[mesh.offsets[name] : mesh.offsets[name] + len(block)] = body[block[:, 0]]
        return body_of_cell
    for number, group in enumerate(groups):
        if not mesh.cells_of(group, dim=mesh.dim):
            raise ContactError(f"group '{group}' contains no solid cells, so it is not a body")
        rows = mesh.split(mesh.cell_groups[group])
        cells = np.concatenate([mesh.offsets[name] + rows[name] for name in rows if name in mesh.solids])
        if (body_of_cell[cells] >= 0).any():
            earlier = groups[body_of_cell[cells].max()]
            raise ContactError(f"groups '{earlier}' and '{group}' share solid cells: bodies must be apart")
        body_of_cell[cells] = number
    return body_of_cell


def _whole_bodies(mesh: Mesh) -> Numbers:
    """Return the body (n_points,) of each point, -1 for points without cells; both sides of a cut belong to the same body."""
    count, body = bodies(mesh)
    cuts = [name for name in mesh.group_names if name + OPPOSITE in mesh.group_names]
    sides = [body[[mesh.points_of(name)[0], mesh.points_of(name + OPPOSITE)[0]]] for name in cuts]
    ends = np.array(sides, np.intp).reshape(-1, 2).T
    label = connected_components(coo_array((np.ones(ends.shape[1]), ends), shape=(count, count)), directed=False)[1]
    return np.asarray(np.where(body >= 0, label[body], -1), np.int32)


def _names(mesh: Mesh, body: Indices) -> list[str]:
    """Return names of the bodies: the cell group of the body, up to four groups that form it, or its number."""
    count = np.bincount(body[body >= 0])
    groups_of_body: list[dict[str, Indices]] = [{} for _ in count]
    for group, cells in mesh.cell_groups.items():
        solids = cells[body[cells] >= 0]
        if len(solids) and np.ptp(body[solids]) == 0:
            groups_of_body[body[solids[0]]][group] = solids
    names = []
    for number, (groups, size) in enumerate(zip(groups_of_body, count), start=1):
        complete = [group for group, solids in groups.items() if len(solids) == size]
        if not complete and 1 < len(groups) <= 4:
            solids = np.concatenate([*groups.values()])
            complete = ["+".join(groups)] if len(solids) == len(np.unique(solids)) == size else []
        names.append(complete[0] if complete else f"body {number}")
    return names


def _pairs(
    outer: OuterFacets, points: FacingPoints, modulus: Array, names: Sequence[str]
) -> Iterator[tuple[FoundContact, tuple[Indices, Indices]]]:
    """Yield the pairs of smooth faces of two bodies, each together with the facets of both sides.

    `modulus` (n_cells,) are the moduli of the cells [pressure], and `names` those of the bodies.
    """
    bodies_of_points = np.sort(np.column_stack([outer.body[points.facet], outer.body[points.opposite]]), axis=1)
    for pair in np.unique(bodies_of_points, axis=0):
        samples = np.flatnonzero((bodies_of_points == pair).all(axis=1))
        facet_pairs = np.column_stack([points.facet[samples], points.opposite[samples]])
        reversed_rows = outer.body[facet_pairs[:, 0]] != pair[0]
        facet_pairs[reversed_rows] = facet_pairs[reversed_rows][:, ::-1]
        secondary, reason = _secondary(outer, facet_pairs, modulus)
        facet_pairs, numbers = (facet_pairs, pair) if secondary == 0 else (facet_pairs[:, ::-1], pair[::-1])
        face = outer.smooth_face[facet_pairs[:, 0]]
        for number, surface in enumerate(faces := np.unique(face), start=1):
            on_face = face == surface
            gap, spacing = points.gap[samples[on_face]], _spacing(outer, facet_pairs[on_face])
            sides = np.unique(facet_pairs[on_face, 0]), np.unique(facet_pairs[on_face, 1])
            names_of_pair = names[numbers[0]], names[numbers[1]]
            title = " on ".join(names_of_pair) + (f" {number}" if len(faces) > 1 else "")
            yield FoundContact(
                title, names_of_pair, f"{title} (secondary)", f"{title} (primary)", (len(sides[0]), len(sides[1])),
                (float(spacing[0]), float(spacing[1])), (float(gap.min()), float(gap.max())), reason,
            ), sides  # fmt: skip


def _spacing(outer: OuterFacets, facet_pairs: Indices) -> Array:
    """Return the geometric means (2,) of the distances between nodes of facets (n, 2) that face each other [length]."""
    return np.asarray(np.exp(np.log(outer.spacing[facet_pairs]).mean(axis=0)))


def _secondary(outer: OuterFacets, facet_pairs: Indices, modulus: Array) -> tuple[int, str]:
    """Return which column of pairs of facets (n, 2) should be the secondary side, and the reason.

    `modulus` (n_cells,) are the moduli of the cells [pressure].
    """
    moduli = modulus[outer.cell[facet_pairs]].mean(axis=0)
    measures = (
        ("softer", moduli, 1.0 / NOTABLE_MODULUS_RATIO),
        ("finer", _spacing(outer, facet_pairs), 1.0 - EQUALITY_TOLERANCE),
        ("softer", moduli, 1.0 - EQUALITY_TOLERANCE),
        ("smaller", np.array([outer.area[np.unique(side)].sum() for side in facet_pairs.T]), 1.0 - EQUALITY_TOLERANCE),
    )
    for reason, values, ratio in measures:
        if values.min() < ratio * values.max():
            return int(np.argmin(values)), reason
    return 0, "alike"
