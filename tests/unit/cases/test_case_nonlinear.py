"""Materials with nonlinear laws in case files."""

import tomllib

import pytest

import fastcontact as fc
from fastcontact.cases.case import build_case

CASE = """
kinematics = "axisymmetric"
{strain}
[mesh]
generator = "block"
[[material]]
{material}
[[support]]
group = "BOTTOM"
y = 0.0
[[support]]
group = "TOP"
y = 0.01
"""
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
    return build_case(tomllib.loads(CASE.format(material=material, strain=strain)), name="case")


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
        (
            'law = "neo_hookean"\nE = 6\nnu = 0.3\nbulk = 3',
            'strain = "finite"',
            r"'material\[0\].bulk' does not belong to",
        ),
        ("E = 6\nnu = 0.3", 'strain = "huge"', "strain.*huge"),
    ],
)
def test_mistakes_name_the_key(material: str, strain: str, text: str) -> None:
    with pytest.raises(fc.FastcontactError, match=text):
        built(material, strain)
