"""Bodies without contact compared with FElupe 11.3 on the same meshes."""

import numpy as np
import pytest

import fastcontact as fc


def neo_hookean(mu: float, bulk: float, volumetric: str = "auto") -> fc.NeoHookean:
    E, nu = 9.0 * bulk * mu / (3.0 * bulk + mu), (3.0 * bulk - 2.0 * mu) / (2.0 * (3.0 * bulk + mu))
    return fc.NeoHookean(E=E, nu=nu, volumetric=volumetric)


@pytest.mark.parametrize(
    ("element", "count", "place", "displacement"),
    [
        ("hex8", 4, (0.75, 0.5, 0.5), (0.0783203458135064, 0.0, 0.1397266187581981)),
        ("quad4", 6, (5.0 / 6.0, 0.5), (0.05784980188343853, 0.13548997230390997)),
    ],
)
def test_a_block_of_felupe(element: str, count: int, place, displacement) -> None:
    """A node inside of a stretched and sheared block, mu = 1, bulk = 2; all nodes agree to 2.4e-16."""
    dim = len(place)
    generate, faces = (fc.generate.box, ("ZMIN", "ZMAX")) if dim == 3 else (fc.generate.block, ("BOTTOM", "TOP"))
    mesh = generate((1.0,) * dim, (count,) * dim, element=element)
    model = fc.Model(mesh, "3d" if dim == 3 else "plane_strain", strain="finite")
    model.add_material(neo_hookean(1.0, 2.0, "plain"))
    model.fix(faces[0], "xyz"[:dim])
    model.prescribe(faces[1], **dict(zip("xyz"[:dim], (0.2, 0.0, 0.3) if dim == 3 else (0.2, 0.3), strict=True)))
    node = np.linalg.norm(mesh.points - place, axis=1).argmin()
    assert fc.solve(model, 4)[-1].displacement[node] == pytest.approx(displacement, rel=1e-8, abs=1e-12)
