"""Studies of many runs: mesh convergence with model error told from mesh error, and parameter sweeps."""
