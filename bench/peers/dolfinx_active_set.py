"""dolfinx and PETSc with a primal-dual active set: ``python3 dolfinx_active_set.py PROBLEM.npz STEPS ANSWER.json``.

Problems ``octant`` and ``half``: one body on the rigid plane y = 0. K is assembled once, and GAMG is set up once for K
without contact. A projection fixes `y` of the nodes in contact: conjugate gradients run on the other unknowns only, with the
operator P K P and the preconditioner P M P, so that no matrix is copied or changed. Solutions become more accurate as the
active set converges (Hintermueller, Ito and Kunisch, 2002).
"""

import json
import sys

import dolfinx
import numpy as np
import ufl
from dolfinx import fem, la, mesh
from dolfinx.fem import petsc
from mpi4py import MPI
from petsc4py import PETSc

TOLERANCE = 1e-8  # of the residual, in that of the unloaded body
FIRST, FACTOR = 1e-3, 0.1  # residual of the first solution, and what each change of the active set makes of it
COMPILER = {"cffi_extra_compile_args": ["-O3", "-march=native"]}
# dolfinx numbers the nodes of cells as tensor products.
ORDER = {4: [0, 1, 3, 2], 8: [0, 1, 3, 2, 4, 5, 7, 6]}


def space(given):
    """Return the vector space, the node of each point, and the coordinates by node."""
    points, cells = given["points"], given["cells"].astype(np.int64)
    shape = "hexahedron" if cells.shape[1] == 8 else "quadrilateral"
    domain = ufl.Mesh(ufl.VectorElement("Lagrange", shape, 1))
    domain = mesh.create_mesh(MPI.COMM_SELF, cells[:, ORDER[cells.shape[1]]], points, domain)
    V = fem.VectorFunctionSpace(domain, ("Lagrange", 1))
    nodes = np.empty(len(points), int)
    geometry = domain.geometry
    nodes[np.asarray(geometry.input_global_indices)[geometry.dofmap.array]] = V.dofmap.list.array
    places = np.empty_like(points)
    places[nodes] = points
    return V, nodes, places


def stiffness(V, given):
    """Assemble K, in axisymmetry over the full circle."""
    u, v, x = ufl.TrialFunction(V), ufl.TestFunction(V), ufl.SpatialCoordinate(V.mesh)
    E, nu = float(given["E"]), float(given["nu"])
    mu, lam = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))

    def strain(w):
        return ufl.sym(ufl.grad(w))

    dx = ufl.dx(metadata={"quadrature_degree": 2})  # 2 points in each direction
    if given["points"].shape[1] == 3:
        form = (2 * mu * ufl.inner(strain(u), strain(v)) + lam * ufl.div(u) * ufl.div(v)) * dx
    else:
        hoop_u, hoop_v = u[0] / x[0], v[0] / x[0]
        shear = 2 * mu * (ufl.inner(strain(u), strain(v)) + hoop_u * hoop_v)
        volume = lam * (ufl.div(u) + hoop_u) * (ufl.div(v) + hoop_v)
        form = 2 * np.pi * x[0] * (shear + volume) * dx
    K = petsc.assemble_matrix(fem.form(form, jit_params=COMPILER))
    K.assemble()
    K.setOption(PETSc.Mat.Option.SPD, True)
    return K


def rigid_motions(V, places, axisymmetric):
    """Return orthonormal rigid-body motions for GAMG."""
    n, dim = places.shape
    x = places - places.mean(axis=0)
    modes = []
    for i in range(dim):
        modes.append(np.zeros((n, dim)))
        modes[-1][:, i] = 1.0
    for i, j in [(0, 1), (1, 2), (2, 0)][: 3 if dim == 3 else 1]:
        modes.append(np.zeros((n, dim)))
        modes[-1][:, i], modes[-1][:, j] = -x[:, j], x[:, i]
    basis, _ = np.linalg.qr(np.array(modes).reshape(len(modes), -1).T)
    vectors = []
    for column in basis.T:
        vectors.append(la.create_petsc_vector(V.dofmap.index_map, dim))
        vectors[-1].array[:] = column
    return PETSc.NullSpace().create(vectors=vectors, comm=MPI.COMM_SELF)


class Projected:
    """Operator and preconditioner on the unknowns that contact does not hold."""

    def __init__(self, K):
        self.K, self.held = K, np.empty(0, int)
        self.gamg = PETSc.PC().create(MPI.COMM_SELF)
        self.gamg.setOperators(K)
        self.gamg.setType("gamg")
        self.gamg.setFromOptions()  # PETSc's own choice, the best of nine tried
        self.gamg.setUp()

    def mult(self, _, x, y):
        self.K.mult(x, y)
        y.array[self.held] = 0.0

    def apply(self, _, x, y):
        self.gamg.apply(x, y)
        y.array[self.held] = 0.0

    def solver(self):
        A = PETSc.Mat().createPython(self.K.getSizes(), self, comm=MPI.COMM_SELF)
        A.setUp()
        ksp = PETSc.KSP().create(MPI.COMM_SELF)
        ksp.setOperators(A)
        ksp.setType("cg")
        ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        ksp.pc.setType("python")
        ksp.pc.setPythonContext(self)
        return ksp


class Contact:
    """Candidates: the `y` components of the nodes that may touch the plane, and their gaps at rest."""

    def __init__(self, given, nodes, dim):
        points = np.unique(given["facets_CONT_SPHERE" if dim == 3 else "facets_CONT2"])
        self.dofs, self.gap0 = dim * nodes[points] + 1, given["points"][points, 1]
        self.active = self.gap0 < 0.0


def solve_step(projected, ksp, contact, u, b):
    """Solve for the state with right side `b`, from `u`; return the contact forces and the iterations."""
    r, du = b.duplicate(), b.duplicate()
    tolerance, unit, iterations = FIRST, b.norm(), 0
    while True:
        projected.held = contact.dofs[contact.active]
        u.array[projected.held] = -contact.gap0[contact.active]
        projected.K.mult(u, r)
        r.aypx(-1.0, b)
        r.array[projected.held] = 0.0
        ksp.setTolerances(rtol=1e-50, atol=tolerance * unit, max_it=1000)
        ksp.solve(r, du)
        if ksp.reason < 0:
            raise RuntimeError(f"conjugate gradients ended with reason {ksp.reason}")
        iterations += ksp.its
        u.axpy(1.0, du)
        projected.K.mult(u, r)
        force = (r.array - b.array)[contact.dofs]
        gap = contact.gap0 + u.array[contact.dofs]
        active = np.where(contact.active, force > 0, gap < 0)
        changed = (active != contact.active).any()
        if not changed and tolerance <= TOLERANCE:
            return np.where(active, force, 0.0), iterations
        contact.active = active
        tolerance = TOLERANCE if not changed else max(TOLERANCE, FACTOR * tolerance)


def main(problem, steps, answer):
    given, steps = np.load(problem), int(steps)
    dim = given["points"].shape[1]
    V, nodes, places = space(given)
    K = stiffness(V, given)
    if dim == 3:
        fixed = [dim * nodes[given["nodes_SYMMETRY_X"]], dim * nodes[given["nodes_SYMMETRY_Z"]] + 2]
    else:
        fixed = [dim * nodes[given["nodes_A1A2"]]]
    driven = dim * nodes[given["nodes_SPHERE_TOP" if dim == 3 else "nodes_A2B2"]] + 1
    # Right side of the whole approach; those of the steps are parts of it.
    whole, load = K.createVecRight(), K.createVecLeft()
    whole.array[driven] = -float(given["approach"])
    K.zeroRowsColumns(np.concatenate([*fixed, driven]).astype(np.int32), 1.0, whole, load)
    K.setNearNullSpace(rigid_motions(V, places, dim == 2))
    contact = Contact(given, nodes, dim)
    projected = Projected(K)
    ksp = projected.solver()
    u, before, b = K.createVecRight(), K.createVecRight(), load.duplicate()
    iterations = []
    for step in range(1, steps + 1):
        factor = step / steps
        load.copy(b)
        b.scale(factor)
        if step == 1:
            # All that a rigid motion would push half-way in.
            contact.active = contact.gap0 < 0.5 * factor * float(given["approach"])
        else:
            last = u.array.copy()
            u.array[:] = 2 * last - before.array if step > 2 else 2 * last
            before.array[:] = last
        u.array[driven] = factor * whole.array[driven]
        force, count = solve_step(projected, ksp, contact, u, b)
        iterations.append(count)
    pole = dim * nodes[int(given["POLE"])] + 1
    pressure = float(force[contact.dofs == pole][0] / area(given))
    found = {
        "version": f"dolfinx {dolfinx.__version__}, PETSc {'.'.join(map(str, PETSc.Sys.getVersion()))}",
        "contact": "node on rigid plane",
        "force": float(force.sum()),
        "pressure": pressure,
        "iterations": sum(iterations),
    }
    with open(answer, "w") as out:
        json.dump(found, out)


def area(given):
    """Return the area that belongs to the pole: the integral of its shape function over the contact surface."""
    pole, points = int(given["POLE"]), given["points"]
    if points.shape[1] == 2:
        facets = given["facets_CONT2"]
        other = points[facets[(facets == pole).any(axis=1)][0]]
        length, radius = np.linalg.norm(other[1] - other[0]), other[:, 0].max()
        return 2 * np.pi * length * radius / 6  # linear from the axis: integral of r (1 - r / radius)
    facets = given["facets_CONT_SPHERE"]
    (corners,) = points[facets[(facets == pole).any(axis=1)]]
    return 0.125 * np.linalg.norm(np.cross(corners[2] - corners[0], corners[3] - corners[1]))


if __name__ == "__main__":
    main(*sys.argv[1:])
