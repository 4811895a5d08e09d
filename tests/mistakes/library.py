"""Mistakes in calls of the library: the call, the class of the error, and a pattern of its message."""
# ruff: noqa: E501 (messages stay in one piece)

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from models import elastic_model, supported, united

import fastcontact as fc
from fastcontact import generate, topology
from fastcontact.mesh import elements
from fastcontact.mesh.generate import block, block_on_block


class Mistake(NamedTuple):
    """A mistake: its name, a function that makes it, the kind of error (or warning) and a pattern of the message."""

    name: str
    make: Callable[[], object]
    kind: type
    pattern: str


def blocks(mesh=None, *, contact=True, supports=True, materials=True):
    """A block pressed on another one, right in every respect."""
    model = fc.Model(mesh or block_on_block(), "plane_strain")
    if materials:
        model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    if supports:
        supported(model, LOWER_BOTTOM="xy", UPPER_TOP="x")
        model.prescribe("UPPER_TOP", y=-0.01)
    if contact:
        model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER")
    return model


def changed(mesh=None, *, shift=0.0, **changes):
    """The two blocks' mesh, the upper one moved up by `shift`, or with parts replaced."""
    mesh = mesh or block_on_block()
    if shift:
        points = mesh.points.copy()
        points[mesh.points_of("UPPER"), 1] += shift
        changes["points"] = points
    return mesh.replace(**changes)


def solved(model, ramp=None, **options):
    return fc.solve(model, ramp or fc.linear_ramp(1), **options)


def moved(number, coordinates):
    points = block((1.0, 1.0), (2, 2)).points.copy()
    points[number] = coordinates
    return points


def of_square(points=None, cells=None):
    mesh = block((1.0, 1.0), (2, 2))
    parts = dict(mesh.cells)
    if cells is not None:
        parts["quad4"] = cells(mesh.cells["quad4"].copy())
    return fc.Model(mesh.replace(points=mesh.points if points is None else points, cells=parts), "plane_strain")


def turned(cells):
    cells[2] = cells[2][::-1]
    return cells


def held(mesh, kinematics="plane_strain", **supports):
    """A body of one material whose groups are fixed."""
    model = elastic_model(mesh, kinematics)
    for group, components in supports.items():
        model.fix(group, components)
    return model


def square(**supports):
    return held(block((1.0, 1.0), (2, 2)), **supports)


def cracked():
    """A square of two halves whose nodes were not merged, each held by itself."""
    return held(square_in_two().mesh, BOTTOM="xy")


def merged(divisions, origin):
    """A block with another one at `origin`, of which common nodes were merged; the first one is held."""
    parts = {"A": block((1.0, 1.0), (2, 2)), "B": block((1.0, 1.0), divisions, origin=origin)}
    mesh = united(**{f"{name}_": part for name, part in parts.items()})
    return held(generate.merge_points(mesh, 1e-9), A_BOTTOM="xy")


def torn():
    """A coarse block and a fine one on it, of which only the nodes of both were merged."""
    return merged((4, 2), (0.0, 1.0))


def hanging_together():
    """A block on the corner of another one, whose common node was merged; only the lower one is held."""
    return merged((2, 2), (1.0, 1.0))


def with_materials(*given):
    model = blocks(materials=False)
    for E, nu, groups in given:
        model.add_material(fc.LinearElastic(E=E, nu=nu), groups)
    return model


def with_orphan():
    mesh = block_on_block()
    lone = len(mesh.points)
    mesh = mesh.replace(
        points=np.vstack([mesh.points, [[20.0, 0.0]]]), point_groups={**mesh.point_groups, "LONE": [lone]}
    )
    return supported(blocks(mesh), LONE="x")


def with_load(add, **options):
    model = blocks()
    getattr(model, add)(**options)
    return model


def with_units(E, **names):
    model = with_materials((E, 0.3, None))
    model.units = names
    return model


def with_obstacle(height, normal=(0.0, -1.0), motion=None):
    model = square(BOTTOM="xy")
    plane = fc.obstacles.HalfSpace((0.0, height), normal)
    model.add_obstacle("plane", secondary="TOP", obstacle=plane, motion=motion or {"y": -0.01})
    return model


def empty_group(name):
    return block_on_block().with_groups(cells={name: []})


# fmt: off
MESH = [
    Mistake("a coordinate is NaN", lambda: fc.Mesh(moved(4, (np.nan, 0.5)), {}), fc.MeshError,
            r"point 4 has coordinates \[nan 0\.5\], which are not finite \(number of such points: 1\)"),
    Mistake("a coordinate is infinite", lambda: fc.Mesh(moved(4, (np.inf, 0.5)), {}), fc.MeshError,
            r"point 4 has coordinates \[inf 0\.5\]"),
    Mistake("coordinates in one dimension", lambda: fc.Mesh([[0.0], [1.0]], {}), fc.MeshError,
            r"points must have shape \(n_points, 2\) or \(n_points, 3\), not \(2, 1\)"),
    Mistake("a cell refers to a missing point", lambda: fc.Mesh([[0, 0], [1, 0], [0, 1]], {"tri3": [[0, 1, 3]]}),
            fc.MeshError, r"a cell of tri3 refers to point 3, but there are 3 points \(0-based\)"),
    Mistake("cells with a node too few", lambda: fc.Mesh([[0, 0], [1, 0], [0, 1]], {"tri3": [[0, 1]]}), fc.MeshError,
            r"cells of tri3 must have shape \(n_cells, 3\), not \(1, 2\)"),
    Mistake("a group refers to a missing cell",
            lambda: fc.Mesh([[0, 0], [1, 0], [0, 1]], {"tri3": [[0, 1, 2]]}, {"A": [1]}), fc.MeshError,
            r"cell group 'A' contains cell 1, but there are 1 \(0-based\)"),
    Mistake("an inverted cell", lambda: of_square(cells=turned), fc.MeshError,
            r"cell 2 \(quad4 at \(0\.75, 0\.25\), area -0\.25\) is inverted \(number of such cells: 1\): reorient it with mesh, count = fastcontact\.topology\.oriented\(mesh\), refine if it is curved, or move mid-side nodes towards the middles of their edges"),
    Mistake("a folded cell", lambda: of_square(moved(4, (0.9, 0.9))), fc.MeshError, r"cell 3 .* is inverted"),
    Mistake("a folded 3D mesh with reoriented cells", lambda: topology.oriented(folded_box()), fc.MeshError,
            r"cells \d+ and \d+ lie on the same side of the facet between them, near \(.*\), one of \d+ such pairs: the mesh is folded there; move its nodes or remesh"),
    Mistake("a degenerate cell", lambda: fc.Model(fc.Mesh([[0, 0], [1, 0], [2, 0]], {"tri3": [[0, 1, 2]]}), "plane_strain"),
            fc.MeshError,
            r"cell 0 \(tri3 at \(1, 0\), area 0\) is degenerate \(number of such cells: 1\): remove it or merge its points differently"),
    Mistake("a duplicate cell", lambda: of_square(cells=lambda c: np.vstack([c, c[1]])), fc.MeshError,
            r"cell 1 \(quad4 at \(0\.25, 0\.75\)\) occurs in the mesh 2 times \(number of such cells: 1\): remove the copies"),
    Mistake("a mesh without groups", lambda: blocks(changed(cell_groups={}, point_groups={})), fc.MeshError,
            r"the mesh has no groups, and thus no 'LOWER_BOTTOM': add groups in the mesher, or with Mesh\.with_groups"),
    Mistake("a mesh of facets only", lambda: fc.Model(fc.Mesh([[0, 0], [1, 0]], {"line2": [[0, 1]]}), "plane_strain"),
            fc.ModelError, r"the mesh has no solid cells, only line2"),
    Mistake("3D faces without solids",
            lambda: fc.Model(fc.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 1]], {"tri3": [[0, 1, 2]]}), "3d"), fc.ModelError,
            r"the mesh has no solid cells, only tri3"),
    Mistake("3D mesh for an axisymmetric model", lambda: fc.Model(generate.box(), "axisymmetric"), fc.ModelError,
            r"kinematics 'axisymmetric' cannot be used with a 3D mesh: use '3d'"),
    Mistake("nodes at r < 0", lambda: fc.Model(block(origin=(-0.25, 0.0)), "axisymmetric"), fc.ModelError,
            r"point \d+ has the radius x = -0\.25 < 0: an axisymmetric model lies at x >= 0, with y along the axis"),
    Mistake("nodes that were not merged", lambda: solved(cracked()), fc.FastcontactWarning,
            r"3 nodes coincide with another node, and no contact joins them \(first: points \d+ and \d+ at \(0\.5, 0\)\): merge them in the mesher or with generate\.transform\.merge_points, or define the contact"),
    Mistake("nodes not merged, one part not held", lambda: solved(square_in_two()), fc.ModelError,
            r"3 rigid-body motions are not restrained: body 'B': translation along x, .*rotation"),
    Mistake("a fine mesh merged with a coarse one", lambda: solved(torn()), fc.FastcontactWarning,
            r"2 nodes lie on facets of their own body that they do not belong to \(first: point \d+ at \(0\.25, 1\), on the facet around \(0\.25, 1\)\): the body is torn there\. Let cells share whole facets, or leave the two meshes apart and tie them by a contact of kind 'tied'; if a slit is meant, define its contact"),
    Mistake("bodies connected at a single node", lambda: solved(hanging_together()), fc.ModelError,
            r"1 rigid-body motion is not restrained: body number 1 \(around \[.*\]\), the part 'B_BLOCK' that is connected at point \d+ at \(1, 1\): rotation about \(1, 1\)\. Fix or prescribe a displacement component that stops each, or let a load press the body against a contact\. Parts of bodies are connected only at nodes \(number: 1, first: point \d+ at \(1, 1\)\): merge whole facets, or leave the parts separate and define the contact"),
    Mistake("a support on a node without cells", lambda: solved(with_orphan()), fc.ModelError,
            r"the displacement x prescribed on 'LONE' contains only points that belong to no solid cell \(number: 1, first: point 73\): name a group of the body, or connect the points to it with add_coupling or relate"),
    Mistake("a cell with an angle near 180 degrees", lambda: solved(flat_cell()), fc.FastcontactWarning,
            r"cell \d+ \(tri3 .*\) is poor: it has an angle of 17\d\.\d degrees; move its nodes or remesh"),
    Mistake("a cell with a Jacobian near zero", lambda: solved(nearly_folded()), fc.FastcontactWarning,
            r"cell \d+ \(tri6 .*\) is poor: its smallest Jacobian is 0\.0\d+ of its largest; move its nodes or remesh"),
]
# fmt: on


def folded_box():
    """Tetrahedra, of which an inner node was moved beyond its neighbours."""
    mesh = generate.box((1.0, 1.0, 1.0), (3, 3, 3), "tet4")
    points = mesh.points.copy()
    inner = int(np.argmin(np.linalg.norm(points - 1 / 3, axis=1)))
    points[inner] += (0.45, 0.33, 0.4)
    return mesh.replace(points=points)


def square_in_two():
    mesh = generate.union(block((0.5, 1.0), (2, 2), name="A"), block((0.5, 1.0), (2, 2), origin=(0.5, 0.0), name="B"))
    return held(mesh, A="xy")


def flat_cell():
    return held(
        fc.Mesh(
            [[0, 0], [1, 0], [0.5, 0.02], [0.5, 1]],
            {"tri3": [[0, 1, 2], [0, 2, 3], [1, 3, 2]]},
            point_groups={"ALL": [0, 1]},
        ),
        ALL="xy",
    )


def uneven():
    """A square with one quadratic triangle whose mid node lies far from the middle."""
    mesh = block((1.0, 1.0), (8, 8), "tri6")
    element = elements.get("tri6")
    cell = mesh.cells["tri6"][0]
    first, last = element.edges[0]
    points = mesh.points.copy()
    points[cell[3]] += 0.315 * (points[cell[last]] - points[cell[first]])
    return mesh.replace(points=points)


def nearly_folded():
    return held(uneven(), BOTTOM="xy")


# fmt: off
MATERIALS = [
    Mistake("no material at all", lambda: solved(blocks(materials=False)), fc.ModelError,
            r"no material: call add_material\(LinearElastic\(E=\.\.\., nu=\.\.\.\)\) for the solid cells"),
    Mistake("one body without a material", lambda: solved(with_materials((1000.0, 0.3, "LOWER"))), fc.ModelError,
            r"18 solid cells in 'UPPER' have no material: assign one to their groups by add_material or \[\[material\]\]"),
    Mistake("two materials for one group",
            lambda: solved(with_materials((1000.0, 0.3, ["LOWER", "UPPER"]), (2000.0, 0.3, "UPPER"))), fc.ModelError,
            r"18 cells of 'UPPER' have two materials, E = 1000, nu = 0\.3 and E = 2000, nu = 0\.3: assign one to each group; the material of all other cells must be assigned first, without groups"),
    Mistake("a material for all cells, and another for a group",
            lambda: solved(with_materials((2000.0, 0.3, "UPPER"), (1000.0, 0.3, None))), fc.ModelError,
            r"18 cells of the mesh have two materials"),
    Mistake("nu of 0.5 in Python", lambda: fc.LinearElastic(E=1.0, nu=0.5), fc.ModelError,
            r"Poisson's ratio nu = 0\.5 must be greater than -1 and less than 0\.5"),
    Mistake("E of zero in Python", lambda: fc.LinearElastic(E=0.0, nu=0.3), fc.ModelError,
            r"Young's modulus E = 0\.0 must be a positive number"),
    Mistake("E of one body in Pa, of the other in MPa",
            lambda: solved(with_materials((2.1e11, 0.3, "LOWER"), (2.1e5, 0.3, "UPPER"))), fc.FastcontactWarning,
            r"Young's moduli differ by a factor of 1e\+06 \(E = 210000 and 2\.1e\+11\): are both in the same unit\?"),
    Mistake("E in Pa where MPa is named", lambda: solved(with_units(2.1e11, length="mm", pressure="MPa")),
            fc.FastcontactWarning,
            r"Young's modulus E = 2\.1e\+11 MPa of all cells is 1\.05e\+05 times that of diamond: is it in another unit\?"),
    Mistake("E in GPa where Pa is named", lambda: solved(with_units(2.1, length="m", pressure="Pa")), fc.FastcontactWarning,
            r"Young's modulus E = 2\.1 Pa of all cells is 0\.021 times that of aerogel: is it in another unit\?"),
    Mistake("inconsistent units", lambda: solved(with_units(2.1e5, length="m", force="N", pressure="MPa")),
            fc.FastcontactWarning, r"the units are inconsistent: 1 N/m\^2 is 1e-06 MPa; change one of the three"),
    Mistake("E in Pa with a force and mm", lambda: solved(pushed(2.1e11, 1e-2)), fc.FastcontactWarning,
            r"the loads strain the model by about .*e-1\d \(total force over E times the cross-section of the model\): are loads, lengths and E in consistent units\?"),
    Mistake("a pressure in Pa with E in MPa", lambda: solved(pushed(210.0, 1e5)), fc.FastcontactWarning,
            r"the loads strain the model by about .*: are loads, lengths and E in consistent units\?"),
    Mistake("a displacement in mm of a model in m", lambda: solved(stretched(4.0)), fc.FastcontactWarning,
            r"a displacement of 4 is prescribed, 4 times the size of the model \(1\): are mesh and displacement in the same unit\?"),
]
# fmt: on


def pushed(E, pressure):
    model = elastic_model(block((1.0, 1.0), (2, 2)), "plane_strain", E=E, BOTTOM="xy")
    model.add_pressure("TOP", pressure)
    return model


def stretched(length):
    return supported(square(BOTTOM="xy"), TOP={"y": length})


# fmt: off
SUPPORTS = [
    Mistake("no support at all", lambda: solved(blocks(supports=False)), fc.ModelError,
            r"4 rigid-body motions are not restrained: body 'LOWER': translation along x, translation along y, rotation about \(5, -2\.5\); body 'UPPER': translation along y, rotation about \(5, 2\.5\), translation along x\. "),
    Mistake("one body free to slide", lambda: solved(sliding()), fc.ModelError,
            r"1 rigid-body motion is not restrained: body 'UPPER': translation along x\. Fix or prescribe a displacement component that stops each"),
    Mistake("a plate supported at one point", lambda: solved(square(BOTTOM_LEFT="xy")), fc.ModelError,
            r"1 rigid-body motion is not restrained: body 'BLOCK': .*rotation"),
    Mistake("supports that contradict each other", lambda: solved(contradicting()), fc.ModelError,
            r"'UPPER_TOP' prescribes y = 0\.5 at point \d+, but 'UPPER_TOP' prescribes -0\.01 there: remove one of the two"),
    Mistake("a support without a component", lambda: blocks().fix("LOWER_LEFT", ""), fc.ModelError,
            r"fix\('LOWER_LEFT', \.\.\.\) has no component: specify, for example, 'x' or 'xy'"),
    Mistake("a support on an empty group", lambda: blocks(empty_group("NONE")).fix("NONE", "x"), fc.ModelError,
            r"group 'NONE' is empty: no displacement can be prescribed on it"),
    Mistake("a support in z of a plane model", lambda: blocks().fix("LOWER_LEFT", "z"), fc.ModelError,
            r"the support of 'LOWER_LEFT': unknown component 'z': expected one of x, y"),
    Mistake("a motion without names of axes", lambda: with_obstacle(1.0, motion=(0, -1)), fc.ModelError,
            r"the argument motion of Model\.add_obstacle must be a dictionary of numbers by name or None, not the tuple \(0, -1\): write \{'x': 0, 'y': -1\}"),
    Mistake("hardening as a number", lambda: fc.ElasticPlastic(E=2e5, nu=0.3, yield_stress=250.0, hardening=1000.0), fc.ModelError,
            r"hardening must be pairs \(equivalent plastic strain, yield stress\), for example \[\(0\.0, 250\.0\), \(0\.1, 350\)\] for the slope 1000"),
    Mistake("a support that moves the axis of symmetry", lambda: solved(on_axis(lambda model: model.prescribe("TOP", x=0.1))),
            fc.ModelError,
            r"x = 0\.1 is prescribed at point \d+ on the axis of symmetry, where the radial displacement is zero: leave the points at x = 0 out of the group"),
    Mistake("a radial force on the axis of symmetry", lambda: on_axis(lambda model: model.add_force("TOP_LEFT", x=1.0)),
            fc.ModelError,
            r"the nodal force on 'TOP_LEFT' has a radial component x on the axis of symmetry \(number of points: 1, first: point \d+\), where the circumference is zero: leave out the points at x = 0"),
]
# fmt: on


def on_axis(add):
    """A cylinder that stands on its bottom, with something wrong added."""
    model = held(block((1.0, 1.0), (2, 2)), "axisymmetric", BOTTOM="y")
    add(model)
    return model


def sliding():
    return supported(blocks(supports=False), LOWER_BOTTOM="xy", UPPER_TOP={"y": -0.01})


def contradicting():
    return supported(blocks(), UPPER_TOP={"y": 0.5})


def split_in_two():
    mesh = block_on_block()
    facets = mesh.cell_groups["CONT_UPPER"]
    model = blocks(mesh.with_groups(cells={"ONE": facets[:3], "OTHER": facets[3:]}), contact=False)
    model.add_contact("left", secondary="ONE", primary="CONT_LOWER", formulation="mortar")
    model.add_contact("right", secondary="OTHER", primary="CONT_LOWER", formulation="mortar")
    return model


def pairs_overlap():
    mesh = block_on_block()
    model = blocks(mesh.with_groups(cells={"SOME": mesh.cell_groups["CONT_UPPER"][:1]}))
    model.add_contact("some", secondary="SOME", primary="CONT_LOWER")


def pushed_into_each_other():
    model = blocks(supports=False)
    supported(model, CONT_LOWER="xy", CONT_UPPER="x")
    return supported(model, CONT_UPPER={"y": -0.02})


def corner_pushed():
    return supported(with_obstacle(1.0), LEFT={"y": 0.0})


# fmt: off
CONTACT = [
    Mistake("contact on the wrong face", lambda: pair_of("UPPER_TOP", "CONT_LOWER"), fc.ContactError,
            r"no facet of 'UPPER_TOP' faces 'CONT_LOWER': the outer sides of the two groups face away from each other; is one of them the wrong face of its body\?"),
    Mistake("contact of an empty group",
            lambda: blocks(empty_group("NONE"), contact=False).add_contact("pair", secondary="NONE", primary="CONT_LOWER"),
            fc.ContactError, r"group 'NONE' contains no facets \(cells of dimension 1\): name a boundary group"),
    Mistake("contact inside a body", lambda: inner_contact(), fc.ContactError,
            r"facets of 'INNER' do not lie on the outside of a solid \(number: 1 of 1, first near \[.*\]\): give each body nodes of its own, which merge_points may have joined, and let boundary facets share their nodes with solid cells"),
    Mistake("one group on both sides", lambda: pair_of("CONT_UPPER", "CONT_UPPER"), fc.ContactError,
            r"contact 'pair' has 'CONT_UPPER' on both sides: name the group of the other body as one of them; contact of a surface with itself is not available"),
    Mistake("sides that overlap", lambda: pair_of("UPPER_LEFT", "CONT_UPPER"), fc.ContactError,
            r"the two sides of contact 'pair' share nodes \(number: 1, first: point \d+\): duplicate the nodes of the interface, one set for each side"),
    Mistake("the same pair twice", lambda: blocks().add_contact("again", secondary="CONT_LOWER", primary="CONT_UPPER"),
            fc.ContactError,
            r"contact 'again' has the sides 'CONT_LOWER' and 'CONT_UPPER', like contact 'pair': remove one of the two"),
    Mistake("two pairs over the same facets", lambda: pairs_overlap(), fc.ContactError,
            r"contact 'some' pairs facets of 'SOME' and 'CONT_LOWER' that are also paired by contact 'pair': 'SOME' and 'CONT_UPPER' share facets with 2 nodes \(first: point \d+\), and 'CONT_LOWER' and 'CONT_LOWER' share facets, too\. Remove one of the two contacts, or separate their groups"),
    Mistake("one surface in two groups with a contact each", lambda: solved(split_in_two()), fc.FastcontactWarning,
            r"contacts 'left' and 'right' adjoin each other at common nodes of their sides \(number: 1, first: point \d+\): the pressure near them is not unique; combine the two contacts into one, with one group for each side"),
    Mistake("the same obstacle twice",
            lambda: with_obstacle(1.0).add_obstacle("again", secondary="TOP", obstacle=fc.obstacles.HalfSpace((2.0, 1.0), (0.0, -2.0)), motion={"y": -0.01} ),
            fc.ContactError,
            r"contact 'again' presses facets of 'TOP' against the same rigid obstacle as contact 'plane', with 3 nodes \(first: point \d+\): leave out one of the two"),
    Mistake("two pairs with one name", lambda: blocks().add_contact("pair", secondary="UPPER_LEFT", primary="LOWER_RIGHT"),
            fc.ContactError, r"there is already a contact pair 'pair': names must differ"),
    Mistake("supports that push one side into the other", lambda: solved(pushed_into_each_other()), fc.ModelError,
            r"supports push 7 of the 7 nodes of 'CONT_UPPER' into 'CONT_LOWER', contact 'pair', by up to 0\.02 \(point \d+ at \(0, 0\), instant 1\): contact forces cannot change what supports prescribe; prescribe other values, or the displacement of nodes that are not in contact"),
    Mistake("a support that pushes a corner into an obstacle", lambda: solved(corner_pushed()), fc.FastcontactWarning,
            r"supports push 1 of the 3 nodes of 'TOP' into the rigid obstacle, contact 'plane', by up to 0\.01 \(point \d+ at \(0, 1\), instant 1\): contact forces cannot change what supports prescribe; leave these nodes out of the support, or out of the contact \('excluded'\)"),
    Mistake("a penetration larger than an element", lambda: solved(blocks(changed(shift=-2.0))), fc.ContactError,
            r"no facet of 'CONT_UPPER' faces 'CONT_LOWER': the outer sides of the two groups face away from each other; is one of them the wrong face of its body, or do the bodies overlap, by 2 or more\?"),
    Mistake("an obstacle with reversed orientation", lambda: solved(with_obstacle(1.0, (0.0, 1.0))), fc.ContactError,
            r"the rigid obstacle of contact 'plane' faces in the same direction as 'TOP', so that they cannot touch: reverse its normal or its facets, or name another face of the body"),
    Mistake("an obstacle deep in the body", lambda: solved(with_obstacle(0.2)), fc.ContactError,
            r"contact 'plane' begins with a penetration of 0\.8 at point \d+ \[.*\], more than the length of the element there \(0\.5\): separate the bodies, reverse the orientation of a surface, or specify an intended interference as a clearance"),
    Mistake("a contact that is never reached", lambda: solved(blocks(changed(shift=1.0))), fc.FastcontactWarning,
            r"contact 'pair' never closed: the smallest gap is 0\.99\. Check its sides and the direction of the loads"),
    Mistake("a contact pair is missing", lambda: solved(blocks(changed(shift=0.001), contact=False)), fc.FastcontactWarning,
            r"bodies '(UPPER|LOWER)' and '(UPPER|LOWER)' interpenetrate by 0\.009 near \[.*\], and no contact is defined between them: add_contact for the groups that meet"),
    Mistake("bodies overlap and no contact pair is defined between them", lambda: solved(blocks(changed(shift=-2.0), contact=False)),
            fc.ModelError,
            r"body '\w+' overlaps body '\w+' by .* before any load, and no contact pair joins them: add the contact or move one of them"),
    Mistake("friction that is negative", lambda: pair_of("CONT_UPPER", "CONT_LOWER", friction=-0.1), fc.ContactError,
            r"the coefficient of friction -0\.1 must be a number >= 0"),
    Mistake("tied contact with a penalty", lambda: pair_of("CONT_UPPER", "CONT_LOWER", kind="tied", penalty=1.0), fc.ContactError,
            r"contact 'pair' is tied, which keeps the initial gaps exactly: leave out 'penalty'"),
    Mistake("a penalty of zero", lambda: pair_of("CONT_UPPER", "CONT_LOWER", penalty=0.0), fc.ContactError,
            r"penalty = 0\.0 of contact 'pair' must be positive; without it, there is no penetration"),
    Mistake("all nodes excluded", lambda: pair_of("CONT_UPPER", "CONT_LOWER", excluded="CONT_UPPER"), fc.ContactError,
            r"contact 'pair' excludes all nodes of 'CONT_UPPER': no node remains for contact"),
    Mistake("bodies pulled apart by a force", lambda: solved(lifted()), fc.ConvergenceError,
            r"the loads pull bodies away, and no contact stops them \(.*\): reverse the loads or add supports \(step 1 from 0 to 1\)"),
]
# fmt: on


def pair_of(secondary, primary, **options):
    blocks(contact=False).add_contact("pair", secondary=secondary, primary=primary, **options)


def inner_contact():
    mesh = block_on_block()
    cell = mesh.cells["quad4"][0]
    inner = np.vstack([mesh.cells["line2"], [cell[1], cell[2]]])
    number = mesh.offsets["line2"] + len(inner) - 1
    # Lines come last, so that no number moves.
    mesh = mesh.replace(cells={**mesh.cells, "line2": inner}).with_groups(cells={"INNER": [number]})
    blocks(mesh, contact=False).add_contact("pair", secondary="INNER", primary="CONT_UPPER")


def lifted():
    model = blocks(supports=False)
    supported(model, LOWER_BOTTOM="xy", UPPER_TOP="x")
    model.couple("UPPER_TOP", "y")
    model.add_force("UPPER_TOP", y=10.0)
    return model


# fmt: off
LOADS = [
    Mistake("a pressure on points", lambda: with_load("add_pressure", group="UPPER_TOP_LEFT", value=1.0), fc.ModelError,
            r"group 'UPPER_TOP_LEFT' contains only points: this load needs a group of facets"),
    Mistake("a pressure that is NaN", lambda: with_load("add_pressure", group="UPPER_LEFT", value=np.nan), fc.ModelError,
            r"the pressure on 'UPPER_LEFT' is nan, which is not a finite number"),
    Mistake("a function that returns the wrong shape",
            lambda: solved(with_load("add_pressure", group="UPPER_LEFT", value=lambda x: x)), fc.ModelError,
            r"the pressure on 'UPPER_LEFT' is a function that returned float64 numbers of shape \(\d+, 2\) for \d+ points: it must return one real number per point"),
    Mistake("a load that varies within an element",
            lambda: solved(with_load("add_traction", group="UPPER_RIGHT", x=lambda x: np.sin(40.0 * x[:, 1]))),
            fc.FastcontactWarning,
            r"the traction on 'UPPER_RIGHT' varies within single elements, so that its quadrature is not exact: its error is \d+\.\d+% of the total; refine the mesh there"),
    Mistake("a force where the displacement is prescribed",
            lambda: solved(with_load("add_force", group="UPPER_TOP", y=-10.0)), fc.FastcontactWarning,
            r"the total force on 'UPPER_TOP' acts on \d+ points whose displacement is prescribed in its direction: the supports carry all of it\. Load other points, or omit the support"),
    Mistake("a force on an empty group", lambda: blocks(empty_group("NONE")).add_force("NONE", x=1.0), fc.ModelError,
            r"group 'NONE' is empty: no force can act on it"),
    Mistake("a body force on facets", lambda: with_load("add_body_force", groups="UPPER_TOP", y=-1.0), fc.ModelError,
            r"group 'UPPER_TOP' contains no solid cells: no body force can act on it"),
    Mistake("a radial force in axisymmetry", lambda: radial(), fc.ModelError,
            r"the total force on 'RIGHT' has a radial component x, but radial forces cancel over the full circle: use add_pressure or add_traction for a radial load"),
    Mistake("a spring with negative stiffness", lambda: with_load("add_spring", group="UPPER_TOP_LEFT", x=-1.0), fc.ModelError,
            r"stiffness"),
    Mistake("a spring as a rigid link",
            lambda: fc.solve(with_load("add_spring", group="UPPER_TOP_LEFT", to="LOWER_BOTTOM_LEFT", y=1e30), 1),
            fc.ModelError,
            r"the spring between 'UPPER_TOP_LEFT' and 'LOWER_BOTTOM_LEFT' is 1\.\de\+27 times as stiff as the body at one of its ends \(\d+\): results would have no correct digit; use \de\+06 or less, or a multi-point constraint \(relate, relate_groups\), which is exact"),
]
# fmt: on


def radial():
    model = fc.Model(block(origin=(1.0, 0.0)), "axisymmetric")
    model.add_force("RIGHT", x=1.0)


# fmt: off
RAMP = [
    Mistake("zero load steps", lambda: fc.linear_ramp(0), fc.ModelError,
            r"the number of load steps must be a positive whole number, not 0"),
    Mistake("a ramp that ends at zero", lambda: fc.linear_ramp(2, end=0.0), fc.ModelError,
            r"the ramp must end at a positive load factor, not 0\.0"),
    Mistake("instants that do not ascend", lambda: fc.Ramp((0.5, 0.2)), fc.ModelError,
            r"the instants of the ramp must be strictly increasing, not \(0\.5, 0\.2\)"),
    Mistake("a ramp without instants", lambda: fc.Ramp(()), fc.ModelError,
            r"the ramp has no instants: give at least one load factor to solve at"),
    Mistake("an instant beyond the table", lambda: fc.Ramp((0.5, 2.0)), fc.ModelError,
            r"instant 2 lies outside the table of the ramp, which covers 0 to 1"),
    Mistake("a table with NaN", lambda: fc.Ramp((1.0,), ((0.0, 0.0), (1.0, np.nan))), fc.ModelError,
            r"the table of the ramp contains a number that is not finite"),
    Mistake("a history shorter than the analysis", lambda: solved(short_history()), fc.ModelError,
            r"the ramp of the displacement x prescribed on 'LOWER_LEFT' covers 0 to 0\.5, but a load step ends at 1: extend the table"),
]
# fmt: on


def short_history():
    return supported(blocks(), LOWER_LEFT={"x": 0.0, "ramp": [(0.0, 0.0), (0.5, 1.0)]})


# fmt: off
OPTIONS = [
    Mistake("an unknown linear solver", lambda: solved(blocks(), linear_solver="direkt"), fc.ModelError,
            r"unknown linear solver 'direkt': did you mean 'direct'"),
    Mistake("a solver tolerance that is too large", lambda: solved(blocks(), linear_tolerance=10.0), fc.ModelError,
            r"linear_tolerance = 10\.0 must be positive and at most 0\.001, such as 1e-10"),
    Mistake("a criterion of zero", lambda: fc.Criteria(relative=0.0), fc.ModelError,
            r"the convergence criterion relative = 0\.0 must be positive and at most 0\.01: with a larger value the result need not be close to the solution"),
    Mistake("a criterion that accepts everything", lambda: fc.Criteria(geometry=1e3), fc.ModelError,
            r"the convergence criterion geometry = 1000\.0 must be positive and at most 0\.01: with a larger value the result need not be close to the solution"),
    Mistake("a negative limit of updates", lambda: fc.Criteria(max_geometry_updates=-1), fc.ModelError,
            r"max_geometry_updates = -1 must be a whole number >= 0"),
    Mistake("a negative number of halvings", lambda: fc.Criteria(max_halvings=-1), fc.ModelError,
            r"max_halvings = -1 must be a whole number >= 0"),
    Mistake("a negative number of updates", lambda: fc.Criteria(geometry_updates=-2), fc.ModelError,
            r"geometry_updates = -2 must be None or a whole number >= 0"),
]
# fmt: on

MISTAKES = [*MESH, *MATERIALS, *SUPPORTS, *CONTACT, *LOADS, *RAMP, *OPTIONS]
# Warnings that only the solution can tell; all others come before any computation.
AFTER = (
    "a spring as a rigid link",
    "a contact that is never reached",
    "a contact pair is missing",
    "bodies pulled apart by a force",
)
