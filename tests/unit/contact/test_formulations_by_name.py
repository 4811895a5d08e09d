"""The formulations by name are an ordinary mapping."""

from fastcontact.contact.formulations import FORMULATIONS, Formulation


def test_every_name_has_a_class_and_others_have_none():
    assert set(FORMULATIONS) >= {"node_to_segment", "continuous", "mortar"}
    assert len(FORMULATIONS) == len(list(FORMULATIONS))
    assert all(issubclass(kind, Formulation) for kind in FORMULATIONS.values())
    assert FORMULATIONS.get("mortal") is None
