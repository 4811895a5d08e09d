"""Studies of mesh convergence, adaptive meshes, parameter sweeps, and errors of a solution."""
