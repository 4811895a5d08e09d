"""What all direct solvers share: right-hand sides and equations by the factors of the matrix."""
