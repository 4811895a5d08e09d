"""Assembly of a cube of hex8, values alone and with the pattern, in units of a product with the matrix."""

import numpy as np

import fastcontact as fc
from fastcontact.elasticity.stiffness import sparsity, stiffness

SIZES = (3_000, 30_000, 100_000)


def works(size):
    n = max(2, round((size / 3) ** (1 / 3)) - 1)
    model = fc.Model(fc.generate.box((1.0, 1.0, 1.0), (n, n, n)), kinematics="3d")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    moduli, material = model.material_numbers()
    pattern = sparsity(model.mesh)
    K = stiffness(model.mesh, "3d", moduli, material, pattern)
    u = np.ones(model.n_dofs)
    return model.n_dofs, {
        "values": lambda: stiffness(model.mesh, "3d", moduli, material, pattern),
        "pattern and values": lambda: stiffness(model.mesh, "3d", moduli, material),
        "product K u": lambda: K @ u,
    }
