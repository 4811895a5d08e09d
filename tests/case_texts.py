"""Texts of decks and case files shared by many tests."""


def square(first, height):
    """Return four lines of ``*Node``, numbered from `first`: the corners of the unit square at a whole height."""
    corners = ((0, 0), (1, 0), (1, 1), (0, 1))
    return "".join(f"{first + k}, {x}., {y}., {height}.\n" for k, (x, y) in enumerate(corners))


# One cube, E = 100000, nu = 0.3.
CUBE = f"""*Node
{square(1, 0)}{square(5, 1)}*Element, type=C3D8, elset=one
1, 1, 2, 3, 4, 5, 6, 7, 8
*Nset, nset=x1
2, 3, 6, 7
*Nset, nset=all, generate
1, 8
*Material, name=steel
*Elastic
100000., 0.3
*Solid Section, elset=one, material=steel
"""
HELD = "1, 1, 3\n2, 2, 3\n3, 3\n4, 1\n4, 3\n5, 1\n8, 1\n"

# Two squares side by side, pulled at one corner.
FLAT = """*Node
1, 0., 0.
2, 1., 0.
3, 1., 1.
4, 0., 1.
5, 2., 0.
6, 2., 1.
*Element, type=CPE4, elset=one
1, 1, 2, 3, 4
*Element, type=CPE4, elset=two
2, 2, 5, 6, 3
*Material, name=steel
*Elastic
1000., 0.3
*Solid Section, elset=one, material=steel
1.
*Solid Section, elset=two, material=steel
1.
*Boundary
1, 1, 2
4, 1
*Step
*Static
*Cload
5, 1, 1.
*End Step
"""


def pressed(lines, pressure=100.0):
    """Return a step of a deck that presses on the cube."""
    return f"*Step\n*Static\n{lines}*Dload\n1, P2, {pressure}\n*End Step\n"


# The cube pressed by 100, then 200; supports come and go.
COMING = (
    pressed("*Boundary\n" + HELD)
    + pressed("*Boundary, fixed\nx1, 1\n", 200.0)  # no further stretch along x
    + pressed("*Boundary\nx1, 1, 1, 0.\n", 200.0)  # back to where it was
    + pressed("*Boundary, op=new\n" + HELD, 200.0)  # let go
    + pressed("*Boundary\nx1, 1, 1, 0.0005\n", 200.0)  # and driven again
)


def supports(**held):
    """Return tables of supports, by group: the axes along which it is held, such as "xy", or its displacements by axis."""
    tables = ""
    for group, axes in held.items():
        values = dict.fromkeys(axes, 0.0) if isinstance(axes, str) else axes
        tables += f'[[support]]\ngroup = "{group}"\n' + "".join(f"{axis} = {u}\n" for axis, u in values.items())
    return tables


def contact_pair(secondary="CONT_UPPER", primary="CONT_LOWER", options="", name="pair"):
    """Return the table of a contact pair, by default of the mesh "block-on-block"."""
    return f'[contact.{name}]\nsecondary = "{secondary}"\nprimary = "{primary}"\n{options}\n'


def case_of(mesh, tables="", kinematics="plane_strain", material="E = 1000.0\nnu = 0.3", ramp="steps = 1", **held):
    """Return a case file of one material, with the keys of its mesh, further tables and `supports`."""
    return f"""
kinematics = "{kinematics}"
[mesh]
{mesh}
[[material]]
{material}
{supports(**held)}{tables}
[ramp]
{ramp}
"""


def of_block(tables, kinematics="plane_stress", material="E = 1000.0\nnu = 0.3", steps=1, **held):
    """Return a case file of the mesh ``block.med``, of one material, with groups held along axes, and further tables."""
    return case_of('file = "block.med"', tables, kinematics, material, f"steps = {steps}", **held)


def spheres(size, steps, head=""):
    """Return a case file: two half-spheres of linear triangles, pressed together by 4 mm."""
    mesh, held = 'generator = "half-spheres"\nelement = "tri3"', {"A1A2": "x", "A2B2": {"y": -2.0}, "A1B1": {"y": 2.0}}
    return f'title = "small spheres"\n{head}' + case_of(
        f"{mesh}\nsize = {size}", contact_pair("CONT1", "CONT2", name="hertz"), "axisymmetric", "E = 20000.0\nnu = 0.3",
        f"steps = {steps}", **held,
    )  # fmt: skip


UNITS = 'units = { length = "mm", force = "N", pressure = "MPa" }\n'
HERTZ = """[probes]
C1 = "C1"
[theory.hertz]
kind = "hertz_point"
E1 = 20000.0
nu1 = 0.3
R1 = 50.0
E2 = 20000.0
nu2 = 0.3
R2 = 50.0
approach = 4.0
"""
