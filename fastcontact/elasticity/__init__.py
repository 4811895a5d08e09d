"""Linear elasticity on a mesh: materials, stiffness, stresses, loads, springs, linear relations."""
