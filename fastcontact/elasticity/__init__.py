"""Elasticity on a mesh: materials, stiffness, stresses, loads, springs, multi-point constraints."""
