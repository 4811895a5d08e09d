"""Krylov methods: those preconditioned by a multigrid cycle, and GMRES for small systems."""
