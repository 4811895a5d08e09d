"""Common behaviour of finite-element programs for each mistake.

Not every program behaves like this; each does in some cases. Where a current program was tried, this is its behaviour.
"""
# ruff: noqa: E501 (texts stay in one piece)

OTHERWISE = {
    "an error, often a traceback or long output of the file library": (
        "mesh file missing", "mesh file is a text file", "mesh file is empty", "mesh file is truncated",
        "suffix of no known format", "case file missing", "case is a folder", "result file missing", "`fastcontact profile` on a mesh file",
        "`fastcontact info` on a missing file", "export of a case file", "mesh written with an unknown suffix", "broken TOML",
        "one of several supports in single brackets", "first of several supports in single brackets",
        "contact pair in double brackets", "contact pairs in single and in double brackets",
    ),
    "no message: the comma separates two values, of which the first is used": ("decimal comma", "decimal comma in an inline table"),
    "an error that names the unknown group, without a suggestion": (
        "group of the material misspelled", "group of a support misspelled", "side of the contact misspelled",
        "probe misspelled", "pressure on an unknown group", "contact side is a point", "the file has no groups",
        "a mesh without groups",
    ),
    "no message: the value at an arbitrary point of the group is returned": ("probe is a line",),
    "thousands of messages, one for each element without material, or a singular matrix": (
        "one body without material", "material missing altogether", "no material at all", "one body without a material",
    ),
    "no message: the material is assigned to no solid, or to elements without stiffness": ("material assigned to lines",),
    "the thickness is an input of the cells": ("thickness of a plane model",),
    "no message: the last definition is used": (
        "two materials for one body", "two materials for one group", "a material for all cells, and another for a group",
        "duplicate key", "contact pair defined twice in a case", "the same pair twice", "two pairs with one name",
    ),
    "no message: the pairs share the force arbitrarily, and each reports a part of the pressure": (
        "two pairs over the same facets", "the same obstacle twice", "one surface in two groups with a contact each",
    ),
    "no message: a hole opens along the axis, or nodes pass through it": (
        "a support that moves the axis of symmetry", "a radial force on the axis of symmetry",
    ),
    "a division by zero: infinite or undefined stresses": ("nu is 0.5", "nu of 0.5 in Python"),
    "an indefinite stiffness: a failed factorisation or a meaningless solution": (
        "nu above 0.5", "nu below -1", "E is negative", "a spring with negative stiffness",
    ),
    "a singular matrix, reported as a small pivot in an equation that is given by its number": (
        "a spring as a rigid link",        "E is zero", "E of zero in Python", "no support at all", "one body free to slide", "a plate supported at one point",
        "nodes not merged, one part not held",
    ),
    "a solution of NaN values, or the value is read as zero": (
        "E is NaN", "support value is not finite", "a pressure that is NaN", "a table with NaN",
    ),
    "an exception with a traceback to code far from the mistake": (
        "E is a string", "support value is a string", "load steps as a string", "fractional number of load steps", "ramp is not a table",
        "number of threads as a word", "a function that returns the wrong shape", "coordinates in one dimension",
        "cells with a node too few", "theory lacks a radius", "an expression as a value",
        "a motion without names of axes", "hardening as a number", "shape of an obstacle is a word",
    ),
    "no message: the default is used, or nothing happens": (
        "E is missing", "kinematics missing", "pressure without value", "force without component",
        "support without component", "a support without a component", "check without tolerance", "primary side missing",
        "primary side called master",
    ),
    "the input is ignored, and the default is used": (
        "no threads",
        "friction called mu", "support called fix", "probe by coordinates",
        "key misspelled", "key of a material misspelled", "key of a support misspelled", "contact option misspelled",
        "key of the convergence criteria misspelled", "unknown normals", "option misspelled",
    ),
    "an error, with or without a list of the allowed values": (
        "unknown kinematics", "formulation misspelled", "unknown theory", "theory of an unknown contact pair",
        "theory of a missing contact pair", "check of an unknown probe", "check of an unknown quantity",
        "unknown linear solver", "unknown command", "mesh generator misspelled", "unknown parameter of a sweep",
        "an unknown linear solver",
    ),
    "an error in the assembly, or a third coordinate that is dropped silently": (
        "3D model of a plane mesh", "3D mesh for an axisymmetric model", "the file contains a 3D mesh",
        "the mesh in the file lies in the x-z plane",
        "component that a plane mesh lacks", "a support in z of a plane model",
    ),
    "the job ends successfully, with displacements of 1e10 or NaN": (
        "one body without sufficient supports", "no body with sufficient supports", "bodies connected at a single node",
    ),
    "no message: the last value is used, or both are added": ("supports contradict", "supports that contradict each other"),
    "no message: no node is ever in contact, and the bodies pass through each other": (
        "contact on an outer face", "contact on the wrong face", "an obstacle with reversed orientation",
        "contact of an empty group", "all nodes excluded",
    ),
    "an error about the type of an element": (
        "contact side is a solid", "pressure on a solid", "a pressure on points", "a body force on facets",
        "contact inside a body", "the file contains only lines", "a mesh of facets only", "3D faces without solids",
    ),
    "nodes are constrained to themselves: a singular matrix, or bodies that stick together": (
        "both sides are the same", "sides share nodes", "one group on both sides", "sides that overlap",
    ),
    "the number is used: the solution does not converge or is wrong": (
        "friction is negative", "friction that is negative", "tolerance is negative", "a penalty of zero",
        "theory with nu above 0.5", "size of a mesh is negative", "a solver tolerance that is too large", "a criterion of zero",
        "a criterion that accepts everything",
        "a negative limit of updates", "a negative number of halvings", "a negative number of updates",
        "tied contact with a penalty",
    ),
    "nothing is computed, and the job ends successfully": (
        "no load step", "negative load steps", "zero load steps", "a ramp without instants", "zero levels",
        "a ramp that ends at zero",
    ),
    "no message: the last value is kept, or the curve is extrapolated": (
        "history that ends before the analysis", "an instant beyond the table", "a history shorter than the analysis",
        "ramp runs backwards", "instants that do not ascend",
    ),
    "no message: the load or support has no effect": (
        "a force on an empty group", "a support on an empty group", "a support on a node without cells",
        "a force where the displacement is prescribed",
    ),
    "no message: forces that cancel over the circle are applied": ("a radial force in axisymmetry",),
    "the coordinate is read as 0, and the mesh has a spike": (
        "a coordinate in the file is NaN", "a coordinate in the file is infinite", "a coordinate is NaN",
        "a coordinate is infinite",
    ),
    "negative volumes: a stiffness that is too small or indefinite, often without a message": (
        "the mesh in the file lies at r < 0", "the mesh in the file is folded", "nodes at r < 0", "an inverted cell",
        "a folded cell", "a folded 3D mesh with reoriented cells", "a cell in the file is flat", "a degenerate cell",
    ),
    "no message: the body is twice as stiff there": (
        "a duplicate cell in the file", "a duplicate cell",
    ),
    "an invalid memory access: a crash, or arbitrary numbers": (
        "a cell refers to a missing point", "a group refers to a missing cell",
    ),
    "no message, or one among many: the body has a crack": (
        "nodes that were not merged", "nodes were not merged", "nodes nearly coincide",
        "a fine mesh merged with a coarse one",
    ),
    "no message: stresses are wrong near the cell": (
        "a cell with an angle near 180 degrees", "a cell with a Jacobian near zero", "a cell is poor",
        "the quadrature of the stiffness is not exact", "a load that varies within an element",
    ),
    "no message: stiffness and forces are several times too large": (
        "nearly incompressible elements lock",
    ),
    "no message: pressures are wrong from node to node": ("facets are integrated as a whole",),
    "no message: pressures follow the facets, not the curve": ("pressures that follow facets instead of arcs",),
    "no message: units are not checked, and results are wrong by a factor of a thousand or a million": (
        "E of one body in Pa, of the other in MPa", "E in Pa where MPa is named", "E in GPa where Pa is named",
        "inconsistent units", "E in Pa with a force and mm", "a pressure in Pa with E in MPa",
        "a displacement in mm of a model in m", "E is in Pa where the case names MPa",
        "the loads are in another unit than E",
    ),
    "the penetration is removed in the first step, with unrealistic stresses, or the step does not converge": (
        "a penetration larger than an element", "an obstacle deep in the body",
    ),
    "no message: the job ends successfully, although contact is open": (
        "a contact that is never reached", "contact never closes", "contact opens again",
    ),
    "no message: the bodies interpenetrate": (
        "a contact pair is missing", "bodies interpenetrate where no contact is defined",
        "bodies overlap and no contact pair is defined between them", "supports that push one side into the other",
        "a support that pushes a corner into an obstacle",
    ),
    "a singular matrix, or a body that moves away on artificial springs": ("bodies pulled apart by a force",),
    "no message: stabilising springs carry part of the load": (
        "springs that regularise rigid motions carry load",
    ),
    "the limit is reached, and the job continues or ends successfully": ("too few geometry updates are requested",),
    "no message: linear kinematics are used outside their range": (
        "strains are large", "plastic strains are large", "rotations are large",
    ),
    "no message: the pressure is dominated by discretisation errors": ("the mesh does not resolve the contact",),
    "no message: contact without a conductance insulates": ("no heat flows through a contact",),
    "no message: contact forces are too small": ("a penalty is too soft",),
    "no message: forces lose as many digits, or the matrix is singular": ("a spring that is a thousand times too stiff",),
    "no message: wear depths exceed the bodies": ("a coefficient of wear in another unit",),
    "the analysis runs to its end, but its results cannot be written": (
        "folder of the result missing", "result is a folder", "folder of the summary missing",
        "unknown image format", "report of a study into a missing folder", "the folder is write-protected",
        "the result file is write-protected", "the result file is a pipe",
    ),
    "no message: the file is overwritten": (
        "two outputs with one name", "summary that would overwrite the case file", "results that would overwrite the mesh",
        "the result file exists and is another kind of file",
    ),
    "two programs write into one file and damage it": ("another run writes the result file",),
    "the program stops with a damaged file": ("the disk is full",),
    "no message: the force is a third too small, which is visible only in pictures": (
        "a contact group lacks facets", "a contact group against an obstacle lacks facets",
        "a contact group against an obstacle lacks facets while it is pressed",
    ),
    "no message: the problem that is solved is not the intended one": (
        "friction in percent", "the initial penetration exceeds the prescribed approach",
        "a load without a ramp beside one that has one",
    ),
}  # fmt: skip
