"""The linear solvers that a user can name: one file each, with a class ``SOLVER``."""
