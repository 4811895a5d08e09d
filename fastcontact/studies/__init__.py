"""Studies: mesh convergence, adaptive meshes, parameter sweeps, and the error of one solution."""
