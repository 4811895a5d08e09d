"""A cold contact step and 20 steps, in units of a linear solution L of the same mesh, solver and tolerance without contact.

A cold step starts without an earlier solution. All three include the preparation of the linear solver (hierarchy or
factors) and exclude mesh and assembly; "from_assembly" is a cold step relative to L with assembly in both. For L the
contact is removed: supports and prescribed displacements alone hold both bodies. ``sphere-on-block`` is solved by
multigrid, ``forma04c`` by the solver that "auto" selects, both node-to-segment with converged geometry. The latter is
also compared with a plain factorisation of the same matrix, by SuperLU (minimum degree of A + A.T, symmetric mode), or
by CHOLMOD if that is the solver.
"""

import time

import numpy as np
from scipy.sparse import bsr_array, csr_array
from scipy.sparse.linalg import splu
from suite.timing import peak_bytes
from suite.whole import cold_step, in_turn
from suite.whole import linear_solution as linear_solution_of

import fastcontact as fc
from fastcontact._jit import decorators as _jit
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.load_step import load_step
from fastcontact.analysis.problem import near_nullspace, prepare
from fastcontact.errors import FastcontactError, unknown
from fastcontact.linear import choice as linear

SIZES = (1_500, 10_000, 40_000)
TOLERANCE = 1e-8


def sphere_on_block(dofs):
    h = 0.06 * (114_036 / dofs) ** (1 / 3)
    for _ in range(3):
        mesh = fc.generate.sphere_on_block("hex8", R=1.0, size=h, contact_size=h / 3, contact_radius=0.2)
        if 0.9 < 3 * mesh.n_points / dofs < 1.1:
            break
        h *= (3 * mesh.n_points / dofs) ** (1 / 3)
    model = fc.Model(mesh, kinematics="3d")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    model.fix("SYMMETRY_X", "x")
    model.fix("SYMMETRY_Z", "z")
    model.fix("BLOCK_BOTTOM", "y")
    model.prescribe("SPHERE_TOP", y=-0.02)
    model.add_contact("c", secondary="CONT_SPHERE", primary="CONT_BLOCK", formulation="node_to_segment")
    return model


def forma04c(dofs):
    def mesh(scale):
        return fc.generate.half_spheres(
            "quad4", arc_sizes=(1.5 * scale, 3.0 * scale), radial_sizes=(1.5 * scale, 4.5 * scale),
            segments=max(2, round(6 / scale)),
        )  # fmt: skip

    scale = (2 * mesh(1.0).n_points / dofs) ** 0.5
    model = fc.Model(mesh(scale), kinematics="axisymmetric")
    model.add_material(fc.LinearElastic(E=20_000.0, nu=0.3))
    model.fix("A1A2", "x")
    model.prescribe("A2B2", y=-2.0)
    model.prescribe("A1B1", y=2.0)
    model.add_contact("c", secondary="CONT1", primary="CONT2", formulation="node_to_segment")
    return model


def pressed_blocks(dofs, friction=0.0, multipliers="standard"):
    """Two blocks that do not match, pressed together over the whole interface and pushed along it."""

    def block(divisions, z, name):
        mesh = fc.generate.box((1.0, 1.0, 0.5), (divisions, divisions, divisions // 2), "hex8", (0.0, 0.0, z))
        return fc.generate.renamed(mesh, {group: name + group for group in mesh.group_names})

    n = max(4, round((dofs / 2.52) ** (1 / 3)))
    model = fc.Model(fc.generate.union(block(n, -0.5, "LOWER_"), block(n * 4 // 5, 0.0, "UPPER_")), kinematics="3d")
    model.add_material(fc.LinearElastic(E=1.0, nu=0.3))
    model.fix("LOWER_ZMIN", "xyz")
    model.prescribe("UPPER_ZMAX", x=0.001 if friction else 0.0, y=0.0, z=-0.01)
    options = {"formulation": "mortar", "multipliers": multipliers, "friction": friction}
    model.add_contact("c", secondary="UPPER_ZMIN", primary="LOWER_ZMAX", **options)
    return model


def pushed_blocks(dofs):
    return pressed_blocks(dofs, friction=0.3)


PROBLEMS = {
    "sphere-on-block": (sphere_on_block, "amg"),
    "forma04c": (forma04c, "auto"),
    "pressed-blocks": (pressed_blocks, "amg"),
    "pushed-blocks": (pushed_blocks, "amg"),
}


def matrix_of(problem):
    """Return the matrix of a problem, also where its solver has taken that over."""
    matrix = problem.system.matrix
    return matrix if isinstance(matrix, bsr_array) else matrix.restored()


def prepared(problem, solver, matrix):
    modes = problem.system.unknowns_of(near_nullspace(problem.model))
    release = matrix is not problem.system.matrix
    solver.prepare(matrix, modes, problem.system.involved_unknowns(problem.contact_dofs), release)
    return solver


def fresh(problem, name):
    tolerance = problem.criteria.geometry
    return linear.make(name, dim=problem.model.mesh.dim, n_dofs=problem.model.n_dofs, tolerance=tolerance)


def started(model, name, count, tolerance=TOLERANCE):
    criteria = Criteria(geometry=tolerance)
    return prepare(model, fc.linear_ramp(count), criteria, linear_solver=name, linear_tolerance=tolerance)


def linear_solution(problem, solver):
    lift = problem.load_at(1.0).lift
    loaded = solver.load(problem.system.right_side(np.zeros_like(lift), lift))
    before = solver.counters.iterations
    loaded.solve(csr_array((0, len(lift))), np.empty(0))
    return solver.counters.iterations - before


def cpu(work):
    before = time.process_time()
    result = work()
    return result, time.process_time() - before


def steps(problem):
    state = problem.initial_state()
    for index, instant in enumerate(problem.ramp.instants, start=1):
        state, _ = load_step(problem, state, index, instant)


def detailed(problem, dofs, solver=None, tolerance=TOLERANCE):
    """Return the figures of one problem, warm: a small one runs first and compiles."""
    if problem not in PROBLEMS:
        raise FastcontactError(unknown("problem", problem, list(PROBLEMS)))
    make, name = PROBLEMS[problem]
    name = solver or name
    figures(make(min(dofs, 1_500)), name, tolerance)
    model = make(dofs)
    found = {**figures(model, name, tolerance), "from_assembly": from_assembly(model, name, tolerance)}
    return {"problem": problem, **found, "peak_bytes": peak_bytes(), "threads": _jit.threads()}


def measured_linear(problem, name):
    """Return iterations and the CPU seconds of preparation and solution; its solver is gone afterwards."""
    matrix = matrix_of(problem)
    solver, setup = cpu(lambda: prepared(problem, fresh(problem, name), matrix))
    iterations, solution = cpu(lambda: linear_solution(problem, solver))
    return iterations, setup, solution


def figures(model, name, tolerance):
    problem = started(model, name, 1, tolerance)
    iterations, setup, solution = measured_linear(problem, name)
    L = setup + solution
    _, cold = cpu(lambda: steps(problem))
    del problem
    problem = started(model, name, 20, tolerance)
    counters = problem.solver.counters
    before = counters.iterations
    _, twenty = cpu(lambda: steps(problem))
    return {
        "n_dofs": model.n_dofs,
        **against_factorisation(problem, setup + cold, setup + twenty),
        "linear": {"cpu_s": L, "iterations": iterations, "setup_cpu_s": setup},
        "cold_step": {"cpu_s": setup + cold, "ratio_to_linear": (setup + cold) / L},
        "twenty_steps": {
            "cpu_s": setup + twenty, "ratio_to_linear": (setup + twenty) / L, "setups": counters.setups,
            "linear_iterations": counters.iterations - before,
        },
    }  # fmt: skip


def from_assembly(model, name, tolerance):
    """Return a linear solution and a cold step, both from assembly on, the least CPU seconds of two each."""
    given = {"geometry": tolerance, "linear": tolerance}
    works = {
        "linear": lambda: linear_solution_of(model, name, **given),
        "step": lambda: cold_step(model, name, **given) and None,
    }
    seconds = in_turn(works, 2)[1]
    ratio = seconds["step"] / seconds["linear"]
    return {"linear_cpu_s": seconds["linear"], "cold_step_cpu_s": seconds["step"], "ratio_to_linear": ratio}


def against_factorisation(problem, cold, twenty):
    """Return what one factorisation takes, in two dimensions, and both times in units of it."""
    if problem.model.mesh.dim != 2:
        return {}
    name, factorise = ("cholmod", by_cholmod) if problem.solver.name == "cholmod" else ("superlu", by_superlu)
    one = factorise(matrix_of(problem).tocsc())
    return {name: {"cpu_s": one, "cold_step": cold / one, "twenty_steps": twenty / one}}


def by_superlu(matrix):
    options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    return cpu(lambda: splu(matrix, **options))[1]


def by_cholmod(matrix):
    """Order and factors in CHOLMOD's own order, without turning SciPy's matrix into one of its own."""
    from kvxopt import cholmod

    from fastcontact.linear.solvers.cholmod import lower_triangle

    A = lower_triangle(matrix)

    def factors():
        factor = cholmod.symbolic(A)
        cholmod.numeric(A, factor)

    return cpu(factors)[1]


def works(size):
    model = sphere_on_block(size)
    idle = started(model, "amg", 1)
    return model.n_dofs, {
        "cold step, whole": lambda: steps(started(model, "amg", 1)),
        "20 steps, whole": lambda: steps(started(model, "amg", 20)),
        "linear": lambda: linear_solution(idle, prepared(idle, fresh(idle, "amg"), matrix_of(idle))),
    }
