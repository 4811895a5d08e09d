"""Coulomb friction: the inequalities of contact and the friction cone, solved together."""
