"""Preparation and linear solution of a cube of hex8 by the direct solver, pyamg and multigrid (see also bench/linear.py)."""

import numpy as np

import fastcontact as fc
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.problem import near_nullspace, prepare
from fastcontact.linear import choice as linear

SIZES = (1_500, 6_000, 20_000)


def works(size):
    n = max(2, round((size / 3) ** (1 / 3)) - 1)
    model = fc.Model(fc.generate.box((1.0, 1.0, 1.0), (n, n, n)), kinematics="3d")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    model.fix("ZMIN", "xyz")
    model.prescribe("ZMAX", x=0.0, y=0.0, z=-0.01)
    problem = prepare(model, fc.linear_ramp(), Criteria(), linear_solver="amg", linear_tolerance=1e-8)
    K, modes = problem.system.matrix.restored(), problem.system.unknowns_of(near_nullspace(model))
    lift = problem.load_at(1.0).lift
    right = problem.system.right_side(np.zeros_like(lift), lift)

    def solution(name):
        solver = linear.make(name, dim=3, n_dofs=model.n_dofs, tolerance=1e-8)
        solver.prepare(K, modes)
        return solver.load(right)

    return model.n_dofs, {
        name: lambda name=name: solved(solution(name), lift) for name in ("direct", "pyamg", "amg")
    }  # fmt: skip


def solved(loaded, lift):
    from scipy.sparse import csr_array

    return loaded.solve(csr_array((0, len(lift))), np.empty(0))
