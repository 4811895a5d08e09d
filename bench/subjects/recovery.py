"""Recovery of nodal stresses in a cube of hex8, in units of the assembly of the same mesh."""

import numpy as np

import fastcontact as fc
from fastcontact.elasticity.recovery import nodal_stress
from fastcontact.elasticity.stiffness import sparsity, stiffness

SIZES = (3_000, 30_000, 100_000)


def works(size):
    n = max(2, round((size / 3) ** (1 / 3)) - 1)
    model = fc.Model(fc.generate.box((1.0, 1.0, 1.0), (n, n, n)), kinematics="3d")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    mesh, (moduli, material), pattern = model.mesh, model.material_numbers(), sparsity(model.mesh)
    u = 1e-3 * mesh.points**2
    assert np.isfinite(u).all()
    return model.n_dofs, {
        "nodal stress": lambda: nodal_stress(mesh, "3d", moduli, material, u),
        "assembly, values": lambda: stiffness(mesh, "3d", moduli, material, pattern),
    }
