"""Bodies without contact compared with other programs on the same meshes: CalculiX 2.20 (Debian) and FElupe 11.3."""

import numpy as np
import pytest

import fastcontact as fc

HARDENING = [(0.0, 1.0), (0.05, 1.5), (0.5, 2.0)]


def neo_hookean(mu: float, bulk: float, volumetric: str = "auto") -> fc.NeoHookean:
    E, nu = 9.0 * bulk * mu / (3.0 * bulk + mu), (3.0 * bulk - 2.0 * mu) / (2.0 * (3.0 * bulk + mu))
    return fc.NeoHookean(E=E, nu=nu, volumetric=volumetric)


# Forces on the top of a cube of 2 x 2 x 2 C3D20, its bottom held, its top moved; constants D1 = 0.2, D2 = D3 = 1e12.
CALCULIX = {
    "neo-Hookean": (neo_hookean(1.0, 10.0), "finite", (0.2, 0.3), (0.1801070, 0.8341061)),
    "Mooney-Rivlin": (fc.MooneyRivlin(0.3, 0.2, bulk=10.0), "finite", (0.2, 0.3), (0.1644494, 0.7530098)),
    "Yeoh": (fc.Yeoh(0.5, -0.02, 0.01, bulk=10.0), "finite", (0.2, 0.3), (0.1769964, 0.8192431)),
    "Ogden": (fc.Ogden([0.6, 0.3], [2.5, -1.5], bulk=10.0), "finite", (0.2, 0.3), (0.1577790, 0.7298936)),
    "Saint Venant-Kirchhoff": (fc.LinearElastic(E=3.0, nu=0.3), "finite", (0.05, 0.05), (0.0500073, 0.1808783)),
    "plastic": (
        fc.ElasticPlastic(E=200.0, nu=0.3, yield_stress=1.0, hardening=HARDENING, volumetric="plain"), "small", (0.01, 0.02),
        (0.1246900, 1.301424),
    ),
}  # fmt: skip


@pytest.mark.parametrize("law", CALCULIX)
def test_a_cube_of_calculix(law: str) -> None:
    material, strain, (along, up), force = CALCULIX[law]
    mesh = fc.generate.box((1.0, 1.0, 1.0), (2, 2, 2), element="hex20")
    model = fc.Model(mesh, "3d", strain=strain)
    model.add_material(material)
    model.fix("ZMIN", "xyz")
    model.prescribe("ZMAX", x=along, y=0.0, z=up)
    found = fc.solve(model, 10)[-1].reaction[mesh.points_of("ZMAX")].sum(axis=0)
    assert found == pytest.approx([force[0], 0.0, force[1]], rel=1e-6, abs=1e-9)


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
