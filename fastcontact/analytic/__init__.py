"""Closed-form solutions of contact mechanics.

Each module contains a theory, or a group of related ones, as frozen result classes and functions that return instances of
them. `THEORIES` contains the functions that case files can name. Most normal contacts have `radius` (the half-width in plane
problems), `force`, `pressure_max` and `pressure(distance)`. Units are those of the caller; forces of plane problems are per
unit length.

Positions are numbers or arrays of any shape (...), and results have the same shape, followed by the components of
vectors and tensors. ModelError is raised if a number is out of range, or if not exactly one load is given where one is
required.
"""

from __future__ import annotations

from fastcontact._tools.lazy import lazy_names

__getattr__, __dir__, __all__ = lazy_names(__name__)
