"""A small contact problem and its images: rotated, mirrored, translated, in other units, renumbered."""

from dataclasses import dataclass, field, replace

import numpy as np
from models import with_contact

import fastcontact as fc
from fastcontact.mesh import elements

AXES = "xyz"


@dataclass(frozen=True)
class Job:
    """A contact problem as data. Vectors have None where a component is free or, in loads, zero."""

    mesh: fc.Mesh
    kinematics: str
    contact: tuple = ()  # (secondary, primary, formulation, options), of which the options named below carry units
    obstacles: tuple = ()  # (secondary, point, normal, motion, options): half-spaces
    supports: tuple = ()  # (group, vector) [length]
    tractions: tuple = ()  # (group, vector) [pressure]
    pressures: tuple = ()  # (group, value)
    coupled: tuple = ()  # (group, axis)
    materials: tuple = ((None, 1000.0, 0.3),)  # (groups, E, nu)
    steps: int = 1
    solver: str = "direct"
    tolerance: float = 1e-12


@dataclass(frozen=True)
class Image:
    """What becomes of a job: x -> length * (Q x + shift), pressures times `pressure`, points and cells reordered."""

    Q: np.ndarray | None = None
    shift: tuple | None = None
    length: float = 1.0
    pressure: float = 1.0
    seed: int | None = None
    order: np.ndarray = field(default=None, repr=False)

    def turned(self, vectors):
        vectors = np.asarray(vectors, float)
        return vectors if self.Q is None else vectors @ self.Q.T


def _reordered(mesh, seed):
    """Points, and cells of every kind, in another order; return the old number of every new point, too."""
    random = np.random.default_rng(seed)
    order = random.permutation(mesh.n_points)
    new = np.argsort(order)
    cells, number, names = {}, np.empty(mesh.n_cells, int), list(mesh.cells)
    random.shuffle(names)
    start = 0
    for name in names:
        rows = random.permutation(len(mesh.cells[name]))
        cells[name] = new[mesh.cells[name][rows]]
        number[mesh.offsets[name] + rows] = start + np.arange(len(rows))
        start += len(rows)
    return fc.Mesh(
        mesh.points[order],
        cells,
        {name: number[members] for name, members in mesh.cell_groups.items()},
        {name: new[members] for name, members in mesh.point_groups.items()},
    ), order


def image_of(mesh, image):
    """Return the mesh of an image, and the old number of each of its points."""
    points = image.turned(mesh.points)
    if image.shift is not None:
        points = points + np.asarray(image.shift)
    cells = dict(mesh.cells)
    if image.Q is not None and np.linalg.det(image.Q) < 0:
        cells = {name: block[:, elements.get(name).reversed] for name, block in cells.items()}
    mesh = mesh.replace(points=points * image.length, cells=cells)
    return (mesh, np.arange(mesh.n_points)) if image.seed is None else _reordered(mesh, image.seed)


def _components(vector, image, unit):
    """Return the components of the image of a vector with None in it; only axes may then turn into axes."""
    if image.Q is None:
        return {AXES[k]: unit * value for k, value in enumerate(vector) if value is not None}
    if None not in vector:
        return dict(zip(AXES, unit * image.turned(vector)))
    found = {}
    for k, value in enumerate(vector):
        if value is not None:
            (onto,) = np.flatnonzero(np.abs(image.Q[:, k]) > 0.5)
            assert abs(abs(image.Q[onto, k]) - 1) < 1e-14
            found[AXES[onto]] = unit * value * image.Q[onto, k]
    return found


def _scaled(options, image):
    """Options in other units; functions of position are not used here."""
    units = {"clearance": image.length, "penalty": image.pressure / image.length}
    return {name: value * units[name] if name in units else value for name, value in options.items()}


def model_of(job, image):
    """Return the model of the image of a job, and the old number of each point."""
    mesh, order = image_of(job.mesh, image)
    model = fc.Model(mesh, job.kinematics)
    for groups, E, nu in job.materials:
        model.add_material(fc.LinearElastic(E=E * image.pressure, nu=nu), groups)
    for group, vector in job.supports:
        model.prescribe(group, **_components(vector, image, image.length))
    for group, vector in job.tractions:
        model.add_traction(group, **_components(vector, image, image.pressure))
    for group, value in job.pressures:
        model.add_pressure(group, value * image.pressure)
    for group, axis in job.coupled:
        (onto,) = _components([0.0 if AXES[k] == axis else None for k in range(mesh.dim)], image, 1.0)
        model.couple(group, onto)
    for number, (secondary, primary, formulation, options) in enumerate(job.contact):
        with_contact(model, f"pair {number}", secondary, primary, formulation=formulation, **_scaled(options, image))
    for number, (secondary, point, normal, motion, options) in enumerate(job.obstacles):
        place = image.turned(point) + (0.0 if image.shift is None else np.asarray(image.shift))
        plane = fc.obstacles.HalfSpace(tuple(place * image.length), tuple(image.turned(normal)))
        model.add_obstacle(
            f"plane {number}", secondary=secondary, obstacle=plane,
            motion=_components(motion, image, image.length), **_scaled(options, image),
        )  # fmt: skip
    return model, order


def solved(job, image):
    """Return the last step of the image of a job, and the old number of each point."""
    model, order = model_of(job, image)
    last = fc.solve(model, fc.linear_ramp(job.steps), linear_solver=job.solver, linear_tolerance=job.tolerance)[-1]
    return last, order


def _tensors(stress):
    """Stress components (n, 4 or 6) as tensors (n, 3, 3)."""
    rows, columns = ((0, 1, 2, 0), (0, 1, 2, 1)) if stress.shape[1] == 4 else ((0, 1, 2, 0, 1, 0), (0, 1, 2, 1, 2, 2))
    tensors = np.zeros((len(stress), 3, 3))
    tensors[:, rows, columns] = tensors[:, columns, rows] = stress
    return tensors


def differences(job, image, original=None):
    """Return the largest relative differences between a job and its image, by quantity; and both results.

    Sets of nodes (closed, sticking) differ by the number of nodes that are in one of them only.
    """
    one = solved(job, Image())[0] if original is None else original
    other, order = solved(job, image)
    dim, L, P = job.mesh.dim, image.length, image.pressure
    force = P * L ** (2 if job.kinematics in ("3d", "axisymmetric") else 1)
    back = np.argsort(order)
    found = {"displacement": _relative(L * image.turned(one.displacement), other.displacement[back])}
    Q = np.eye(3)
    if image.Q is not None:
        Q[:dim, :dim] = image.Q
    found["stress"] = _relative(P * (Q @ _tensors(one.stress) @ Q.T), _tensors(other.stress[back]))
    found["reaction"] = _relative(force * image.turned(one.reaction), other.reaction[back])
    for name, a in one.contact.items():
        b = other.contact[name]
        rows = np.argsort(order[b.points])[np.searchsorted(np.sort(order[b.points]), a.points)]
        size = L * np.abs(one.displacement).max()
        facing = np.isfinite(a.gap)
        found[f"{name} facing"] = float((facing != np.isfinite(b.gap[rows])).sum())
        both = facing & np.isfinite(b.gap[rows])
        found[f"{name} gap"] = np.abs(L * a.gap[both] - b.gap[rows][both]).max(initial=0.0) / size
        found[f"{name} pressure"] = _relative(P * a.pressure, b.pressure[rows])
        found[f"{name} forces"] = _relative(force * image.turned(a.force_vectors), b.force_vectors[rows])
        found[f"{name} force"] = _relative(force * image.turned(a.force), b.force)
        found[f"{name} shear"] = _relative(P * image.turned(a.shear), b.shear[rows], P * a.pressure_max)
        found[f"{name} closed"] = float((a.active != b.active[rows]).sum())
        found[f"{name} sticking"] = float((a.sticking != b.sticking[rows]).sum())
        work = force * L * np.linalg.norm(a.force) * np.abs(one.displacement).max()
        found[f"{name} dissipation"] = abs(force * L * a.dissipation - b.dissipation) / work if work else 0.0
    return found, one, other


def _relative(expected, found, size=None):
    size = np.abs(expected).max(initial=0.0) if size is None else size
    difference = np.abs(np.asarray(expected) - found).max(initial=0.0)
    return float(difference / size) if size else float(difference)


def iterations(step):
    """What the solvers counted."""
    return tuple(step.iterations[k] for k in ("geometry_updates", "active_set_iterations", "linear_iterations"))


# --- the problems ---------------------------------------------------------------------------------------------------


def discs(formulation, element="quad4", **options):
    """Two half-spheres in axisymmetry, pressed by displacements."""
    mesh = fc.generate.half_spheres(element, R=50.0, size=8.0) if element.startswith("tri") else (
        fc.generate.half_spheres(element, R=50.0, arc_sizes=(2.0, 8.0), radial_sizes=(2.0, 8.0), segments=4)
    )  # fmt: skip
    return Job(
        mesh, "axisymmetric", (("CONT1", "CONT2", formulation, options),),
        supports=(("A1A2", (0.0, None)), ("A2B2", (None, -1.0)), ("A1B1", (None, 1.0))), steps=2,
    )  # fmt: skip


def cylinder(formulation, element="quad4", **options):
    """Half a cylinder on a block in plane strain, pressed and drawn aside; all supports are whole vectors."""
    mesh = fc.generate.cylinder_on_block(element, R=50.0, size=12.0, contact_size=1.0)
    return Job(
        mesh, "plane_strain", (("CONT_CYLINDER", "CONT_BLOCK", formulation, options),),
        supports=(("BLOCK_BOTTOM", (0.0, 0.0)), ("CYLINDER_TOP", (0.8, -0.8))), steps=2,
        materials=((None, 1000.0, 0.3), (("BLOCK",), 3000.0, 0.2)),
    )  # fmt: skip


def floating(formulation, **options):
    """A block on another, held by contact and a relation only, and pressed."""
    mesh = fc.generate.block_on_block("quad4", divisions_lower=(7, 3), divisions_upper=(5, 3))
    return Job(
        mesh, "plane_strain", (("CONT_UPPER", "CONT_LOWER", formulation, options),),
        supports=(("LOWER_BOTTOM", (0.0, 0.0)), ("UPPER_TOP_LEFT", (0.0, None))),
        pressures=(("UPPER_TOP", 10.0),), coupled=(("UPPER_TOP", "y"),), steps=1,
    )  # fmt: skip


def ball(formulation, element="hex8", **options):
    """A quarter of half a sphere on a block, pressed and drawn aside; all supports are whole vectors."""
    mesh = fc.generate.sphere_on_block(
        element, R=50.0, size=25.0, contact_size=4.0, contact_radius=6.0, block_size=(30.0, 30.0), growth=1.0
    )
    return Job(
        mesh, "3d", (("CONT_SPHERE", "CONT_BLOCK", formulation, options),),
        supports=(("BLOCK_BOTTOM", (0.0, 0.0, 0.0)), ("SPHERE_TOP", (0.5, -1.2, 0.3))), steps=1,
    )  # fmt: skip


def floating_ball(formulation, **options):
    """The same, pressed by a traction on its top, which moves as one."""
    job = ball(formulation, **options)
    return replace(
        job,
        supports=(
            ("BLOCK_BOTTOM", (0.0, 0.0, 0.0)),
            ("SYMMETRY_X", (0.0, None, None)),
            ("SYMMETRY_Z", (None, None, 0.0)),
        ),
        tractions=(("SPHERE_TOP", (None, -2.0, None)),),
        coupled=(("SPHERE_TOP", "y"),),
    )


def flat_top(element, **options):
    """A block below a rigid plane: its whole top slides except for the middle, so that many nodes reach the limit."""
    return Job(
        fc.generate.block((1.4, 0.8), (4, 3), element), "plane_strain",
        obstacles=(("TOP", (0.0, 0.8), (0.0, -1.0), (0.0, -0.01), options),), supports=(("BOTTOM", (0.0, 0.0)),),
    )  # fmt: skip


def on_plane(dim, **options):
    """A cylinder or a sphere pressed on a rigid plane that moves aside."""
    if dim == 2:
        mesh = fc.generate.quarter_disc("quad4", R=50.0, arc_sizes=(2.0, 8.0), radial_sizes=(2.0, 8.0), segments=4)
        return Job(
            mesh, "plane_strain", obstacles=(("CONT1", (0.0, 0.0), (0.0, -1.0), (0.1, -1.0), options),),
            supports=(("A1B1", (0.0, 0.0)),), steps=2,
        )  # fmt: skip
    mesh = fc.generate.sphere_octant("hex8", R=50.0, size=25.0, contact_size=6.0, contact_radius=6.0, growth=1.0)
    return Job(
        mesh, "3d", obstacles=(("CONT_SPHERE", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.1, 0.8, 0.05), options),),
        supports=(("SPHERE_TOP", (0.0, 0.0, 0.0)),), steps=1,
    )  # fmt: skip
