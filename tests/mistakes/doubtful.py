"""Solvable but doubtful cases: mesh and case file, and a pattern of the warning with its number."""
# ruff: noqa: E501 (messages stay in one piece)

from typing import NamedTuple

import library
from case_texts import contact_pair, supports

import fastcontact as fc


class Doubt(NamedTuple):
    """A doubtful case: its name, a function that makes its mesh, its case file, and patterns of all its warnings."""

    name: str
    mesh: object
    case: str
    patterns: tuple[str, ...]


HEAD = """
title = "a doubtful case"
kinematics = "{kinematics}"
units = {{ length = "mm", force = "N", pressure = "MPa" }}
mesh.file = "doubtful.med"
ramp.steps = {steps}
"""
STEEL = "[[material]]\nE = 1000.0\nnu = 0.3\n"
BLOCKS = supports(LOWER_BOTTOM="xy", UPPER_TOP={"x": 0.0, "y": -0.01})
SPHERES = supports(A1A2="x", A2B2={"y": -2.0}, A1B1={"y": 2.0}) + contact_pair(
    "CONT1", "CONT2", 'formulation = "node_to_segment"'
)
PAIR = contact_pair()


def doubt(name, mesh, case, *patterns):
    return Doubt(name, mesh, case, patterns)


def of(*parts, kinematics="plane_strain", steps=1):
    return HEAD.format(kinematics=kinematics, steps=steps) + "".join(parts)


def square():
    return fc.generate.block((1.0, 1.0), (2, 2))


def half_grouped():
    """A square with a contact group of half of its upper side."""
    mesh = fc.generate.block((1.0, 1.0), (8, 8))
    return mesh.with_facet_group("HALF", lambda x: (x[:, 1] > 0.999) & (x[:, 0] < 0.51))


def pressed_half(ramp=""):
    """An obstacle that comes down onto this group."""
    shape = 'shape = { kind = "half_space", point = [0.0, 1.0], normal = [0.0, -1.0] }\n'
    return f'[obstacle.pair]\nsecondary = "HALF"\nmotion = {{ y = -0.02 }}\n{ramp}{shape}'


def halves(x):
    """Two halves of a square, of which the right one begins at `x`."""
    left, right = (fc.generate.block((0.5, 1.0), (2, 2), name=n, origin=(o, 0.0)) for n, o in (("A", 0.0), ("B", x)))
    return fc.generate.union(left, right)


def raised(height):
    mesh = fc.generate.block_on_block()
    points = mesh.points.copy()
    points[mesh.points_of("UPPER"), 1] += height
    return mesh.replace(points=points)


def lacking():
    """Two blocks of which the lower one has but some of its facets in its contact group."""
    mesh = fc.generate.block_on_block()
    lower = mesh.cell_groups["CONT_LOWER"]
    kept = {**mesh.cell_groups, "CONT_LOWER": lower[: len(lower) // 2]}
    points = {name: numbers for name, numbers in mesh.point_groups.items() if name != "CONT_LOWER"}
    return fc.Mesh(mesh.points, dict(mesh.cells), cell_groups=kept, point_groups=points)


def bent():
    """A quadratic triangle with a side that is bent far inward."""
    nodes = [[0, 0], [1, 0], [0, 1], [0.5, 0], [0.25, 0.25], [0, 0.5]]
    return fc.Mesh(nodes, {"tri6": [range(6)]}, point_groups={"ALL": [0, 1, 3]})


def turned(angle):
    """Supports that turn a square without deforming it, as linear kinematics see it."""
    corners = {"BOTTOM_LEFT": (0, 0), "BOTTOM_RIGHT": (1, 0), "TOP_LEFT": (0, 1), "TOP_RIGHT": (1, 1)}
    return supports(**{name: {"x": float(-angle * y), "y": float(angle * x)} for name, (x, y) in corners.items()})


# fmt: off
DOUBTS = [
    doubt("too few geometry updates are requested", lambda: fc.generate.half_spheres("tri3", size=5.0),
          of(STEEL, SPHERES, "[solve]\ngeometry_updates = 1\n", kinematics="axisymmetric"),
          r"the contact geometry had not converged after the requested number of updates, 1: the last one changed the displacement by \d\.\d% of its largest component\. Allow more geometry_updates, or omit the option"),
    doubt("contact opens again", fc.generate.block_on_block,
          of(STEEL, BLOCKS, PAIR, steps=4).replace("ramp.steps = 4", "ramp = { steps = 4, table = [[0.0, 0.0], [0.5, 1.0], [1.0, -1.0]] }"),
          r"contact 'pair' has opened again at the end: the smallest gap is 0\.01"),
    doubt("contact never closes", lambda: raised(1.0),
          of(STEEL, BLOCKS, PAIR),
          r"contact 'pair' never closed: the smallest gap is 0\.99\. Check its sides and the direction of the loads"),
    doubt("bodies interpenetrate where no contact is defined", lambda: raised(0.001),
          of(STEEL, BLOCKS),
          r"bodies '\w+' and '\w+' interpenetrate by 0\.009 near \[.*\], and no contact is defined between them: add_contact for the groups that meet"),
    doubt("strains are large", square,
          of(STEEL, supports(BOTTOM="xy", TOP={"y": 0.3})),
          r"the largest equivalent strain is 0\.\d+, beyond the 0\.1 up to which linear kinematics are accurate"),
    doubt("plastic strains are large", square,
          of(STEEL + 'law = "elastic_plastic"\nyield_stress = 3.0\n', supports(LEFT="x", BOTTOM="y", TOP={"y": -0.7})),
          r"the largest plastic strain is 0\.\d+, beyond the 0\.2 up to which linear kinematics are valid: contact pressures there are too low, under a ball by 10 % at 0\.2; strain='finite' has no such limit"),
    doubt("rotations are large", lambda: fc.generate.block((1.0, 1.0), (1, 1)),
          of(STEEL, turned(0.5)),
          r"the largest rotation is 0\.500 rad, near \[0\.5 0\.5\]: linear kinematics treat it as small, which neglects strains of about 0\.125"),
    doubt("springs that regularise rigid motions carry load", lambda: raised(30.0),
          of(
              STEEL,
              supports(LOWER_BOTTOM="xy", UPPER_TOP="x"),
              '[[couple]]\ngroup = "UPPER_TOP"\ncomponent = "y"\n',
              '[[force]]\ngroup = "UPPER_TOP_LEFT"\ny = -1e-9\n',
              PAIR,
          ),
          r"the springs that regularise body 'UPPER': translation along y still carry \d\.\de-\d\d of the load: rigid motions are so much larger than deformations that round-off permits no higher accuracy",
          r"the loads strain the model by about .*: are loads, lengths and E in"),
    doubt("a cell is poor", library.uneven,
          of(STEEL, supports(BOTTOM="xy")),
          r"cell \d+ \(tri6 .*\) is poor: its smallest Jacobian is 0\.0\d+ of its largest; move its nodes or remesh"),
    doubt("no heat flows through a contact", fc.generate.block_on_block,
          of(STEEL, "conductivity = 1.0\n", BLOCKS, PAIR,
             '[[fixed_temperature]]\ngroup = "UPPER_TOP"\nvalue = 100.0\n',
             '[[film]]\ngroup = "LOWER_BOTTOM"\ncoefficient = 1.0\nambient = 0.0\n'),
          r"no heat flows across contact 'pair', closed or not: give it a conductance, or conductance=0\.0 if it insulates"),
    doubt("the mesh does not resolve the contact", lambda: fc.generate.half_spheres("tri3", size=5.0),
          of(STEEL, SPHERES, kinematics="axisymmetric"),
          r"contact 'pair' has only \d elements? across its radius: its pressure needs 4 or more; refine 'CONT1'"),
    doubt("the quadrature of the stiffness is not exact", bent,
          of(STEEL, supports(ALL="xy")),
          r"the quadrature of the stiffness is not exact on curved or distorted cells: its error is \d+\.\d+% of the total; use smaller or better-shaped cells"),
    doubt("nearly incompressible elements lock", lambda: fc.generate.block((1.0, 1.0), (6, 6)),
          of(STEEL.replace("0.3", '0.499\nvolumetric = "plain"'), supports(BOTTOM="xy"), '[[traction]]\ngroup = "TOP"\nx = 0.1\n'),
          r'quad4 cells lock: at nu = 0\.499, nearly incompressible, they make the model about \d+% too stiff \(elastic energy under the same forces\); give the material volumetric="mean_dilatation"'),
    doubt("pressures that follow facets instead of arcs", lambda: fc.generate.rings("quad4", divisions_inner=(2, 12), divisions_outer=(2, 8)),
          of(
              STEEL,
              supports(SYMMETRY_X="x", SYMMETRY_Y="y"),
              contact_pair("CONT_INNER", "CONT_OUTER", 'formulation = "continuous"\nsurface_smoothing = false\nclearance = -0.2'),
          ),
          r"contact 'pair': facets of 'CONT_INNER' and of the other side deviate from their arcs by up to 0\.297, which may change pressures by about 5\.24, compared with a mean of 3\.85: surface_smoothing=True measures the gap between the arcs; quadratic elements, or facets of length 0\.96 instead of 6\.5 reduce the error",
          r"contact 'pair': nodal pressures oscillate from node to node, typically by \d+% above and below their local mean, and by up to \d\.\d+: trust means over neighbouring nodes, or use formulation mortar"),
    doubt("facets are integrated as a whole", lambda: fc.generate.rings("quad8", divisions_inner=(8, 12), divisions_outer=(8, 13)),
          of(
              STEEL,
              supports(SYMMETRY_X="x", SYMMETRY_Y="y"),
              contact_pair("CONT_INNER", "CONT_OUTER", 'formulation = "continuous"\nclearance = -0.2'),
          ),
          r"contact 'pair': the integration points of complete facets change nodal pressures by about 0\.\d+, compared with a mean of \d\.\d+: use formulation mortar, which integrates up to the edges of opposite facets"),
    doubt("nodes were not merged", lambda: halves(0.5),
          of(STEEL, supports(BOTTOM="xy")),
          r"3 nodes coincide with another node, and no contact joins them \(first: points \d+ and \d+ at \(0\.5, 0\)\): merge them in the mesher or with generate\.transform\.merge_points, or define the contact"),
    doubt("E is in Pa where the case names MPa", square,
          of(STEEL.replace("1000.0", "2.1e11"), supports(BOTTOM="xy")),
          r"Young's modulus E = 2\.1e\+11 MPa of all cells is 1\.05e\+05 times that of diamond: is it in another unit\?"),
    doubt("the loads are in another unit than E", square,
          of(STEEL, supports(BOTTOM="xy"), '[[pressure]]\ngroup = "TOP"\nvalue = 1e-10\n'),
          r"the loads strain the model by about 1e-13 \(total force over E times the cross-section of the model\): are loads, lengths and E in consistent units\?"),
    doubt("a penalty is too soft", fc.generate.block_on_block,
          of(STEEL, BLOCKS, PAIR, "penalty = 1000.0\n"),
          r"contact 'pair' penetrates by 0\.\d+, which is \d+\.\d% of the largest displacement: raise its penalty from 1000 to about \S+, or omit it"),
    doubt("a spring that is a thousand times too stiff", lambda: fc.generate.block_on_block(divisions_upper=(8, 4)),
          of(STEEL, BLOCKS, '[[spring]]\ngroup = "CONT_UPPER"\nto = "CONT_LOWER"\ny = 1e10\n'),
          r"the spring between 'CONT_UPPER' and 'CONT_LOWER' is 1\.7e\+07 times as stiff as the body at one of its ends \(577\): results lose up to 7 of 16 digits, and with contact its force is accurate only to this ratio times the convergence criteria; use 6e\+06 or less, or a multi-point constraint \(relate, relate_groups\), which is exact"),
    doubt("a coefficient of wear in another unit", lambda: fc.generate.block((8.0, 2.0), (24, 6), origin=(-4.0, -2.0)),
          of(
              STEEL,
              supports(BOTTOM="xy"),
              '[obstacle.drum]\nsecondary = "TOP"\nshape = { kind = "sphere", centre = [0.0, 5.0], R = 5.0 }\n',
              'motion = { y = -0.2 }\nrotation = { angle = 0.1, centre = [0.0, 5.0] }\nwear = 1.0\nformulation = "node_to_segment"\n',
          ),
          r"contact 'drum' has a wear depth of \S+, \S+ times the size of the model, and load steps that are \S+ times too large for this wear: is the option 'wear' Archard's coefficient divided by the hardness, in units of 1/pressure\?"),
    doubt("a contact group lacks facets", lacking,
          of(STEEL, BLOCKS, PAIR),
          r"contact 'pair' lacks facets: bodies 'LOWER' and 'UPPER' pass through each other by 0\.00\d+ at point \d+ \[.*\], beside 'CONT_UPPER' and 'CONT_LOWER'; its force is too small, add the facets there"),
    doubt("a contact group against an obstacle lacks facets", half_grouped,
          of(STEEL, supports(BOTTOM="xy"), pressed_half()),
          r"contact 'pair' lacks facets: the body passes through the obstacle by 0\.01\d+ at point \d+ \[0\.625 1\. +\], beside 'HALF'; its force is too small, add the facets there"),
    doubt("a contact group against an obstacle lacks facets while it is pressed", half_grouped,
          of(STEEL, supports(BOTTOM="xy"), pressed_half("ramp = [[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]]\n"), steps=2),
          r"in load step 1, where its force is largest, contact 'pair' lacks facets: the body passes through the obstacle by 0\.01\d+ at point \d+ \[0\.625 1\. +\], beside 'HALF'; its force is too small, add the facets there"),
    doubt("nodes nearly coincide", lambda: halves(0.5 + 1e-7),
          of(STEEL, supports(BOTTOM="xy")),
          r"3 nodes lie within 1e-07 of another node, and no contact joins them \(first: points \d+ and \d+ at \(0\.5, 0\)\): merge them in the mesher or with generate\.transform\.merge_points, or define the contact"),
    doubt("friction in percent", fc.generate.block_on_block,
          of(STEEL, BLOCKS, PAIR, "friction = 30.0\n"),
          r"the friction of contact 'pair' is 30, but plausible values are at most 3: is it in percent\? To exclude sliding, use kind='tied'"),
    doubt("the initial penetration exceeds the prescribed approach", lambda: raised(-0.02),
          of(STEEL, BLOCKS, PAIR),
          r"contact 'pair' begins with a penetration of 0\.02 at point \d+ \[.*\], more than the 0\.01 that supports push along its normal: the contact forces are due to this penetration\. Separate the bodies, or specify an intended interference as a clearance"),
    doubt("a load without a ramp beside one that has one", square,
          of(
              STEEL,
              supports(BOTTOM="xy"),
              '[[pressure]]\ngroup = "TOP"\nvalue = 1.0\n[[traction]]\ngroup = "RIGHT"\nx = 1.0\n',
              "ramp = [[0.0, 0.0], [1.0, 0.0], [2.0, 1.0]]\n",
          ).replace("ramp.steps = 1", "ramp = { instants = [1.0, 2.0], table = [[0.0, 0.0], [2.0, 2.0]] }"),
          r"the pressure on 'TOP' has no ramp, unlike others: at load factor 2 it is 2 times the given value; to hold it from 1 on, give ramp=\[\(0, 0\), \(1, 1\), \(2, 1\)\]"),
]
# fmt: on
