"""Materials in case files: orthotropic, anisotropic and nonlinear ones, their axes, densities and expansions."""

import tomllib

import numpy as np
import pytest
from case_texts import case_of, of_block
from refusals import refused

import fastcontact as fc
from fastcontact.cases.case import build_case, read_case

PRESSED = '[[pressure]]\ngroup = "TOP"\nvalue = 1.0'
CASE = of_block(PRESSED, "plane_strain", material="{}", BOTTOM="xy")
WOOD = "E = [10800, 700, 430]\nnu = [0.45, 0.51, 0.54]\nG = [620, 580, 26]\n"
CONSTANTS = (10800, 700, 430), (0.45, 0.51, 0.54), (620, 580, 26)


def material(tmp_path, text):
    path = tmp_path / "case.toml"
    fc.write_mesh(tmp_path / "block.med", fc.generate.block(divisions=(2, 2)))
    path.write_text(CASE.format(text))
    return read_case(path).model.materials[0][0]


def test_materials_of_all_kinds_reach_the_model(tmp_path):
    found = material(
        tmp_path, WOOD + "axes = [[1, 1, 0], [-1, 1, 0]]\ndensity = 4.5e-10\nexpansion = [5e-6, 3e-5, 3e-5]"
    )
    assert found == fc.Orthotropic(
        *CONSTANTS, axes=[(1, 1, 0), (-1, 1, 0)], density=4.5e-10, expansion=(5e-6, 3e-5, 3e-5)
    )
    found = material(tmp_path, WOOD + "axes = {origin = [0, -1, 0]}")
    assert found == fc.Orthotropic(*CONSTANTS, axes=fc.CylindricalAxes(origin=(0, -1, 0)))
    D = fc.Orthotropic(*CONSTANTS).moduli("3d")
    np.testing.assert_array_equal(material(tmp_path, f"D = {D.tolist()}").D, (D + D.T) / 2)
    found = material(tmp_path, "E = 210e3\nnu = 0.3\ndensity = 7.85e-9\nexpansion = 12e-6")
    assert found == fc.LinearElastic(210e3, 0.3, density=7.85e-9, expansion=12e-6)


def test_constants_that_vary_reach_the_model(tmp_path):
    found = material(tmp_path, "E = {along = 'y', table = [[0.0, 100.0], [1.0, 300.0]]}\nnu = 0.3")
    assert found.E.source == fc.Tabulated("y", [(0.0, 100.0), (1.0, 300.0)])
    found = material(tmp_path, WOOD.replace("10800", "{along = 'radius', table = [[0.5, 9000], [1, 12000]]}"))
    assert found.E[0].range == pytest.approx((9000.0, 12000.0), rel=0.3)
    assert found.E[1:] == (700.0, 430.0)
    found = material(tmp_path, "E = 1.0\nnu = 0.3\ndensity = {along = 'x', table = [[0, 1], [1, 2]]}")
    assert found.E == 1.0
    assert found.density.range[1] < 2.0
    found = material(tmp_path, "E = 1.0\nnu = 0.3\nexpansion = {along = 'x', table = [[0, 1e-5], [1, 2e-5]]}")
    assert found.expansion.source == fc.Tabulated("x", [(0.0, 1e-5), (1.0, 2e-5)])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("E = [1, 2, 3]\nnu = 0.3", r"material\[0\] needs 'G'"),
        ("G = [1, 1, 1]\nnu = [0, 0, 0]", r"material\[0\] needs 'E'"),
        (WOOD.replace("430]", "430, 1]"), r"material\[0\]: E = .* must be three numbers"),
        (WOOD.replace("0.45", "4.5"), r"material\[0\]: Poisson's ratio nu12 = 4.5 must be less than"),
        (WOOD + "volumetric = 'plain'", r"the key 'material\[0\].volumetric' does not belong to an orthotropic"),
        ("E = 1.0\nnu = 0.3\naxes = [[1, 0, 0], [0, 1, 0]]", r"'material\[0\].axes' does not belong to .* isotropic"),
        ("E = {along = 'r', table = [[0, 1]]}\nnu = 0.3", r"'material\[0\].E': a table is along x, y, z or radius"),
        ("E = {along = 'x'}\nnu = 0.3", r"'material\[0\].E' needs 'table'"),
        ("E = {alon = 'x', table = [[0, 1]]}\nnu = 0.3", r"E.alon': did you mean 'material\[0\].E.along'"),
        ("E = {along = 'x', table = [[0, -1]]}\nnu = 0.3", r"material\[0\]: in cell 0 of quad4 .* modulus E = -1"),
        (WOOD.replace("0.45", "{along = 'x', table = [[0, 4.5]]}"), r"material\[0\]: in cell 0 .* nu12 = 4.5 must"),
        ("D = [[1, 2], [2, 1]]", r"material\[0\]: the moduli D must be a matrix of 6 x 6"),
        (WOOD + "axes = {orgin = [0, 0, 0]}", r"'material\[0\].axes.orgin': did you mean 'material\[0\].axes.origin'"),
        (WOOD + "axes = [[1, 0, 0], [1, 1, 0]]", r"material\[0\]: .* not at right angles"),
        ("E = 1.0\nnu = 0.3\nexpansion = [1, 2, 3]", r"material\[0\]: .*must be a number"),
    ],
)
def test_mistakes_in_materials_name_the_key(tmp_path, text, message):
    refused((fc.CaseError, fc.ModelError), message, material, tmp_path, text)


LAWS = {
    'law = "elastic_plastic"\nE = 200\nnu = 0.3\nyield_stress = 1\nhardening = [[0, 1], [0.1, 2]]\nkinematic = 3': (
        fc.ElasticPlastic(E=200.0, nu=0.3, yield_stress=1.0, hardening=[(0.0, 1.0), (0.1, 2.0)], kinematic=3.0)
    ),
    "E = 200\nnu = 0.3\nyield_stress = 1": fc.ElasticPlastic(E=200.0, nu=0.3, yield_stress=1.0),
    'law = "neo_hookean"\nE = 6\nnu = 0.4995': fc.NeoHookean(E=6.0, nu=0.4995),
    'law = "mooney_rivlin"\nC10 = 1\nC01 = 0.2\nbulk = 100': fc.MooneyRivlin(1.0, 0.2, bulk=100.0),
    'law = "yeoh"\nC10 = 1\nC20 = -0.1\nC30 = 0.01\nbulk = 100': fc.Yeoh(1.0, -0.1, 0.01, bulk=100.0),
    'law = "ogden"\nmu = [1, 0.2]\nalpha = [2, -1]\nbulk = 100\nexpansion = 2e-4\nconductivity = 0.2': (
        fc.Ogden([1.0, 0.2], [2.0, -1.0], bulk=100.0, expansion=2e-4, conductivity=0.2)
    ),
}


def built(material: str, strain: str = ""):
    text = case_of('generator = "block"', "", "axisymmetric", material, BOTTOM="y", TOP={"y": 0.01})
    return build_case(tomllib.loads(strain + text), name="case")


@pytest.mark.parametrize("text", LAWS)
def test_a_law_of_a_case_file_is_that_of_python(text: str) -> None:
    law = LAWS[text]
    case = built(text, "" if "small" in law.strains else 'strain = "finite"')
    assert case.model.materials == [(law, None)]
    assert fc.solve(case.model, 1)[-1].cell_fields.keys() == set(case.model.cell_fields)


@pytest.mark.parametrize(
    ("material", "strain", "text"),
    [
        ('law = "neo_hooke"\nE = 6\nnu = 0.3', "", "law.*neo_hooke.*neo_hookean"),
        ('law = "yeoh"\nC10 = 1', 'strain = "finite"', r"material\[0\] needs 'C20'"),
        ('law = "neo_hookean"\nE = 6\nnu = 0.3', "", "NeoHookean requires finite strains"),
        ('law = "neo_hookean"\nE = 6\nnu = 0.3\nbulk = 3', 'strain = "finite"', r"'material\[0\].bulk' does not"),
        ("E = 6\nnu = 0.3", 'strain = "huge"', "strain.*huge"),
    ],
)
def test_mistakes_name_the_key(material: str, strain: str, text: str) -> None:
    refused(fc.FastcontactError, text, built, material, strain)
