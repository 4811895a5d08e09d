"""Models that tests of many rooms begin with."""

import fastcontact as fc


def elastic_model(mesh, kinematics, E=1000.0, nu=0.3, **held):
    """Return a model of one elastic material, with groups held along axes: ``elastic_model(mesh, "3d", ZMIN="xyz")``."""
    model = fc.Model(mesh, kinematics)
    model.add_material(fc.LinearElastic(E=E, nu=nu))
    for group, axes in held.items():
        model.fix(group, axes)
    return model
