"""Rare mistakes in models, formulations and pictures: the call, the class of error, a pattern of the message."""
# ruff: noqa: E501 (messages stay in one piece)

import sys
from dataclasses import replace

import numpy as np
from library import Mistake, blocks, pair_of, square, with_load

import fastcontact as fc
from fastcontact.contact.configuration import Configuration
from fastcontact.linear import choice as linear
from fastcontact.mesh.generate import block, box, half_spheres
from fastcontact.results.plot.curves import stresses_on_axis


def obstacle(**options):
    square(BOTTOM="xy").add_obstacle(
        "plane", secondary="TOP", obstacle=fc.obstacles.HalfSpace((0.0, 1.0), (0.0, -1.0)), **options
    )


def round_obstacle(**options):
    model = fc.Model(half_spheres(size=20.0), "axisymmetric")
    model.add_obstacle("plane", secondary="CONT1", obstacle=fc.obstacles.HalfSpace((0.0, 0.0), (0.0, -1.0)), **options)


def spring_without_length():
    mesh = block((1.0, 1.0), (2, 2))
    points = np.vstack([mesh.points, mesh.points[:1]])
    model = fc.Model(mesh.replace(points=points).with_groups(points={"A": [0], "B": [len(points) - 1]}), "plane_strain")
    model.add_spring("A", to="B", axial=1.0)


def spring_nowhere():
    square().mesh.with_groups(points={"NONE": []})
    fc.Model(block((1.0, 1.0), (2, 2)).with_groups(points={"NONE": []}), "plane_strain").add_spring("NONE", x=1.0)


def two_lines(start=None, ends=((0, 1), (2, 3))):
    mesh = fc.Mesh([[0, 0], [1, 0], [2, 0], [3, 0], [4, 0]], {"line2": list(ends)})
    mesh = mesh.with_groups(cells={"LINE": range(len(ends))}, points={"MIDDLE": [1]})
    return fc.topology.ordered_line(mesh, "LINE", start)


def line_and_ring():
    """A line from 0 to 1 and a ring beside it: two ends, but in pieces."""
    return two_lines(ends=((0, 1), (2, 3), (3, 4), (4, 2)))


def no_lines():
    mesh = block((1.0, 1.0), (2, 2))
    return fc.topology.ordered_line(mesh, "BLOCK")


def without(patch, *modules):
    for name in modules:
        patch.setitem(sys.modules, name, None)


def picture_without_matplotlib(patch):
    from fastcontact.results.plot._axes import new_axes

    without(patch, "matplotlib", "matplotlib.figure", "matplotlib.backends.backend_agg")
    new_axes(None, (4.0, 3.0))


def view_without_pyvista(patch):
    from fastcontact.results.plot._shape import view

    without(patch, "pyvista")
    view(None, None)


def solver_without_package(patch):
    name = next(iter(linear.PACKAGES))
    patch.setattr(linear, "SOLVERS", tuple(other for other in linear.SOLVERS if other != name))
    linear.make(name, dim=2, n_dofs=10)


def formulation_without_areas():
    model = blocks()
    pair = model.bind(replace(model.contact[0], options={**model.contact[0].options, "penalty": 1.0}))
    at_rest = Configuration.undeformed(model.mesh.points)
    part = replace(pair.unilateral(at_rest), areas=None)
    pair.unilateral = lambda at: part
    pair.constraints(at_rest)


def solid_stress_on_axis():
    stresses_on_axis(box(), None, "pair")


# fmt: off
MISTAKES = [
    Mistake("a criterion that is no force", lambda: fc.Criteria(absolute=-1.0), fc.ModelError,
            r"the convergence criterion absolute = -1\.0 must be a force >= 0, or None"),
    Mistake("a penalty where constraints have no areas", formulation_without_areas, fc.ContactError,
            r"formulation 'mortar' supports no penalty: leave out the option"),
    Mistake("unknown multipliers", lambda: pair_of("CONT_UPPER", "CONT_LOWER", formulation="mortar", multipliers="dul"),
            fc.ContactError, r"unknown kind of multipliers 'dul': did you mean 'dual'\?"),
    Mistake("an augmentation of zero", lambda: pair_of("CONT_UPPER", "CONT_LOWER", formulation="mortar", augmentation=0.0),
            fc.ContactError, r"augmentation = 0\.0 must be positive; 1 suits most problems"),
    Mistake("one point per segment", lambda: pair_of("CONT_UPPER", "CONT_LOWER", formulation="mortar", n_gauss=1),
            fc.ContactError, r"n_gauss = 1 points per segment do not integrate exactly: use at least 2"),
    Mistake("a motion that is infinite", lambda: obstacle(motion={"y": np.inf}), fc.ModelError,
            r"the motion .* of obstacle 'plane' must be finite numbers"),
    Mistake("an obstacle both moved and pushed", lambda: obstacle(motion={"y": -1.0}, force={"y": -1.0}), fc.ModelError,
            r"obstacle 'plane' is both moved and pushed along y: name this component either in its motion or, unless a guide carries it, in its force"),
    Mistake("an obstacle guided along an oblique direction", lambda: obstacle(force={"y": -1.0}, axes=(1.0, 1.0)), fc.ModelError,
            r"'axes' of obstacle 'plane': obstacles are moved, pushed and guided along x or y: give 'motion' or 'force' by "
            r"components, or rotate the points of the mesh such that the guided direction is an axis"),
    Mistake("an obstacle pushed along the radius", lambda: round_obstacle(force={"x": 1.0}), fc.ModelError,
            r"a force cannot move obstacle 'plane' along the radius x: in axisymmetry give y only"),
    Mistake("standard multipliers against an obstacle", lambda: obstacle(motion={"y": -1.0}, formulation="mortar", multipliers="standard"),
            fc.ContactError, r"mortar in 2D needs multipliers='dual' at an obstacle"),
    Mistake("a clearance from an obstacle's nodes", lambda: obstacle(motion={"y": -1.0}, clearance_primary=0.1),
            fc.ContactError, r"a rigid obstacle has no 'clearance_primary': give contact 'plane' a 'clearance'"),
    Mistake("tied with friction", lambda: pair_of("CONT_UPPER", "CONT_LOWER", kind="tied", friction=0.3), fc.ContactError,
            r"contact 'pair' is tied, which excludes friction: leave out 'friction' or 'kind'"),
    Mistake("tied to an obstacle", lambda: obstacle(motion={"y": -1.0}, kind="tied"), fc.ContactError,
            r"contact 'plane' cannot be tied to a rigid obstacle: prescribe the displacements of the group, or couple them"),
    Mistake("a number as a group of nodes", lambda: pair_of("CONT_UPPER", "CONT_LOWER", excluded=3), fc.ContactError,
            r"excluded = 3 of contact 'pair' must be a group or a list of groups"),
    Mistake("a spring on an empty group", spring_nowhere, fc.ModelError, r"group 'NONE' is empty: no spring can act on it"),
    Mistake("a spring along a line of no length", spring_without_length, fc.ModelError,
            r"the spring between 'A' and 'B': points 0 and 9 coincide, so that no line connects them: give x, y or z"),
    Mistake("moduli of unknown kinematics", lambda: fc.LinearElastic(E=1.0, nu=0.3).moduli("4d"), fc.ModelError,
            r"unknown kinematics '4d': expected one of 3d, "),
    Mistake("cells of broken numbers", lambda: fc.Mesh([[0, 0], [1, 0], [0, 1]], {"tri3": [[0, 1, 1.5]]}), fc.MeshError,
            r"must be whole numbers, counted from 0, not float64 values"),
    Mistake("cells of numbers beyond 32 bits", lambda: fc.Mesh([[0, 0], [1, 0], [0, 1]], {"tri3": [[0, 1, 2**40]]}),
            fc.MeshError, r"contain the number 1099511627776: the largest possible number is 2147483647"),
    Mistake("an order of what is no line", no_lines, fc.MeshError,
            r"group 'BLOCK' contains no line cells, so its nodes have no order along a line"),
    Mistake("a line in two pieces", lambda: two_lines(), fc.MeshError,
            r"group 'LINE' is not one open line: it has 4 ends, not 2"),
    Mistake("a line with a ring beside it", line_and_ring, fc.MeshError,
            r"group 'LINE' is in pieces: only 2 of its 5 nodes are connected"),
    Mistake("a start in the middle of a line", lambda: two_lines("MIDDLE", ends=((0, 1), (1, 2))), fc.MeshError,
            r"point 1 is not an end of 'LINE': its ends are 0, 2"),
    Mistake("a picture without matplotlib", picture_without_matplotlib, fc.errors.FastcontactError,
            r"pictures need matplotlib: pip install 'fastcontact\[plot\]'"),
    Mistake("a view without PyVista", view_without_pyvista, fc.errors.FastcontactError,
            r"the interactive view needs PyVista: pip install 'fastcontact\[view\]'"),
    Mistake("a linear solver that is not installed", solver_without_package, fc.ModelError,
            r"linear solver '\w+' needs the package \w+: pip install 'fastcontact\[\w+\]'"),
    Mistake("a picture of no steps", lambda: fc.plot.contact_zones([], "pair"), fc.errors.FastcontactError,
            r"there are no steps to draw"),
    Mistake("stresses on the axis of a solid in space", solid_stress_on_axis, fc.errors.FastcontactError,
            r"stresses along the axis need a two-dimensional mesh: in three dimensions draw a section"),
    Mistake("a spring without second node", lambda: with_load("add_spring", group="UPPER_TOP_LEFT", axial=1.0), fc.ModelError,
            r"the spring on 'UPPER_TOP_LEFT' has an axial or transverse stiffness but no second node: specify it by `to`, give a"),
]
# fmt: on
