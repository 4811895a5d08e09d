"""Arguments that cannot be: by class of error, the call and a pattern of its message, which names the mistake, too."""
# ruff: noqa: E501 (messages stay in one piece)

import dataclasses

import numpy as np
from library import square
from models import elastic_model, made_of

import fastcontact as fc

WOOD = {"E": (10_800.0, 700.0, 430.0), "nu": (0.45, 0.51, 0.54), "G": (620.0, 580.0, 26.0)}
BY_CELL = fc.Orthotropic(E=(3.0, 2.0, 1.0), nu=(0.3,) * 3, G=(1.0,) * 3, axes=np.stack([np.eye(3)] * 4))
SIDES = {"name": "h", "secondary": "TOP", "primary": "BOTTOM"}


def wood(**changes):
    return fc.Orthotropic(**{**WOOD, **changes})


def ring():
    return elastic_model(fc.generate.block((2.0, 3.0), (8, 3)), "axisymmetric")


def pressed():
    """The contact of a square pressed by a sphere."""
    model = square(BOTTOM="xy")
    model.add_obstacle("ball", secondary="TOP", obstacle=fc.obstacles.Sphere((0.5, 3.0), 2.0), motion={"y": -0.01})
    return fc.solve(model, 1)[0].contact["ball"]


def turning(centre):
    floor = fc.obstacles.HalfSpace((0.0, -1.0), (0.0, 1.0))
    square().add_obstacle("o", secondary="BOTTOM", obstacle=floor, rotation={"angle": 0.1, "centre": centre})


def of_ones(kind):
    """Return an object of a data class whose fields are all 1."""
    needed = (f for f in dataclasses.fields(kind) if f.default is f.default_factory is dataclasses.MISSING)
    return kind(**{entry.name: 1.0 for entry in needed})


# fmt: off
REFUSED = {
    fc.MeshError: [
        (lambda: fc.generate.block((1.0, 0.0)), r"size\[1\] = 0"),
        (lambda: fc.generate.block((1.0,)), "size of block must be two numbers"),
        (lambda: fc.generate.block(divisions=(0, 2)), r"divisions\[0\] = 0"),
        (lambda: fc.generate.block(distortion=0.5), "distortion = 0.5 .* between 0 and 0.24"),
        (lambda: fc.generate.block(element="quad44"), "did you mean 'quad4'"),
        (lambda: fc.generate.block(origin=(np.inf, 0.0)), r"origin\[0\] must be a finite number"),
        (lambda: fc.generate.block_on_block(shift=10.0), "shift = 10"),
        (lambda: fc.generate.block_on_block(size_lower=(1.0, -1.0)), r"size_lower\[1\] = -1"),
        (lambda: fc.generate.cylinder_on_block(size=40.0), "size = 40 .* at most R/2 = 25"),
        (lambda: fc.generate.cylinder_on_block(size=2.0, contact_size=3.0), "contact_size = 3"),
        (lambda: fc.generate.cylinder_on_block(block_size=(1.0, 0.0)), r"block_size\[1\] = 0"),
        (lambda: fc.generate.box(element="hex9"), r"'hex9'.*'hex8'"),
        (lambda: fc.generate.box(element="quad4"), r"unknown element 'quad4'"),
        (lambda: fc.generate.box(size=(1.0, -1.0, 1.0)), r"size\[1\] = -1"),
        (lambda: fc.generate.box(divisions=(1, 2)), r"divisions of box must be three numbers"),
        (lambda: fc.generate.box(divisions=(1, 2, 0)), r"divisions\[2\] = 0"),
        (lambda: fc.generate.box(origin=(0.0, float("nan"), 0.0)), r"origin\[1\]"),
        (lambda: fc.generate.crowned_blocks("tri3"), "element 'tri3'"),
        (lambda: fc.generate.crowned_blocks(R=10.0, extent=40.0), "at most R = 10"),
        (lambda: fc.generate.crowned_blocks(growth=1.0), "growth = 1 is out of range"),
        (lambda: fc.generate.crowned_blocks(contact_size=2.0), "contact_size = 2"),
        (lambda: fc.generate.punched_block("tri3"), "element 'tri3'"),
        (lambda: fc.generate.punched_block(extent=1.5), "at least 2 punch_radius = 2"),
        (lambda: fc.generate.punched_block(growth=0.5), "growth = 0.5 is out of range"),
        (lambda: fc.generate.punched_block(edge_size=3.0), "edge_size = 3"),
        (lambda: fc.generate.rings(inner_radius=60.0), "must increase, not 60, 50, 100"),
        (lambda: fc.generate.rings(divisions_inner=(0, 3)), r"divisions_inner\[0\] = 0"),
        (lambda: fc.generate.rings("hex8"), "element 'hex8'"),
        (lambda: fc.generate.sphere_on_block("quad4"), "unknown element 'quad4'"),
        (lambda: fc.generate.sphere_on_block("pyramid5"), "unknown element 'pyramid5'"),
        (lambda: fc.generate.sphere_on_block(R=-1.0), "R = -1 is out of range"),
        (lambda: fc.generate.sphere_on_block(size=60.0), "size = 60 is out of range"),
        (lambda: fc.generate.sphere_on_block(contact_size=20.0), r"contact_size = 20 .* size = 12.5"),
        (lambda: fc.generate.sphere_on_block(contact_radius=30.0), "contact_radius = 30 is out of range"),
        (lambda: fc.generate.sphere_on_block(block_size=(1.0, 2.0, 3.0)), "block_size of sphere_on_block must be two numbers"),
        (lambda: fc.generate.sphere_on_block(block_size=(1.0, 0.0)), r"block_size\[1\] = 0 is out of range"),
        (lambda: fc.generate.graded_block(element="line2"), "element"),
        (lambda: fc.generate.graded_block(width=0.0), "width = 0"),
        (lambda: fc.generate.graded_block(depth=-1.0), "depth = -1"),
        (lambda: fc.generate.graded_block(contact_radius=11.0), "contact_radius = 11 .* at most width = 10"),
        (lambda: fc.generate.graded_block(contact_size=3.0), "contact_size = 3 .* at most size = 2.5"),
        (lambda: fc.generate.graded_block(size=11.0), "size = 11"),
        (lambda: fc.generate.graded_block(growth=2.0), "growth = 2"),
        (lambda: fc.generate.graded_block(contact_radius_y=1.0), "contact_radius_y = 1.0 has no effect on quad4"),
        (lambda: fc.generate.graded_block(element="hex8", contact_radius_y=20.0), "contact_radius_y = 20"),
        (lambda: fc.generate.half_spheres(element="tri5"), "element 'tri5': did you mean .*tri3"),
        (lambda: fc.generate.quarter_disc(body="uper"), "did you mean 'upper'"),
        (lambda: fc.generate.half_spheres(R=0.0), "R = 0 .*greater than 0"),
        (lambda: fc.generate.half_spheres(R=np.nan), "R must be a finite number"),
        (lambda: fc.generate.half_spheres(R="wide"), "R of half_spheres must be a number, .* 'wide'"),
        (lambda: fc.generate.half_spheres(size=-1.0), "size = -1 .*greater than 0"),
        (lambda: fc.generate.half_spheres(size=51.0), "size = 51 .*at most R = 50"),
        (lambda: fc.generate.half_spheres(size=2.0, contact_size=3.0), "contact_size = 3 .*at most size = 2"),
        (lambda: fc.generate.half_spheres(contact_radius=3.0), "contact_radius .*uniform"),
        (lambda: fc.generate.half_spheres(contact_size=1.0, contact_radius=40.0), "contact_radius = 40 .*between 0 and 25"),
        (lambda: fc.generate.half_spheres(segments=3), "segments = 3 .*tri3"),
        (lambda: fc.generate.half_spheres(element="quad4", size=2.0), "size = 2.0 has no effect on quad4"),
        (lambda: fc.generate.half_spheres(element="quad4", segments=0), "segments = 0 .*at least 1"),
        (lambda: fc.generate.half_spheres(element="quad4", segments=2.5), r"segments = 2\.5 .*whole"),
        (lambda: fc.generate.half_spheres(element="quad4", arc_sizes=0.2), "arc_sizes .*two numbers"),
        (lambda: fc.generate.half_spheres(element="quad4", arc_sizes=(0.2, 0.0)), r"arc_sizes\[1\] = 0"),
        (lambda: fc.generate.half_spheres(element="quad4", radial_sizes=(30.0, 1.0)), r"radial_sizes\[0\] = 30 .*at most 25"),
        (lambda: fc.generate.mirrored(fc.generate.block(), "z"), "axis"),
        (lambda: fc.generate.transformed(fc.generate.block(), scale=-1.0), "scale = -1"),
        (lambda: fc.generate.transformed(fc.generate.block(), translate=(1.0,)), "translate must be 2 numbers"),
        (lambda: fc.generate.union(), "at least one mesh"),
        (lambda: fc.generate.union(fc.generate.block(), fc.Mesh([[0, 0, 0.0]], {})), "one dimension"),
        (lambda: fc.generate.merge_points(fc.generate.block(), 0.6), "shortest edge"),
        (lambda: fc.generate.transformed(fc.Mesh([[0, 0, 0.0]], {}), rotate=3.0), r"mesh\.replace\(points="),
        (lambda: fc.from_meshio("bolt.msh"), "from_meshio takes a meshio.Mesh, not str"),
        (lambda: fc.from_pyvista("bolt.msh"), "from_pyvista takes a pyvista.UnstructuredGrid, not str"),
        (lambda: fc.generate.Forest(fc.generate.block((1.0, 1.0), (2, 2), "quad8")), "quad8 cannot be refined locally: use `linearised`"),
        (lambda: square().fix("NOWHERE", "x", axes=(1.0, 1.0)), "unknown group 'NOWHERE'"),
        (lambda: fc.generate.block({"on": np.True_, "x": np.float64(1.5)}), r"the dict {'on': True, 'x': 1\.5}"),
        (lambda: fc.generate.union(fc.generate.block(), 3), r"argument meshes\[1\] of union must be a Mesh, not the int 3"),
    ],
    fc.ContactError: [
        (lambda: fc.obstacles.Sphere((0.0, 0.0), -1.0), "R = -1.0"),
        (lambda: fc.obstacles.paraboloid(0.0), "R = 0.0"),
        (lambda: fc.obstacles.cone(float("nan")), "slope = nan"),
        (lambda: fc.obstacles.FlatPunch(1.0, side="left"), "side = 'left'"),
        (lambda: fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 1.0)).distance(np.zeros((1, 2))), "point = .0.0, 0.0, 0.0."),
        (lambda: fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 0.0)).distance(np.zeros((1, 2))), "the normal of a rigid half-space must not be zero"),
        (lambda: fc.obstacles.Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0).distance(np.zeros((1, 2))), "a rigid cylinder needs a three-dimensional model"),
        (lambda: square().add_contact(**SIDES, friction="0.3"), "friction of contact 'h' must be a number"),
    ],
    fc.ModelError: [
        (lambda: wood(E=(1.0, 0.0, 1.0)), "Young's modulus E2 = 0.0 must be a positive number"),
        (lambda: wood(E=(1.0, 1.0)), "must be three numbers, for 1, 2 and 3"),
        (lambda: wood(nu=0.3), "must be three numbers, for 12, 13 and 23"),
        (lambda: wood(G=(1.0, np.nan, 1.0)), "the shear modulus G13 = nan"),
        (lambda: wood(nu=(4.0, 0.1, 0.1)), r"nu12 = 4 must be less than sqrt\(E1 / E2\) = 3.92"),
        (lambda: wood(E=(1.0,) * 3, nu=(0.6,) * 3), r"too large together: .* = -0.512 must be positive"),
        (lambda: wood(axes=[(1, 0, 0), (1, 1, 0)]), "not at right angles: the angle between vectors 1 and 2 is 45 degrees"),
        (lambda: wood(axes=[(1, 0, 0), (0, 1, 0), (0, 0, -1)]), "left-handed"),
        (lambda: wood(axes=[(1, 0, 0), (0, 0, 0)]), "contain a zero vector"),
        (lambda: wood(axes="x"), "must be finite numbers"),
        (lambda: wood(axes=(1.0, 0.0, 0.0)), "must be one vector"),
        (lambda: wood(density=-1.0), "the density = -1.0 must be a non-negative number"),
        (lambda: wood(expansion=(1.0, 2.0)), "must be a number, or three along the material's axes"),
        (lambda: fc.Anisotropic(np.eye(3)), r"6 x 6 finite numbers, not of shape \(3, 3\)"),
        (lambda: fc.Anisotropic(np.diag([1.0, 1, 1, 1, 1, -1e-3])), "not positive definite: their smallest eigenvalue is -0.001"),
        (lambda: fc.Anisotropic(np.eye(6) + np.eye(6, k=2)), r"not symmetric: D\[0, 2\] = 1 and D\[2, 0\] = 0"),
        (lambda: made_of(fc.generate.block(divisions=(2, 2)), "plane_strain", wood(axes=lambda x: np.ones((len(x), 3)))).check(), r"must return three vectors in rows for each, shape \(4, 3, 3\)"),
        (lambda: made_of(fc.generate.block(divisions=(2, 2)), "plane_strain", wood(axes=lambda x: np.ones((len(x), 3, 3)))).check(), "these are not unit vectors at right angles"),
        (lambda: fc.ElasticPlastic(E=1.0, nu=0.3, yield_stress=0.0), "the yield stress = 0.0 must be a positive number"),
        (lambda: fc.ElasticPlastic(E=1.0, nu=0.3, yield_stress=1.0, hardening=[(0.0, 2.0)]), "hardening begins with"),
        (lambda: fc.ElasticPlastic(E=1.0, nu=0.3, yield_stress=1.0, hardening=[1.0]), "must be pairs"),
        (lambda: fc.ElasticPlastic(E=1.0, nu=0.3, yield_stress=1.0, hardening=[(0.2, 2.0), (0.1, 3.0)]), "ascending"),
        (lambda: fc.ElasticPlastic(E=1.0, nu=0.3, yield_stress=1.0, hardening=[(0.1, 0.1)]), "decreases too fast"),
        (lambda: fc.ElasticPlastic(E=1.0, nu=0.3, yield_stress=1.0, kinematic=-1.0), "must be zero or more"),
        (lambda: fc.ElasticPlastic(E=lambda x: x, nu=0.3, yield_stress=1.0), "do not vary"),
        (lambda: fc.MooneyRivlin(-1.0, 0.5, bulk=10.0), r"shear modulus 2 \(C10 \+ C01\) = -1 .* must be positive"),
        (lambda: fc.Yeoh(1.0, 0.0, 0.0, bulk=0.0), "the bulk modulus = 0.0 must be a positive number"),
        (lambda: fc.Ogden([1.0, 2.0], [2.0], bulk=10.0), "2 mu and 1 alpha"),
        (lambda: fc.Ogden(1.0, 0.0, bulk=10.0), "alpha must not be zero"),
        (lambda: made_of(fc.generate.block(), "plane_strain", fc.ElasticPlastic(E=100.0, nu=0.3, yield_stress=0.3, kinematic=4.0), "finite"), "kinematic hardening requires small strains"),
        (lambda: elastic_model(fc.generate.block(), E=1.0, nu=0.4999, strain="finite"), "locks .*: use NeoHookean"),
        (lambda: fc.Anisotropic([[1.0], [1.0, 2.0]]), "the moduli D must be a matrix of 6 x 6 finite numbers"),
        (lambda: fc.Anisotropic("abc"), "the moduli D must be a matrix of 6 x 6 finite numbers"),
        (lambda: fc.Anisotropic(np.full((6, 6), np.nan)), "the moduli D must be a matrix of 6 x 6 finite numbers"),
        (lambda: fc.Anisotropic(np.eye(6)).moduli("plane"), "kinematics 'plane': did you mean"),
        (lambda: fc.LinearElastic(E=1.0, nu=0.3, volumetric="mean"), r"volumetric 'mean'.*mean_dilatation"),
        (lambda: fc.LinearElastic(E="2e5", nu=0.3), "write 2e5 without quotation marks"),
        (lambda: fc.LinearElastic(E=1e61, nu=0.3), r"out of range: it must lie between 1e-60 and 1e\+60|must be a number"),
        (lambda: fc.LinearElastic(E=1e308, nu=0.3), r"out of range: it must lie between 1e-60 and 1e\+60|must be a number"),
        (lambda: fc.LinearElastic(E=10**400, nu=0.3), r"out of range: it must lie between 1e-60 and 1e\+60|must be a number"),
        (lambda: fc.LinearElastic(E=1e-61, nu=0.3), r"out of range: it must lie between 1e-60 and 1e\+60|must be a number"),
        (lambda: fc.LinearElastic(E=1e-320, nu=0.3), r"out of range: it must lie between 1e-60 and 1e\+60|must be a number"),
        (lambda: square().add_pressure(group="TOP", value="1.0"), r"argument value of .* not the string '1.0'"),
        (lambda: square().add_pressure(group="TOP", value=1.0, ramp=[(0, 0)]), r"at least two points"),
        (lambda: square().add_pressure(group="TOP", value=1.0, ramp=[(0, 0), (1, float("inf"))]), r"not finite"),
        (lambda: square().add_pressure(group="TOP", value=1.0, ramp=[1, 2]), r"argument ramp of .* must be a Ramp"),
        (lambda: square().add_traction(group="TOP"), r"traction on 'TOP' has no component"),
        (lambda: square().add_traction(group="TOP", z=1.0), r"component 'z'"),
        (lambda: square().add_traction(group="TOP", x=float("inf")), r"traction on 'TOP' is inf"),
        (lambda: square().add_force(group="TOP", x=lambda x: x[:, 0]), r"must be a number: a function of position gives"),
        (lambda: square().couple(group="TOP_LEFT", component="y"), r"contains 1 points"),
        (lambda: square().couple(group="TOP", component="z"), r"component 'z'"),
        (lambda: square().couple(group="TOP", component=""), r"no component"),
        (lambda: square().relate(terms=[]), r"at least one displacement"),
        (lambda: square().relate(terms=[("TOP_LEFT", "y", float("nan"))]), r"coefficient .* is nan"),
        (lambda: square().relate(terms=[(99, "y", 1.0)]), r"point 99 is not in the mesh of 9 points"),
        (lambda: square().relate(terms=[("TOP_LEFT", "y", 1.0)], value=float("nan")), r"the value of .* is nan"),
        (lambda: square().prescribe(group="TOP", y="a"), r"argument y of .* not the string 'a'"),
        (lambda: square().add_spring(0, x=1.0, direction=[1.0, 0.0]), "has a direction, but no axial or transverse stiffness"),
        (lambda: square().add_spring(0, axial=1.0, direction=[0.0, 0.0]), "must be 2 numbers, not all zero"),
        (lambda: square().add_spring(0, axial=1.0, direction=[1.0, 0.0, 0.0]), "must be 2 numbers, not all zero"),
        (lambda: square().add_spring("NOWHERE"), "NOWHERE"),
        (lambda: square().add_spring("BOTTOM"), "has no component"),
        (lambda: square().add_spring("BOTTOM", z=1.0), "component"),
        (lambda: square().add_spring("BOTTOM", y=np.nan), r"stiffness .*(positive|finite)"),
        (lambda: square().add_spring("BOTTOM", y=np.inf), r"stiffness .*(positive|finite)"),
        (lambda: square().add_spring("BOTTOM", y="stiff"), "must be a number"),
        (lambda: square().add_spring("BOTTOM", "BLOCK", axial=1.0), "have 3 and 9 nodes: they must match"),
        (lambda: square().add_spring("TOP_LEFT", "TOP_LEFT", axial=1.0), "both ends are point"),
        (lambda: ring().add_gravity(), "has no component"),
        (lambda: ring().add_gravity(y=np.inf), "is inf, which is not a finite number"),
        (lambda: ring().add_gravity("TOP", y=1.0), "contains no solid cells: no gravity can act on it"),
        (lambda: ring().add_centrifugal(1.0, direction=(0, 0, 0)), "has no length"),
        (lambda: ring().add_centrifugal(1.0, origin=(0,)), "needs three components"),
        (lambda: ring().add_centrifugal("fast"), "must be a number, not the string 'fast'"),
        (lambda: square().relate_groups("LEFT", "RIGHT", "x", translation=(1.0,)), "must be 2 numbers"),
        (lambda: square().relate_groups("LEFT", "RIGHT", "q"), "unknown component 'q'"),
        (lambda: square().relate_groups("LEFT", "RIGHT", "x", coefficients=(1.0,)), "needs two coefficients"),
        (lambda: square().relate_groups("LEFT", "RIGHT", "x", value=np.nan), "must be|finite|number"),
        (lambda: square().prescribe("TOP", normal=np.nan), "must be|finite|number"),
        (lambda: square().fix("LEFT", "x", axes=(0.0, 0.0)), "the axes of the support of 'LEFT'"),
        (lambda: square().prescribe("LEFT", normal=0.0, axes=(1.0, 1.0)), "along its normals or along axes"),
        (lambda: square().fix("LEFT", "x", axes=((0.0, 1.0, 1.0), (1.0, 0.0, 0.0))), "components out of the plane"),
        (lambda: square().fix("BOTTOM", "x", axes=fc.CylindricalAxes()), "a node at .* lies on the line"),
        (lambda: fc.recovery.von_mises([[0.0, 0.0], [1.0, 1.0]]), r"last axis must .* but the shape is \(2, 2\)"),
        (lambda: fc.recovery.von_mises_signed(1.0), r"but the shape is \(\)"),
        (lambda: fc.recovery.equivalent_strain(np.zeros((3, 5))), r"but the shape is \(3, 5\)"),
        (lambda: BY_CELL.moduli_at(np.ones((4, 2)), "plane_strain"), "axes given by cell need `constants`"),
        (lambda: square().load_vector(5), r"argument load of Model\.load_vector"),
        (lambda: square().add_pressure("TOP", 1.0, ramp=iter([("a", 1.0)])), r"must contain pairs \(load factor, multiplier of the loads\)"),
        (lambda: square().add_pressure("TOP", 1.0, ramp=iter([(0.0, 0.0, 1.0)])), r"must contain pairs \(load factor, multiplier of the loads\)"),
        (lambda: square().add_pressure("TOP", 1.0, ramp=iter([(0.0, 10**400)])), r"must contain pairs \(load factor, multiplier of the loads\)"),
        (lambda: square().add_pressure("TOP", 1.0, ramp=iter([1.0])), r"must contain pairs \(load factor, multiplier of the loads\)"),
        (lambda: turning(["a", 0.0]), "the centre of the rotation of obstacle 'o'"),
        (lambda: turning([[0.0], [1.0, 2.0]]), "the centre of the rotation of obstacle 'o'"),
        (lambda: turning([0.0]), "the centre of the rotation of obstacle 'o'"),
        (lambda: turning([0.0, float("inf")]), "the centre of the rotation of obstacle 'o'"),
        (lambda: square().internal_forces(np.zeros(3)), r"the displacement has shape \(3,\), but the mesh"),
        (lambda: square().fix("LEFT", "x", axes=lambda points: "text"), "returned 'text', not numbers"),
        (lambda: fc.solve(square(), resume=[1, 2]), "the argument resume of solve must be a sequence of StepResults"),
        (lambda: fc.solve("model"), "the argument model of solve must be a Model, not the string 'model'"),
        (lambda: fc.Criteria(max_geometry_updates=2.5), "max_geometry_updates = 2.5 must be a whole number >= 0"),
        (lambda: fc.Criteria(geometry_updates=1.5), "geometry_updates = 1.5 must be None or a whole number >= 0"),
        (lambda: fc.Criteria(max_active_set_iterations=9.5), "max_active_set_iterations = 9.5 must be a whole number >= 1"),
        (lambda: fc.Ramp([np.float64(0.5), np.float64(0.2)]), r"must be strictly increasing, not \[0\.5, 0\.2\]"),
        (lambda: fc.Model("a.med", "3d"), "the argument mesh of Model must be a Mesh, not the string 'a.med'"),
        (lambda: fc.Criteria(keep_pairing=True, geometry_updates=2), "keep_pairing excludes geometry_updates = 2"),
        (lambda: fc.Criteria(friction_while_touching=0), "friction_while_touching = 0 must be above 0"),
        (lambda: ring().add_force("TOP", y=1.0, at=(1.5, 3.0)), "in axisymmetry a force cannot act at a point"),
        (lambda: ring().add_obstacle("ball", secondary="TOP", obstacle=fc.obstacles.Sphere((0.0, 5.0), 2.0), rotation={"angle": 1.0, "centre": (0.0, 0.0)}), "no displacement around its axis"),
        (lambda: ring().prescribe("TOP", rotation={"angle": 1.0, "centre": (0.0, 0.0)}), "no displacement around its axis"),
    ],
    fc.CaseError: [
        (lambda: fc.normal_stress(None, 1.0), "argument contact of normal_stress"),
        (lambda: fc.write_csv("a.csv", np.zeros(3)), "a table is an array with named columns"),
    ],
    fc.FastcontactError: [
        (lambda: fc.StepResult(1, 1.0, *[np.zeros(1)] * 5, contact=np.zeros), "contact of a StepResult must be a dict"),
        (lambda: of_ones(fc.ContactResult), r"coordinates of a ContactResult must be an array \(m, dim\)"),
        (lambda: fc.plot.pressure_profile(pressed(), theory=5), "a theory needs a pressure, .* but 5 has none"),
        (lambda: fc.plot.pressure_profile(pressed(), ax="ax"), "drawn on axes of Matplotlib, not on 'ax'"),
    ],
    fc.FileError: [
        (lambda: fc.open_results(None), "the argument path of open_results must be a string or a path, not None"),
    ],
}
CALLS = [(pattern, make, kind, pattern) for kind, rows in REFUSED.items() for make, pattern in rows]
