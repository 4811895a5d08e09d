"""Models shared by many tests."""

import json
from pathlib import Path

import numpy as np

import fastcontact as fc


def elastic_model(mesh, kinematics=None, E=1000.0, nu=0.3, **held):
    """Return a model of one elastic material with supports, as for `supported`: ``elastic_model(mesh, ZMIN="xyz")``.

    Meshes of the plane are in plane strain unless told otherwise.
    """
    model = fc.Model(mesh, kinematics or ("3d" if mesh.dim == 3 else "plane_strain"))
    model.add_material(fc.LinearElastic(E=E, nu=nu))
    return supported(model, **held)


def supported(model, **held):
    """Fix groups along axes, or prescribe displacements: ``supported(model, BOTTOM="y", TOP={"y": -0.1})``."""
    for group, given in held.items():
        model.prescribe(group, **given) if isinstance(given, dict) else model.fix(group, given)
    return model


def united(**meshes):
    """Return meshes as one, their groups after a keyword: ``united(L_=lower)`` has L_TOP, but keeps L, the body itself."""
    return fc.generate.union(
        *(
            fc.generate.renamed(mesh, {g: g if start == f"{g}_" else start + g for g in mesh.group_names})
            for start, mesh in meshes.items()
        )
    )


def members(mesh):
    """Groups of cells as (element, row) pairs, which do not depend on the order of the elements."""
    return {
        group: {(name, row) for name, rows in mesh.split(numbers).items() for row in rows.tolist()}
        for group, numbers in mesh.cell_groups.items()
    }


class DenseCompliance:
    """A compliance of contact given by its matrix."""

    def __init__(self, C):
        self.C = C

    def block(self, rows):
        return self.C[np.ix_(rows, rows)]

    among = block

    def apply(self, multiplier):
        return self.C @ multiplier


def reference(name):
    """Return the stored values of a theory, with their source."""
    return json.loads((Path(__file__).parents[1] / "data" / "reference" / f"{name}.json").read_text())
