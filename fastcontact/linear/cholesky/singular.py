"""What is said of a matrix that cannot be factorised."""

from fastcontact.errors import ModelError


def singular() -> ModelError:
    """Return the error for a matrix with a pivot of zero."""
    return ModelError("the stiffness matrix is singular: support the rigid-body motions of every body")


def indefinite() -> ModelError:
    """Return the error for a matrix with a pivot below zero."""
    return ModelError("the stiffness matrix is not positive definite: check the material and the cells")
