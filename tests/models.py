"""Models shared by many tests."""

import json
import warnings
from pathlib import Path

import numpy as np

import fastcontact as fc
from fastcontact.mesh import elements

FLAT, SOLIDS = ([e.name for e in elements.ELEMENTS.values() if e.dim == dim] for dim in (2, 3))
CELLS = [(kinematics, name) for kinematics in ("plane_strain", "plane_stress", "axisymmetric") for name in FLAT]
CELLS += [("3d", name) for name in SOLIDS]


def elastic_model(mesh, kinematics=None, E=1000.0, nu=0.3, **given):
    """Return a model of one elastic material with supports, as for `supported`: ``elastic_model(mesh, ZMIN="xyz")``.

    Meshes of the plane are in plane strain unless told otherwise.
    """
    kinematics = kinematics or ("3d" if mesh.dim == 3 else "plane_strain")
    return made_of(mesh, kinematics, fc.LinearElastic(E=E, nu=nu), **given)


def made_of(mesh, kinematics, material, strain="small", reference_temperature=0.0, **held):
    """Return a model of one material, or of one for each group in a dictionary, with supports, as for `supported`."""
    model = fc.Model(mesh, kinematics, strain=strain, reference_temperature=reference_temperature)
    for group, given in (material if isinstance(material, dict) else {None: material}).items():
        model.add_material(given, group)
    return supported(model, **held)


def supported(model, **held):
    """Fix groups along axes, or prescribe displacements: ``supported(model, BOTTOM="y", TOP={"y": -0.1})``."""
    for group, given in held.items():
        model.prescribe(group, **given) if isinstance(given, dict) else model.fix(group, given)
    return model


def with_contact(model, name, secondary, primary, **options):
    """Add a contact pair to a model; return the model."""
    model.add_contact(name, secondary=secondary, primary=primary, **options)
    return model


def with_obstacle(model, name, secondary, obstacle, **options):
    """Add a rigid obstacle to a model; return the model."""
    model.add_obstacle(name, secondary=secondary, obstacle=obstacle, **options)
    return model


def last_step(model, ramp=1, about="", **options):
    """Solve a model; return the last step and the texts of those warnings raised meanwhile that contain `about`."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        step = fc.solve(model, ramp, **options)[-1]
    return step, [text for text in (str(w.message) for w in caught) if about in text]


def pressed_spheres(mesh, by=2.0, name="hertz", material=None, strain="small", **options):
    """Return the training case on a mesh of half-spheres: each is pressed `by` a length onto the other.

    The `options` are those of the contact, which is left out if `name` is None.
    """
    material = material or fc.LinearElastic(E=20_000.0, nu=0.3)
    held = {"A1A2": "x", "A2B2": {"y": -by}, "A1B1": {"y": by}}
    model = made_of(mesh, "axisymmetric", material, strain=strain, **held)
    if name is not None:
        model.add_contact(name, secondary="CONT1", primary="CONT2", **options)
    return model


def united(**meshes):
    """Return meshes as one, their groups after a keyword: ``united(L_=lower)`` has L_TOP, but keeps L, the body itself.

    The last character of a keyword may also be a space: ``united(**{"L ": lower})`` has L TOP.
    """
    return fc.generate.union(
        *(
            fc.generate.renamed(mesh, {g: g if start[:-1] == g else start + g for g in mesh.group_names})
            for start, mesh in meshes.items()
        )
    )


def members(mesh):
    """Groups of cells as (element, row) pairs, which do not depend on the order of the elements."""
    return {
        group: {(name, row) for name, rows in mesh.split(numbers).items() for row in rows.tolist()}
        for group, numbers in mesh.cell_groups.items()
    }


def assert_same_mesh(found, mesh):
    """The same points, cells and groups; element types may be in another order."""
    np.testing.assert_array_equal(found.points, mesh.points)
    assert {name: block.tolist() for name, block in found.cells.items()} == {
        name: block.tolist() for name, block in mesh.cells.items()
    }
    assert members(found) == members(mesh)
    assert {name: points.tolist() for name, points in found.point_groups.items()} == {
        name: points.tolist() for name, points in mesh.point_groups.items()
    }


def body_of(element, size=(2.0, 1.0, 1.5), divisions=(2, 2, 2), *options):
    """Return a block or a box of an element."""
    dim = elements.get(element).dim
    generate = fc.generate.block if dim == 2 else fc.generate.box
    return generate(size[:dim], divisions[:dim], element, *options)


def row_of(names, groups=True):
    """Two sheared cells of each element side by side, and groups: overlapping, of several elements, empty."""
    points, cells, count = [], {}, 0
    dim = max(2, *(elements.get(name).dim for name in names))
    shear = np.array([[1.0, 0.3, 0.0], [0.0, 1.2, 0.4], [0.2, 0.0, 0.9]])[:dim, :dim]
    for column, name in enumerate(names):
        nodes = elements.get(name).nodes
        nodes = np.pad(nodes, [(0, 0), (0, dim - nodes.shape[1])]) @ shear + 5.0 * column * np.eye(dim)[0]
        points += [nodes, nodes + 5.0 * np.eye(dim)[1]]
        cells[name] = count + np.arange(2 * len(nodes)).reshape(2, -1)
        count += 2 * len(nodes)
    mesh = fc.Mesh(np.concatenate(points), cells)
    if not groups:
        return mesh
    every = np.arange(mesh.n_cells)
    return mesh.with_groups({"every": every, "upper": every[1::2], "nobody": []}, {"P": [0], "Q": [0, 2], "none": []})


class DenseCompliance:
    """A compliance of contact given by its matrix."""

    def __init__(self, C):
        self.C = C

    def block(self, rows):
        return self.C[np.ix_(rows, rows)]

    block_operator = block

    def apply(self, multiplier):
        return self.C @ multiplier


def reference(name):
    """Return the stored values of a theory, with their source."""
    return json.loads((Path(__file__).parents[1] / "data" / "reference" / f"{name}.json").read_text())


def derivative(function, point, step):
    """Return the central difference of fourth order of a function of two coordinates along `step` (2,)."""
    values = [function(*(point + k * step)) for k in (-2, -1, 1, 2)]
    return (values[0] - 8.0 * values[1] + 8.0 * values[2] - values[3]) / (12.0 * np.linalg.norm(step))


def assert_largest(hertz, nu):
    """Assert that the largest von Mises stress of a theory with a contact radius of 2 is the largest of its field."""
    x, y = np.meshgrid(np.linspace(0.0, 4.0, 161), -np.linspace(0.0, 4.0, 161))
    field, top = hertz.von_mises(x, y, nu).max(), hertz.von_mises_maximum(nu).value
    assert 0.999 * top < field <= top * (1.0 + 1e-12)


def plates(friction):
    """Return three plates that do not match, pressed on each other, and with friction sheared."""
    parts = {}
    for i, (width, n) in enumerate(((8.0, 6), (6.0, 5), (7.0, 7))):
        parts[str(i)] = fc.generate.box((width, width, 2.0), (n, n, 2), origin=(-width / 2, -width / 2, 2.0 * i))
    model = fc.Model(joined(parts), "3d")
    for i, E in enumerate((2e5, 1e4, 7e4)):
        model.add_material(fc.LinearElastic(E, 0.3), groups=[f"BOX{i}"])
    model.fix("ZMIN0", "xyz")
    model.add_pressure("ZMAX2", 10.0)
    for i in (1, 2):
        model.add_contact(f"c{i}", secondary=f"ZMIN{i}", primary=f"ZMAX{i - 1}", friction=friction)
        if not friction:
            supported(model, **{f"XMIN{i}": "x", f"YMIN{i}": "y"})
    if friction:
        model.add_traction("ZMAX2", x=1.0)
    return model


def joined(parts):
    """Return meshes by name as one, each group with the name behind its own."""
    return fc.generate.union(
        *(
            fc.generate.renamed(mesh, {group: group + name for group in mesh.group_names})
            for name, mesh in parts.items()
        )
    )


def cubes(n, m):
    """Return the mesh of two cubes on each other, of n and m cells a side, with the groups ZMIN_LOW to ZMAX_HIGH."""
    low = fc.generate.box((1.0, 1.0, 1.0), (n, n, n), name="LOW")
    high = fc.generate.box((1.0, 1.0, 1.0), (m, m, m), origin=(0.0, 0.0, 1.0), name="HIGH")
    return joined({"_LOW": low, "_HIGH": high})
