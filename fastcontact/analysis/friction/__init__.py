"""Coulomb friction: unilateral contact and the friction cone, solved together."""
