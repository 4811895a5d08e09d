"""Linear solvers: one matrix, many right-hand sides, linear equations among the unknowns."""
