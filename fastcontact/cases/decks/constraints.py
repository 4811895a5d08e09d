"""Contact pairs and ties of a deck, and its linear constraints: equations, *MPC, rigid bodies and couplings.

The constraints are linear in the displacements, which must be small.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array
from fastcontact.cases.decks.axes import local_axes, local_directions, orientation_of
from fastcontact.cases.decks.blocks import Block, Location, Row, as_number, errors_at, unquoted
from fastcontact.cases.decks.content import Content, Coupling, MultiPoint, Pair
from fastcontact.cases.decks.meshing import DeckMesh, ascending, group_of_surface
from fastcontact.elasticity.loads import Traction
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.mesh.mesh import ROTATION, Mesh
from fastcontact.model.couplings import ReferencePoint, Term, distributing_rows, relation, rigid_rows

# Smallest number of nodes of those kinds of *MPC whose number of nodes is not fixed.
MIN_NODES = {"PLANE": 4, "STRAIGHT": 3, "MEANROT": 3}
# Relative tolerance of the tests for coincident or collinear nodes, and for nodes on the axis of MEANROT, whose squared
# distances are compared.
DEGENERATE = 1e-9
# Largest number of terms of an equation. All displacements in an equation are coupled to each other.
MOST_TERMS = 100_000


def add_rotation_points(deck_mesh: DeckMesh) -> None:
    """Add a point for the rotation of each reference node, and groups for both, before the mesh is built.

    Raises CaseError in axisymmetric models.
    """
    for coupling in deck_mesh.content.couplings:
        point = deck_mesh.node(coupling.reference, coupling.location)
        if coupling.rotation:
            deck_mesh.rotations[point] = deck_mesh.node(coupling.rotation, coupling.location)
        elif deck_mesh.kinematics == "axisymmetric":
            raise coupling.error("is not supported in axisymmetric models: relate the nodes by *EQUATION")
        else:
            deck_mesh.rotation(point)
        name = deck_mesh.add_points(coupling.reference, [point])
        deck_mesh.point_groups[name + ROTATION] = ascending([deck_mesh.rotations[point]])


def relations_of(deck_mesh: DeckMesh, mesh: Mesh) -> list[MultiPointConstraint]:
    """Return one constraint for all equations and *MPC, and one for each rigid body and each coupling."""
    content = deck_mesh.content
    axes = local_directions(deck_mesh)
    rows = [row for block in content.blocks["EQUATION"] for row in _equations(deck_mesh, block, axes)]
    rows += [row for constraint in content.multi_points for row in multi_point_rows(deck_mesh, constraint)]
    constraints = [relation("the equations of the deck", rows, mesh.points.shape)] if rows else []
    for coupling in content.couplings:
        name = f"*{coupling.location.keyword} of line {coupling.location.line}"
        constraints.append(MultiPointConstraint(name, _coupling_rows(deck_mesh, mesh, coupling)))
    return constraints


def _equations(deck_mesh: DeckMesh, block: Block, axes: Mapping[int, Array]) -> Iterator[list[Term]]:
    """Yield the terms of each equation of *EQUATION: the number of terms, then node, component and coefficient of each.

    Components in the deck are along the local `axes` of points, those of the returned terms along the global axes.
    Raises CaseError if the number of terms is wrong, or if all coefficients are zero.
    """
    rows = block.iter_rows()
    for first in rows:
        count, n_terms, terms = first.integer(0), 0, []  # type: int, int, list[Term]
        if not 1 <= count <= MOST_TERMS:
            raise first.error(f"an equation cannot have {count} terms")
        while n_terms < count and (row := next(rows, None)) is not None:
            for start in range(0, len(row.entries), 3):
                if row.text(start):
                    terms += _equation_terms(deck_mesh, row, start, axes)
                    n_terms += 1
        if n_terms != count:
            raise first.error(f"the equation has {n_terms} terms, {count} are announced")
        if not any(coefficient for _, _, coefficient in terms):
            raise first.error("all coefficients of the equation are zero")
        yield terms


def _equation_terms(deck_mesh: DeckMesh, row: Row, start: int, axes: Mapping[int, Array]) -> Iterator[Term]:
    """Yield terms along the global axes that are equivalent to that in the entries `start` to `start` + 2 of a line."""
    point, component = deck_mesh.node(row.text(start), row.location), row.integer(start + 1)
    if not 1 <= component <= deck_mesh.dim:
        raise row.error(f"component {component} of '{row.text(start)}' is not within 1 to {deck_mesh.dim}")
    along = row.number(start + 2) * axes.get(point, np.eye(3))[component - 1]
    yield from ((point, axis, along[axis]) for axis in np.flatnonzero(along[: deck_mesh.dim]).tolist())


def _pin_rows(deck_mesh: DeckMesh, pin: MultiPoint) -> list[list[Term]]:
    """Return the equations of nodes with the same displacement. Raises CaseError if the numbers of nodes do not match."""
    first, second = (deck_mesh.nodes(name, pin.location) for name in pin.nodes)
    numbers = f"{len(first)} and {len(second)}"
    if len(second) == 1:
        second = second * len(first)
    if len(first) != len(second) or set(zip(first, second, strict=True)) & set(zip(second, first, strict=True)):
        raise pin.error(
            f"'{pin.nodes[0]}' and '{pin.nodes[1]}' have {numbers} nodes: the numbers must be equal, or the second number 1, "
            "and no node may be tied to itself"
        )
    pairs = list(zip(first, second, strict=True))
    return [[(p, axis, 1.0), (q, axis, -1.0)] for p, q in pairs for axis in range(deck_mesh.dim)]


def _followers(deck_mesh: DeckMesh, coupling: Coupling) -> list[int]:
    """Return the points that a coupling relates to its reference point, in ascending order.

    Raises CaseError if there are none.
    """
    if coupling.kind == "nodes":
        points = deck_mesh.nodes(coupling.group, coupling.location)
    elif coupling.kind == "elements":
        elements = deck_mesh.elements_of(coupling.group, coupling.location)
        points = [p for element in elements if element.type is not None for p in element.points]
    else:
        definition, scope = deck_mesh.surface(coupling.group, coupling.location)
        if definition.of_nodes:
            points = deck_mesh.surface_nodes(definition, scope)
        else:
            points = [p for face in deck_mesh.faces(coupling.group, coupling.location) for p in face.points]
    reference = deck_mesh.node(coupling.reference, coupling.location)
    followers = sorted(set(points) - {reference, deck_mesh.rotations[reference]})
    if not followers:
        raise coupling.error(f"'{coupling.group}' contains no nodes that could follow the reference node")
    return followers


def _coupling_rows(deck_mesh: DeckMesh, mesh: Mesh, coupling: Coupling) -> csr_array:
    """Return the constraint rows of a coupling.

    The nodes follow the reference point or, if the coupling is distributing, the reference point has the area-weighted mean
    motion of a surface.
    """
    point = deck_mesh.node(coupling.reference, coupling.location)
    reference = ReferencePoint(point, deck_mesh.rotations[point])
    points = np.array(_followers(deck_mesh, coupling), np.intp)
    if not coupling.distributing:
        directions = np.array([_directions(deck_mesh, coupling, follower) for follower in points.tolist()])
        return rigid_rows(mesh.points, reference, points, directions)
    deck_mesh.faces(coupling.group, coupling.location)
    surface = Traction(group_of_surface(deck_mesh, coupling.group), {0: 1.0}, None)
    areas = surface.vector(mesh, deck_mesh.kinematics)[:, 0]
    weight = areas[points] / areas[points].sum()
    directions = _directions(deck_mesh, coupling, point)
    with errors_at(coupling):
        return distributing_rows(mesh.points, reference, points, weight, directions)


def _directions(deck_mesh: DeckMesh, coupling: Coupling, point: int) -> Array:
    """Return the unit vectors (n, dim) [-] along which a coupling constrains a point."""
    axes = np.eye(3)
    if coupling.orientation:
        orientation = orientation_of(deck_mesh.content, coupling.orientation, coupling.location)
        axes = local_axes(orientation, deck_mesh.points[point])
    return axes[[component - 1 for component in coupling.components if component <= deck_mesh.dim], : deck_mesh.dim]


def multi_point_rows(deck_mesh: DeckMesh, constraint: MultiPoint) -> list[list[Term]]:
    """Return the equations of a multi-point constraint.

    PLANE and STRAIGHT: the first three or two nodes determine a plane or a line. Normal to it, the displacement of each
    further node is that of the affine interpolation between these nodes, so that it remains on the plane or the line. Raises
    CaseError if the nodes are too few or degenerate, or if the model is plane.
    """
    if constraint.kind in ("PIN", "TIE"):
        return _pin_rows(deck_mesh, constraint)
    nodes = [point for name in constraint.nodes for point in deck_mesh.nodes(name, constraint.location)]
    nodes = [*dict.fromkeys(nodes[:-1] if constraint.kind == "MEANROT" else nodes), *nodes[-1:]]
    nodes = nodes if constraint.kind == "MEANROT" else nodes[:-1]
    if len(nodes) < MIN_NODES[constraint.kind] or deck_mesh.dim == 2:
        raise constraint.error(f"{constraint.kind} needs {MIN_NODES[constraint.kind]} different nodes or more, in 3D")
    coordinates = deck_mesh.points[nodes]
    if constraint.kind == "MEANROT":
        return [_mean_rotation(constraint, nodes, coordinates)]
    relative, k = coordinates - coordinates[0], MIN_NODES[constraint.kind] - 1
    basis = relative[1:k]  # from the first node to the others of the k nodes that determine the line or the plane
    _, singular_values, directions = np.linalg.svd(basis)
    if singular_values[-1] <= DEGENERATE * singular_values[0]:
        degenerate = "two nodes of STRAIGHT coincide" if k == 2 else "three nodes of PLANE lie on a line"
        raise constraint.error(f"the first {degenerate}")
    components = np.linalg.lstsq(basis.T, relative.T, rcond=None)[0].T
    weights = np.column_stack([1.0 - components.sum(axis=1), components])
    return [
        _terms([nodes[i], *nodes[:k]], np.outer([1.0, *-weights[i]], normal))
        for i in range(k, len(nodes))
        for normal in directions[k - 1 :]
    ]


def _mean_rotation(constraint: MultiPoint, nodes: list[int], coordinates: Array) -> list[Term]:
    """Return the equation that makes the first component of the last node the mean rotation of the other nodes [radian].

    As in CalculiX, the mean rotation is the mean of the nodal angles about the centre, ``mean(a . (p x u) / p . p)``, where a
    is the unit vector along the axis, p are the offsets from the centre normal to the axis, and u are the displacements
    relative to their mean. The `coordinates` (n, 3) [length] of the last node are the direction of the axis.
    """
    axis, relative = coordinates[-1], coordinates[:-1] - coordinates[:-1].mean(axis=0)
    length = np.linalg.norm(axis)
    if length == 0.0:
        raise constraint.error(
            "the coordinates of the last node of MEANROT are the direction of the axis, which must not be zero"
        )
    axis = axis / length
    offset = relative - np.outer(relative @ axis, axis)
    squared = np.einsum("nd,nd->n", offset, offset)
    if squared.min() <= DEGENERATE * squared.max():
        raise constraint.error("a node of MEANROT lies on the axis through the centre, where it has no angle")
    arms = np.cross(axis, offset) / squared[:, None] / len(offset)
    arms -= arms.mean(axis=0)
    return [*_terms(nodes[:-1], arms), (nodes[-1], 0, -1.0)]


def _terms(points: list[int], coefficients: Array) -> list[Term]:
    """Return the nonzero terms of an equation with coefficients (n, 3) of the displacements of points."""
    return [
        (point, axis, value)
        for point, row in zip(points, coefficients.tolist(), strict=True)
        for axis, value in enumerate(row)
        if value
    ]


def contact_pair(content: Content, block: Block) -> None:
    """Read *CONTACT PAIR; the first surface of a line is the secondary side, the second one the primary side."""
    kinds = ("NODE TO SURFACE", "SURFACE TO SURFACE", "MORTAR", "LINMORTAR", "PGLINMORTAR")
    if block.choice("TYPE", kinds) == "NODE TO SURFACE":
        content.note(block, "NODE TO SURFACE: mortar contact is used, which transmits uniform pressures on any meshes")
    if "SMALL SLIDING" in block.parameters:
        content.note(block, "SMALL SLIDING: no effect, contact is detected in the deformed configuration")
    adjust = block.get("ADJUST") if "ADJUST" in block.parameters else ""
    interaction = block.required("INTERACTION")
    content.pairs += [Pair(*sides, interaction, adjust=adjust) for sides in _sides_of(block, "a contact pair")]


def _sides_of(block: Block, kind: str) -> Iterator[tuple[Location, str, str]]:
    """Yield the location of each data line with the names of its secondary and its primary surface."""
    for row in block.iter_rows():
        if len([entry for entry in row.entries if entry]) != 2:
            raise row.error(f"{kind} needs two surfaces, the secondary and the primary one")
        yield row.location, unquoted(row.text(0)), unquoted(row.text(1))


def clearance(content: Content, block: Block) -> None:
    """Read *CLEARANCE: the initial gap between the sides of a pair, which replaces the gap in the coordinates."""
    secondary = block.get("SLAVE") or block.get("SECONDARY")
    primary = block.get("MASTER") or block.get("MAIN")
    value = as_number(block.location, block.required("VALUE"))
    for pair in content.pairs:
        if (pair.secondary.upper(), pair.primary.upper()) == (secondary.upper(), primary.upper()):
            pair.clearance = value
            return
    raise block.error(f"there is no contact pair of '{secondary}' and '{primary}' above this line")


def tie(content: Content, block: Block) -> None:
    """Read *TIE: tied surfaces, or the end surfaces of a cyclic sector."""
    if "CYCLIC SYMMETRY" in block.parameters:
        block.only_row()
        content.sector_ends += [(block, first, second) for _, first, second in _sides_of(block, "cyclic symmetry")]
        return
    adjust = block.choice("ADJUST", ("YES", "NO"))
    if tolerance := block.get("POSITION TOLERANCE"):
        value = as_number(block.location, tolerance)
        if value < 0.0:
            raise block.error(f"POSITION TOLERANCE={value:g} is negative")
        text = "no effect, the surfaces are tied where they face each other, at any distance, not node by node"
        content.note(block, f"POSITION TOLERANCE={value:g}: {text}")
    if adjust == "YES" and "ADJUST" in block.parameters:
        content.note(block, "ADJUST=YES: nodes are not moved, distances of the sides are kept")
    content.pairs += [Pair(*sides, tied=True) for sides in _sides_of(block, "a tie")]


def multi_point(content: Content, block: Block) -> None:
    """Read *MPC.

    PIN and TIE give two nodes the same displacement, and BEAM makes the first node follow the second one like a rigid bar.
    PLANE, STRAIGHT and MEANROT continue on lines that begin with a number.
    """
    unfinished: list[tuple[Row, str, list[str]]] = []
    for row in block.iter_rows():
        kind, nodes = row.text(0).upper(), [unquoted(entry) for entry in row.entries[1:] if entry]
        if kind.isdecimal() and unfinished:
            unfinished[-1][2].extend([*([row.text(0)] if int(kind) else []), *nodes])
        elif kind in MIN_NODES:
            unfinished.append((row, kind, nodes))
        elif kind not in ("PIN", "TIE", "BEAM"):
            kinds = ", ".join(("PIN", "TIE", "BEAM", *MIN_NODES))
            raise row.error(f"an MPC of type {kind[:40]} is not supported, only {kinds}")
        elif len(nodes) != 2:
            raise row.error(f"{kind} needs two nodes, the dependent and the independent one")
        elif kind == "BEAM":
            content.couplings.append(Coupling(row.location, nodes[1], nodes[0], "nodes"))
        else:
            content.multi_points.append(MultiPoint(row.location, kind, tuple(nodes)))
    content.multi_points += [MultiPoint(row.location, kind, tuple(nodes)) for row, kind, nodes in unfinished]


def rigid_body(content: Content, block: Block) -> None:
    """Read *RIGID BODY: nodes or elements that move as a rigid body with a reference node."""
    kind, group = ("elements", block.get("ELSET")) if block.get("ELSET") else ("nodes", block.required("NSET"))
    reference, rotation = block.required("REF NODE"), block.get("ROT NODE")
    content.couplings.append(Coupling(block.location, reference, group, kind, rotation=rotation))


def coupling(content: Content, block: Block, inner: Block) -> None:
    """Read *COUPLING (`block`) with its *KINEMATIC or *DISTRIBUTING (`inner`)."""
    components: set[int] = set()
    for row in inner.iter_rows():
        first, last = row.integer(0), row.integer(1, row.integer(0))
        if not 1 <= first <= last <= 6:
            raise row.error(f"the components {first} to {last} are not within 1 to 6")
        components.update(range(first, last + 1))
    names = block.required("REF NODE"), block.required("SURFACE"), "surface"
    directions = tuple(sorted(components)) or (1, 2, 3, 4, 5, 6)
    distributing, orientation = inner.keyword == "DISTRIBUTING", block.get("ORIENTATION")
    content.couplings.append(Coupling(block.location, *names, directions, distributing, orientation=orientation))
