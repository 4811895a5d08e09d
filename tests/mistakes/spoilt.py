"""Damaged meshes: functions that write a damaged copy of a MED file, and a pattern of the message."""
# ruff: noqa: E501 (messages stay in one piece)

import shutil

import h5py
import numpy as np

import fastcontact as fc


def moved(change):
    """Return a function that changes the coordinates (n, 2) of a MED file, given the corners of its triangles."""

    def write(source, target):
        triangles = fc.read_mesh(source).cells["tri3"]
        shutil.copy(source, target)
        with h5py.File(target, "r+") as file:
            names = []
            file.visit(lambda name: names.append(name) if name.endswith("COO") else None)
            points = file[names[0]][()].reshape(2, -1).T.copy()
            change(points, triangles)
            file[names[0]][...] = points.T.ravel()

    return write


def rewritten(change):
    """Return a function that changes a mesh and writes it whole."""
    return lambda source, target: fc.write_mesh(target, change(fc.read_mesh(source)))


def not_a_number(points, _):
    points[100, 1] = np.nan


def infinite(points, _):
    points[7, 0] = np.inf


def beyond_the_axis(points, _):
    points[:, 0] -= 1.0


def flat(points, triangles):
    points[triangles[500, 1]] = points[triangles[500, 0]]


def folded(points, triangles):
    corner = triangles[500, 0]
    points[corner] += 2.5 * (points[triangles[500]].mean(axis=0) - points[corner])


def without_groups(mesh):
    return mesh.replace(cell_groups={}, point_groups={})


def lines_only(mesh):
    lines = {name: rows for name, rows in mesh.cell_groups.items() if "tri3" not in mesh.split(rows)}
    first = mesh.offsets["line2"]
    return mesh.replace(cells={"line2": mesh.cells["line2"]}, cell_groups={k: v - first for k, v in lines.items()})


def with_a_copy(mesh):
    parts = {**mesh.cells, "tri3": np.vstack([mesh.cells["tri3"], mesh.cells["tri3"][:1]])}
    return fc.Mesh(mesh.points, parts)


def upright(mesh):
    return mesh.replace(points=np.insert(mesh.points, 1, 0.0, axis=1))


def in_space(source, target):
    fc.write_mesh(target, fc.generate.box())


# fmt: off
MESHES = [
    ("a coordinate in the file is NaN", moved(not_a_number),
     r"mesh 'mesh' of 'spoilt\.med': point 100 has coordinates \[.*nan\], which are not finite \(number of such points: 1\)"),
    ("a coordinate in the file is infinite", moved(infinite),
     r"mesh 'mesh' of 'spoilt\.med': point 7 has coordinates \[ *inf .*\], which are not finite \(number of such points: 1\)"),
    ("the mesh in the file lies at r < 0", moved(beyond_the_axis),
     r"point \d+ has the radius x = -1 < 0: an axisymmetric model lies at x >= 0, with y along the axis"),
    ("a cell in the file is flat", moved(flat),
     r"cell \d+ \(tri3 at \(.*\), area 0\) is degenerate \(number of such cells: 2\): remove it or merge its points differently"),
    ("the mesh in the file is folded", moved(folded),
     r"cells \d+ and \d+ lie on the same side of the facet between them, near \(.*\), one of 3 such pairs: the mesh is folded there; move its nodes or remesh"),
    ("the file has no groups", rewritten(without_groups),
     r"the mesh has no groups, and thus no 'SPHHAU': add groups in the mesher, or with Mesh\.with_groups"),
    ("the file contains only lines", rewritten(lines_only), r"the mesh has no solid cells, only line2"),
    ("a duplicate cell in the file", rewritten(with_a_copy),
     r"cell \d+ \(tri3 at \(.*\)\) occurs in the mesh 2 times \(number of such cells: 1\): remove the copies"),
    ("the mesh in the file lies in the x-z plane", rewritten(upright),
     r"kinematics 'axisymmetric' needs a mesh in the x-y plane, and this one has a third coordinate: turn it, or keep two coordinates, those of the x-z plane by mesh\.replace\(points=mesh\.points\[:, \[0, 2\]\]\)"),
    ("the file contains a 3D mesh", in_space, r"kinematics 'axisymmetric' cannot be used with a 3D mesh: use '3d'"),
]
# fmt: on
