"""Multigrid under contact: iterations, cost and residual for various meshes, contacts, friction, materials and cells.

Two non-matching blocks are pressed together and, with friction, sheared. One property is varied at a time, without and with
friction. A row gives the iterations of a linear solution of the same mesh without contact, those of a whole cold contact
step, the cost of the step in units of that linear solution (L, from assembly on, see `suite.whole`), and the largest
out-of-balance force relative to the largest nodal contact force, with a newly assembled stiffness.
"""

import numpy as np
from suite.timing import peak_bytes
from suite.whole import cold_step, in_turn, linear_solution

import fastcontact as fc
from fastcontact.elasticity.stiffness import stiffness
from fastcontact.errors import FastcontactError

# Divisions of the lower block; the upper one has four fifths.
SIZES = (20,)
MESHES = (12, 20, 28, 40)
FRICTION = 0.3
# Contact pressure over depth, in Young's moduli over the length of a cell.
PENALTY = 100.0
# Runs of which the fastest counts.
REPEATS = 2
HEAD = (
    f"{'varied':<26} {'friction':>8} {'unknowns':>8} {'closed':>9} {'slide':>5} {'linear':>6} {'step':>5} {'L':>6} "
    f"{'residual':>8}  solver"
)


def blocks(
    divisions=20, friction=0.0, multipliers="dual", curvature=0.0, ratio=1.0, nu=0.3, stretch=1.0, element="hex8", push=0.01,
    **options
):  # fmt: skip
    """Return the model.

    `ratio` is Young's modulus of the lower block, the primary side, over that of the upper one; `stretch` the length of cells
    over their width; the surface of the upper block rises with `curvature` times the square of the distance from a corner.
    Further `options` are those of the contact pair.
    """

    def block(count, z, name):
        mesh = fc.generate.box((stretch, 1.0, 0.5), (count, count, count // 2), element, (0.0, 0.0, z))
        return fc.generate.renamed(mesh, {group: name + group for group in mesh.group_names})

    upper = block(divisions * 4 // 5, 0.0, "UPPER_")
    points = np.array(upper.points)
    points[:, 2] += curvature * (points[:, 0] ** 2 + points[:, 1] ** 2)
    mesh = fc.generate.union(block(divisions, -0.5, "LOWER_"), upper.replace(points=points))
    model = fc.Model(mesh, kinematics="3d")
    model.add_material(fc.LinearElastic(E=ratio, nu=nu), groups=["LOWER_BOX"])
    model.add_material(fc.LinearElastic(E=1.0, nu=nu), groups=["UPPER_BOX"])
    model.fix("LOWER_ZMIN", "xyz")
    model.prescribe("UPPER_ZMAX", x=push if friction else 0.0, y=0.0, z=-0.01)
    options = options or {"formulation": "mortar", "multipliers": multipliers}
    model.add_contact("c", secondary="UPPER_ZMIN", primary="LOWER_ZMAX", friction=friction, **options)
    return model


def on_obstacle(divisions=20, friction=0.0, ball=False, push=0.004, **options):
    """Return a block pressed upon a rigid wall, or a rigid ball, and with friction pushed along it."""
    mesh = fc.generate.box((1.0, 1.0, 0.5), (divisions, divisions, divisions // 2), "hex8")
    model = fc.Model(mesh, kinematics="3d")
    model.add_material(fc.LinearElastic(E=1.0, nu=0.3))
    model.prescribe("ZMAX", x=push if friction else 0.0, y=0.0, z=-0.01)
    wall = fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    obstacle = fc.obstacles.Sphere((0.5, 0.5, -1.0), 1.0) if ball else wall
    model.add_obstacle("c", secondary="ZMIN", obstacle=obstacle, friction=friction, **options)
    return model


def made(given):
    """Return the model of a variation."""
    given = dict(given)
    return (on_obstacle if given.pop("obstacle", False) else blocks)(**given)


def variations(divisions):
    """Return what is varied, as text and arguments of `blocks`."""
    others = [n for n in MESHES if n != divisions] if divisions == SIZES[0] else []
    rows = [(f"mesh {divisions}", {}), *((f"mesh {n}", {"divisions": n}) for n in others)]
    rows += [(f"surface curved by {value:g}", {"curvature": value}) for value in (0.002, 0.02, 0.2, 2.0)]
    rows += [(f"modulus ratio {value:g}", {"ratio": value}) for value in (1e2, 1e4, 1e8, 1e-2, 1e-4)]
    rows += [(f"nu {value:g}", {"nu": value}) for value in (0.45, 0.49, 0.499, 0.4999)]
    rows += [(f"aspect ratio {value:g}", {"stretch": value}) for value in (5.0, 20.0, 50.0)]
    of_cells = {"tet4": divisions, "tet10": divisions // 2, "hex20": divisions * 3 // 5}
    rows += [(element, {"element": element, "divisions": n}) for element, n in of_cells.items()]
    rows += [("standard multipliers", {"multipliers": "standard"})]
    on = {"obstacle": True, "divisions": divisions * 6 // 5}
    rows += [("rigid wall", on), ("rigid ball", {**on, "ball": True})]
    rows += [("penalty", {"penalty": PENALTY}), ("continuous", {"formulation": "continuous"})]
    rows += [
        ("rigid wall, penalty", {**on, "penalty": PENALTY}),
        ("rigid wall, continuous", {**on, "formulation": "continuous"}),
    ]
    rows = [(text, {"divisions": divisions, **given, "friction": mu}) for text, given in rows for mu in (0.0, FRICTION)]
    rows[2:2] = [("friction", {"divisions": divisions, "friction": mu}) for mu in (0.1, 0.2, 0.5, 1.0)]
    return rows


def entries(smallest, tell, sizes=None):
    """Return the figures of all rows; the `smallest` run takes the first two on a coarse mesh. `tell` hears of each row.

    `sizes` are numbers of unknowns, each with a whole table; the other meshes are part of that of SIZES only.
    """
    figures(blocks(6, FRICTION))  # compiles
    found = []
    for divisions in [6] if smallest else [divisions_of(size) for size in sizes] if sizes else SIZES:
        for text, given in variations(divisions)[: 2 if smallest else None]:
            tell(f"{text}, {divisions} divisions")
            measured = figures(made(given), repeats=1 if smallest else REPEATS)
            found.append({"varied": text, "friction": given["friction"], **measured})
    return found


def divisions_of(unknowns):
    """Return the divisions, an even number, with about so many unknowns of hexahedra in both blocks."""
    return max(6, 2 * round(((unknowns / 2.3) ** (1 / 3) - 1) / 2))


def figures(model, solver="amg", repeats=1):
    """Return iterations, price and residual of a linear solution and a cold contact step by one solver."""
    works = {"linear": lambda: linear_solution(model, solver), "step": lambda: cold_step(model, solver)}
    try:
        found, seconds = in_turn(works, repeats)
    except FastcontactError as error:
        return {"n_dofs": model.n_dofs, "failed": str(error)}
    problem, state, result = found["step"]
    contact, cpu, counters = result.contact["c"], seconds["step"], problem.solver.counters
    return {
        "n_dofs": model.n_dofs, "peak_bytes": peak_bytes(),
        "linear": {"iterations": found["linear"], "cpu_s": seconds["linear"]},
        "step": {"iterations": counters.iterations, "cpu_s": cpu, "ratio": cpu / seconds["linear"]},
        "pairings": result.iterations["geometry_updates"],
        "closed": int(contact.active.sum()), "nodes": len(contact.points),
        "sliding": int((contact.active & ~contact.sticking).sum()), "residual": out_of_balance(problem, state.u, contact),
        "replacement_reason": getattr(problem.solver, "replacement_reason", ""),
    }  # fmt: skip


def out_of_balance(problem, u, contact):
    """Return the largest force that nothing balances over the largest nodal contact force."""
    model, field = problem.model, problem.field
    out = stiffness(model.mesh, model.kinematics, field.moduli, field.rows, None, field.averaged) @ u
    forces = out.reshape(-1, model.mesh.dim)
    np.subtract.at(forces, contact.points, contact.force_vectors)
    np.subtract.at(forces, contact.primary_points, contact.primary_force_vectors)
    free = ~np.isin(np.arange(len(out)), np.flatnonzero(problem.system.fixed))
    return float(np.abs(out[free]).max() / np.linalg.norm(contact.force_vectors, axis=1).max())


def lines(found):
    """Return the table."""
    table = [HEAD]
    for row in found:
        begin = f"{row['varied']:<26} {row['friction']:>8g} {row['n_dofs']:>8}"
        if "failed" in row:
            table.append(f"{begin} failed: {row['failed']}")
            continue
        step = row["step"]
        table.append(
            f"{begin} {row['closed']:>4}/{row['nodes']:<4} {row['sliding']:>5} {row['linear']['iterations']:>6} "
            f"{step['iterations']:>5} {step['ratio']:>6.1f} {row['residual']:>8.1e}  "
            f"{'factors took over' if row['replacement_reason'] else 'multigrid'}"
        )
    return table
