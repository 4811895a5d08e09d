"""Element types of decks: kinds of unsupported types, and which types have incompatible modes."""

import pytest

from fastcontact.cases.decks.element_types import element_type, unsupported_kind


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("S4R", "shell"), ("SC8R", "continuum shell"), ("SPRING2", "spring"), ("SFM3D4R", "surface"), ("R3D4", "rigid"),
        ("ROTARYI", "rotary inertia"), ("ITSUNI", "tube support"), ("ISL31", "slide line"), ("DC1D2", "heat link"),
        ("DCC2D4", "convective heat transfer"), ("DCOUP3D", "distributing coupling"), ("D", "network"),
    ],
)  # fmt: skip
def test_unsupported_types_are_described(name, kind):
    assert element_type(name) is None
    assert unsupported_kind(name) == f" ({kind})"


@pytest.mark.parametrize("name", ["C3D8I", "C3D8IH", "CPE4I", "CPS4I"])
def test_linear_types_have_incompatible_modes(name):
    assert element_type(name).incompatible_modes


def test_the_quadratic_tetrahedron_with_improved_surface_stress_has_no_incompatible_modes():
    kind = element_type("C3D10I")
    assert (kind.element, kind.incompatible_modes, kind.note) == (
        "tet10",
        False,
        "replaced by the standard quadratic element",
    )
