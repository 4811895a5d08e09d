"""Common part of direct solvers: right-hand sides and constraints by the factors of the matrix."""
