"""GetFEM: ``python3 getfem_bricks.py PROBLEM.npz STEPS ANSWER.json [rest|deformed]``.

Problem ``forma04``: a mesh for each body, axisymmetric elasticity in the assembly language (no brick offers it), contact by
Lagrange multipliers in augmented form. ``rest`` is the cheapest contact brick, with the undeformed geometry, whose force is
2 % too low; ``deformed`` follows the deformation, like the other programs. Newton's method starts each step from the last
one; MUMPS factorises every tangent.
"""

import json
import subprocess
import sys

import getfem
import numpy as np

CONTACT, PUSHED, AXIS = 1, 2, 3
WORK = (
    "2*pi*X(1)*(2*mu*(Sym(Grad_{u}):Grad_Test_{u} + {u}(1)*Test_{u}(1)/sqr(X(1)))"
    " + lame*(Trace(Grad_{u}) + {u}(1)/X(1))*(Trace(Grad_Test_{u}) + Test_{u}(1)/X(1)))"
)
NORMAL = "Transformed_unit_vector(Grad_lower, Normal)"
TOLERANCE = 1e-8


def body(given, upper):
    """Return the mesh of a body with its regions; one mesh for both would merge the two poles."""
    cells, points = given["cells"][given["upper"] == upper], given["points"]
    mesh = getfem.Mesh("empty", 2)
    # Nodes of cells in the order of tensor products, all cells at once.
    mesh.add_convex(getfem.GeoTrans("GT_QK(2,1)"), points[cells[:, [0, 1, 3, 2]]].transpose(2, 1, 0))
    of_body = np.unique(cells)
    for number, group in (
        (CONTACT, given["facets_CONT2" if upper else "facets_CONT1"]),
        (PUSHED, given["nodes_A2B2" if upper else "nodes_A1B1"]),
        (AXIS, given["nodes_A1A2"]),
    ):
        members = np.intersect1d(group, of_body)
        mesh.set_region(number, mesh.faces_from_pid(mesh.pid_from_coords(points[members].T)))
    return mesh


def model_of(given):
    """Return the model, and of both bodies mesh, finite elements and integration."""
    E, nu = float(given["E"]), float(given["nu"])
    model, fields = getfem.Model("real"), {}
    model.add_initialized_data("mu", E / (2 * (1 + nu)))
    model.add_initialized_data("lame", E * nu / ((1 + nu) * (1 - 2 * nu)))
    for name, upper in (("lower", False), ("upper", True)):
        mesh = body(given, upper)
        field = getfem.MeshFem(mesh, 2)
        field.set_fem(getfem.Fem("FEM_QK(2,1)"))
        points = getfem.MeshIm(mesh, getfem.Integ("IM_GAUSS_PARALLELEPIPED(2,3)"))  # 2 x 2
        model.add_fem_variable(name, field)
        model.add_linear_term(points, WORK.format(u=name))
        model.add_initialized_data(f"{name}_y", [0.0])
        for region, data in ((AXIS, None), (PUSHED, f"{name}_y")):
            more = [data] if data else []
            model.add_normal_Dirichlet_condition_with_multipliers(points, name, 1, region, *more)
        fields[name] = mesh, field, points  # a mesh that nobody keeps is gone
    return model, fields


def at_rest(model, fields, given):
    """Add contact between the surfaces as they are at rest, node by node; return a function that gives its force."""
    model.add_nodal_contact_between_nonmatching_meshes_brick(
        fields["lower"][2], fields["upper"][2], "lower", "upper", "force", "augmentation", CONTACT, CONTACT
    )
    return lambda: float(np.abs(model.variable("force")).sum())


def deformed(model, fields, given):
    """Add contact between the deformed surfaces, in integral form; return a function that gives its force.

    GetFEM's own brick for this knows no axisymmetry; these are its terms with the weight 2 pi r.
    """
    mesh, _, points = fields["lower"]
    pressure = getfem.MeshFem(mesh, 1)
    pressure.set_fem(getfem.Fem("FEM_QK(2,1)"))
    model.add_filtered_fem_variable("pressure", pressure, CONTACT)
    model.add_raytracing_transformation("ray", 0.1 * float(given["R"]))
    model.add_slave_contact_boundary_to_raytracing_transformation("ray", mesh, "lower", CONTACT)
    model.add_master_contact_boundary_to_raytracing_transformation("ray", fields["upper"][0], "upper", CONTACT)
    gap = f"((Interpolate(X,ray) + Interpolate(upper,ray) - X - lower).{NORMAL})"
    work = f"pressure*((Test_lower - Interpolate(Test_upper,ray)).{NORMAL})"
    wanted = f"pos_part(pressure - augmentation*{gap})"
    model.add_nonlinear_term(points, f"Interpolate_filter(ray, 2*pi*X(1)*{work}, 1)", CONTACT)
    model.add_nonlinear_term(
        points, "-2*pi*X(1)*pressure*Test_pressure/augmentation + "
        f"Interpolate_filter(ray, 2*pi*X(1)*{wanted}*Test_pressure/augmentation, 1)", CONTACT,
    )  # fmt: skip
    total = f"2*pi*X(1)*pressure*{NORMAL}(2)"
    return lambda: float(getfem.asm_generic(points, 0, total, CONTACT, model))


CONTACTS = {
    "rest": (at_rest, "nodal multipliers, geometry at rest"),
    "deformed": (deformed, "multiplier field, deformed geometry"),
}


def main(problem, steps, answer, geometry="rest"):
    getfem.util_trace_level(1)
    given, steps = np.load(problem), int(steps)
    model, fields = model_of(given)
    model.add_initialized_data("augmentation", float(given["E"]))
    add, described = CONTACTS[geometry]
    force = add(model, fields, given)
    iterations = []
    for step in range(1, steps + 1):
        # Along the outward normals of the flat edges: both bodies go inward.
        for name in fields:
            model.set_variable(f"{name}_y", [-0.5 * float(given["approach"]) * step / steps])
        count, converged = model.solve(
            "max_res", TOLERANCE, "max_iter", 100, "lsolver", "mumps", "lsearch", "simplest"
        )  # fmt: skip
        if not converged:
            raise SystemExit(f"step {step} did not converge in {count} iterations")
        iterations.append(int(count))
    found = {
        "version": version(),
        "contact": described,
        "force": force(),
        "stress": stress(model, fields, given),
        "iterations": sum(iterations),
    }
    with open(answer, "w") as out:
        json.dump(found, out)


def version():
    """GetFEM does not tell its version; the package does."""
    told = subprocess.run(["dpkg-query", "-W", "-f", "${Version}", "python3-getfem"], capture_output=True, text=True)
    return told.stdout or "unknown"


def stress(model, fields, given):
    """Return the stress yy of the lower body at its pole, projected on the nodes."""
    mesh, _, points = fields["lower"]
    nodal = getfem.MeshFem(mesh, 1)
    nodal.set_fem(getfem.Fem("FEM_QK_DISCONTINUOUS(2,1)"))
    expression = "2*mu*Grad_lower(2,2) + lame*(Trace(Grad_lower) + lower(1)/X(1))"
    values = model.local_projection(points, expression, nodal)
    place = given["points"][int(given["POLE"])]
    at = np.abs(nodal.basic_dof_nodes() - place[:, None]).max(axis=0)
    return float(values[np.argmin(at)])


if __name__ == "__main__":
    main(*sys.argv[1:])
