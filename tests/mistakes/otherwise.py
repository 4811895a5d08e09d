"""What happens without our messages: what finite-element programs do with each mistake, in general words.

Not every program does all of this; each does some of it. Where a program of today was tried, that is what it did.
"""
# ruff: noqa: E501 (texts stay in one piece)

OTHERWISE = {
    "an error, often a traceback or pages of messages of the file library": (
        "mesh file missing", "mesh is a text file", "mesh file is empty", "mesh file is truncated",
        "suffix of no known format", "case file missing", "case is a folder", "result file missing", "profile of a mesh",
        "information on nothing", "export of a case file", "mesh into a suffix of no format", "broken TOML",
    ),
    "an error that names the group, but not the one that was meant": (
        "group of the material misspelled", "group of a support misspelled", "side of the contact misspelled",
        "probe misspelled", "pressure on an unknown group", "contact side is a point", "the file has no groups",
        "a mesh without groups",
    ),
    "nothing is said: the number of any one of the points comes out": ("probe is a line",),
    "thousands of lines, one for each element without material, or a singular matrix": (
        "one body without material", "material missing altogether", "no material at all", "one body without a material",
    ),
    "nothing is said: the material is given to no solid, or to elements that carry nothing": ("material on lines",),
    "nothing is said: the last one given wins": (
        "two materials for one body in a case", "two materials for one group", "a material for all hides one of a group",
        "a key twice", "one pair twice in a case", "the same pair twice", "two pairs of one name",
    ),
    "nothing is said: the pairs share the force at will, and each tells a part of the pressure": (
        "two pairs over the same facets", "the same obstacle twice", "one surface in two groups with a contact each",
    ),
    "nothing is said: a hole opens along the axis, or its nodes pass through it": (
        "a support that moves the axis of symmetry", "a radial force on the axis of symmetry",
    ),
    "a division by zero: stresses that are infinite or not a number": ("nu is a half", "nu of 0.5 in a call"),
    "a stiffness that is not positive definite: a factorisation that fails, or a solution that makes no sense": (
        "nu above a half", "nu below -1", "E is negative", "a spring that pulls backwards",
    ),
    "a singular matrix, told as a pivot near zero at an equation number": (
        "a spring as a rigid link",        "E is zero", "E of zero in a call", "no support at all", "one body free to slide", "a plate held at one point",
        "nodes not merged, one part not held",
    ),
    "a solution full of numbers that are none, or the value is read as zero": (
        "E is not a number", "support value is not finite", "a pressure that is NaN", "a table with NaN",
    ),
    "an error of the program's language, far from the line with the mistake": (
        "E is a string", "support value is a string", "load steps as a string", "broken load steps", "ramp is not a table",
        "threads in words", "a function that returns the wrong shape", "coordinates in one dimension",
        "cells with a node too few", "theory lacks a radius", "code instead of data",
    ),
    "the default is taken, or nothing is done, and nothing is said": (
        "E is missing", "kinematics missing", "pressure without value", "force without component",
        "support without component", "a support without a component", "check without tolerance", "primary side missing",
    ),
    "the word is ignored, and the default taken": (
        "key misspelled", "key of a material misspelled", "key of a support misspelled", "contact option misspelled",
        "key of the convergence criteria misspelled", "unknown normals", "option misspelled",
    ),
    "an error with a list of all known words, or of none": (
        "unknown kinematics", "formulation misspelled", "unknown theory", "theory of no contact",
        "theory of a pair that was forgotten", "check of an unknown probe", "check of an unknown quantity",
        "unknown linear solver", "unknown command", "mesh maker misspelled", "unknown parameter of a sweep",
        "a linear solver that is not there",
    ),
    "an error in the assembly, or a third coordinate that is dropped in silence": (
        "3D model of a plane mesh", "3D mesh for an axisymmetric model", "the file has a mesh in space",
        "component that a plane mesh lacks", "a support in z of a plane model",
    ),
    "the job ends with an exit code of success, and displacements of 1e10 or not a number": (
        "one body is not held", "no body is held", "bodies that hang together at one node",
    ),
    "nothing is said: the last one wins, or both are added up": ("supports contradict", "supports that contradict each other"),
    "nothing is said: no node is ever in contact, and the bodies pass through each other": (
        "contact on an outer face", "contact on the wrong face", "an obstacle that is inside out",
        "contact of an empty group", "all nodes excluded",
    ),
    "an error about the type of an element": (
        "contact side is a solid", "pressure on a solid", "a pressure on points", "a body force on facets",
        "contact inside a body", "the file has lines only", "a mesh of facets only", "faces in space for a solid",
    ),
    "nodes are tied to themselves: a singular matrix, or bodies that stick together where they should not": (
        "both sides are the same", "sides share nodes", "one group on both sides", "sides that overlap",
    ),
    "the number is taken as it is: the solution does not converge, or is wrong": (
        "friction is negative", "friction that is negative", "tolerance is negative", "a penalty of zero",
        "theory with nu above a half", "size of a mesh is negative", "a tolerance that lets anything pass", "a criterion of zero",
        "a criterion that lets anything pass",
        "a negative limit of updates", "a negative number of halvings", "a negative number of updates",
        "tied with a penalty",
    ),
    "no step is computed, and the job ends as if all were well": (
        "no load step", "negative load steps", "no load step asked for", "a ramp without instants", "no level asked for",
        "no threads", "a ramp that ends at zero",
    ),
    "the last value is kept, or the curve continued, and nothing is said": (
        "history that ends too early", "an instant beyond the table", "a history shorter than the analysis",
        "ramp runs backwards", "instants that do not ascend",
    ),
    "nothing is said: the load acts on no element, and the result is that without it": (
        "a force on an empty group", "a support on an empty group", "a support on a node of no cell",
        "a force where the displacement is prescribed",
    ),
    "nothing is said: forces that cancel over the circle are applied as if they did not": ("a radial force in axisymmetry",),
    "the coordinate is read as 0, and the job goes on with a spike in the mesh": (
        "a coordinate in the file is NaN", "a coordinate in the file is infinite", "a coordinate is NaN",
        "a coordinate is infinite",
    ),
    "negative volumes: a stiffness that is too small or not definite, often without a word": (
        "the mesh in the file lies at r < 0", "the mesh in the file is folded", "nodes at r < 0", "an inverted cell",
        "a folded cell", "a folded mesh in space whose cells were turned", "a cell in the file is flat", "a degenerate cell",
    ),
    "nothing is said: the body is twice as stiff there": (
        "a cell in the file stands there twice", "a cell stands there twice",
    ),
    "memory of others is read: a crash, or numbers from nowhere": (
        "a cell names a point that is not there", "a group names a cell that is not there",
    ),
    "nothing is said, or a line in a long list: the body has a crack": (
        "nodes that were not merged", "nodes were not merged", "nodes nearly lie where others are",
        "a fine mesh merged with a coarse one",
    ),
    "nothing is said: stresses are wrong near the cell": (
        "a cell with an angle near 180 degrees", "a cell with a Jacobian near zero", "a cell is poor",
        "the quadrature of the stiffness is not exact", "a load that varies within an element",
    ),
    "nothing is said: the model is several times too stiff, and forces are wrong by as much": (
        "nearly incompressible elements lock",
    ),
    "nothing is said: pressures follow the facets, not the curve": ("pressures that follow facets instead of arcs",),
    "nothing is said: programs know no units, and the result is off by a factor of a thousand or a million": (
        "E of one body in Pa, of the other in MPa", "E in Pa where MPa is named", "E in GPa where Pa is named",
        "units that do not fit each other", "E in Pa with a force and mm", "a pressure in Pa with E in MPa",
        "a displacement in mm of a model in m", "E is in Pa where the case names MPa",
        "the loads are in another unit than E",
    ),
    "the penetration is pushed out in the first step, with stresses far beyond reason, or the step does not converge": (
        "a penetration larger than an element", "an obstacle deep in the body",
    ),
    "nothing is said: the job ends with an exit code of success, although contact is open": (
        "a contact that is never reached", "contact is never reached", "contact is lost",
    ),
    "nothing is said: the bodies lie inside each other": (
        "a pair was forgotten", "bodies interpenetrate where no contact is defined",
        "bodies overlap and no pair joins them", "supports that push one side into the other",
        "a support that pushes a corner into an obstacle",
    ),
    "a singular matrix, or a body that flies away under springs that nobody asked for": ("bodies pulled apart by a force",),
    "nothing is said: springs that were added to make the matrix regular take part of the load": (
        "springs that regularise rigid motions carry load",
    ),
    "the limit is reached, and the job goes on or ends with an exit code of success": ("too few geometry updates were asked for",),
    "nothing is said: linear kinematics are used outside their range": (
        "strains are large", "plastic strains are large", "rotations are large",
    ),
    "nothing is said: the pressure depends on the mesh more than on the bodies": ("the mesh does not resolve the contact",),
    "nothing is said: contact forces are too small": ("a penalty is too soft",),
    "nothing is said: forces that are off by as much, or of a singular matrix": ("a spring that is a thousand times too stiff",),
    "nothing is said: depths that are larger than the bodies": ("a coefficient of wear in another unit",),
    "the analysis runs to its end, and then nothing can be written": (
        "folder of the result missing", "result is a folder", "folder of the summary missing",
        "picture of no known kind", "report of a study into a missing folder", "the folder is write-protected",
        "the result file is write-protected", "the result file is a pipe",
    ),
    "the file is overwritten, and nothing is said": (
        "two outputs of one name", "summary over the case file", "results over the mesh",
        "the result file exists and is something else",
    ),
    "two programs write into one file, which nobody can read afterwards": ("another run writes the result file",),
    "the program stops in the middle, with a damaged file": ("the disk is full",),
    "nothing is said: the force is a third too small, and pictures show it": (
        "a contact group lacks facets", "a contact group against an obstacle lacks facets",
    ),
    "nothing is said: an answer to another question than the one that was meant": (
        "friction in percent", "bodies begin deeper inside each other than they are pushed",
        "a load without a ramp beside one that has one",
    ),
}  # fmt: skip
