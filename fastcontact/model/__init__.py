"""The description of a problem: materials, supports, loads and contact pairs, checked before any computation."""
