"""Krylov methods preconditioned by a multigrid cycle."""
