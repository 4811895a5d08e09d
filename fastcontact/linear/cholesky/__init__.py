"""A sparse Cholesky factorisation that keeps the unknowns of the contact surfaces last."""
