r"""Fit of the limit of a quantity under mesh refinement and of its order of convergence, with error bars.

The model of the values on meshes of size :math:`h_i` is

.. math:: v_i = L + C h_i^p (1 + s e_i)

with the limit L, the order p, a constant C and independent standard normal variables :math:`e_i`, so that s is the relative
scatter of the mesh error. For each order p the parameters L, C and s are integrated out (Bayesian linear regression with
weights :math:`h^{-2p}`; Zellner 1971, chapter 3), and the results for all orders are averaged, weighted by their evidence.
The prior of p is log-normal. The prior of s^2 has the weight of one and a half meshes, so that a chance agreement of few
meshes does not make the error bar too small. The first k meshes may be too coarse for a single power of h. The prior
probability of k is proportional to (1/2)^k, and at least three meshes are not too coarse. The error bar is the distance from
the median of L to the farther end of its 95 % interval. The reasons for these choices are in docs/theory/convergence.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastcontact.arrays import Array
from fastcontact.errors import CaseError
from fastcontact.round_off import ROUND_OFF

CONFIDENCE = 0.95
# Largest relative range of values that count as converged even if their changes do not decrease.
AGREEMENT = 1e-4
# Orders over which the results are averaged.
ORDERS = np.geomspace(0.4, 6.0, 81)
# Median of the prior of the order, and standard deviation of its logarithm.
PRIOR_ORDER, PRIOR_DEVIATION = 1.6, 0.35
# Relative scatter in the prior, and its weight in meshes.
PRIOR_NOISE, PRIOR_WEIGHT = 0.2, 1.5
# Ratio of the scatter of meshes that are too coarse to that of other meshes, and factor of the prior probability for each
# such mesh.
COARSE_NOISE, COARSE_PROBABILITY = 10.0, 0.5


@dataclass(frozen=True)
class Limit:
    """The limit of a quantity under mesh refinement.

    Attributes
    ----------
    value : float
        Estimated limit, in the unit of the quantity.
    uncertainty : float
        Half-width of the interval ``value - uncertainty`` to ``value + uncertainty``, which contains the limit with a
        probability of at least 95 %, in the unit of the quantity.
    order, order_uncertainty : float
        Fitted order of convergence with respect to the mesh size, and its standard deviation [-]; NaN if the values do not
        change.
    n_levels : int
        Number of meshes in the fit.
    converging : bool
        Whether the values converge: the last change is smaller than 0.9 times the median of the earlier changes, or smaller
        than 0.05 times the largest change, or the relative range of all values is at most 1e-4; in the last case, the
        uncertainty is at least this range. Otherwise a limit may not exist.
    """

    value: float
    uncertainty: float
    order: float
    order_uncertainty: float
    n_levels: int
    converging: bool

    def contains(self, value: float) -> bool:
        """Return whether `value` lies between ``self.value - uncertainty`` and ``self.value + uncertainty``."""
        return abs(value - self.value) <= self.uncertainty


def fit_limit(h: ArrayLike, values: ArrayLike) -> Limit:
    """Fit the limit and the order of convergence of a quantity, with the statistical model described in the module.

    Parameters
    ----------
    h : array_like (n,)
        Mesh sizes [length] in any order, which must be positive and distinct, with n >= 3.
    values : array_like (n,)
        Value of the quantity on each mesh, in the unit of the quantity; values that are not finite are omitted.

    Returns
    -------
    Limit

    Raises
    ------
    CaseError
        If there are fewer than three finite values, or mesh sizes are not positive and distinct.

    Examples
    --------
    >>> limit = fit_limit([4.0, 2.0, 1.0, 0.5], [17.0, 5.0, 2.0, 1.25])
    >>> limit.contains(1.0), round(limit.order)
    (True, 2)
    """
    size, value = _sorted_finite(h, values)
    changes = np.abs(np.diff(value))
    scale = float(changes.max())
    if scale <= ROUND_OFF * np.abs(value).max():
        return Limit(float(value[-1]), ROUND_OFF * float(np.abs(value).max()), np.nan, np.nan, len(value), True)
    x = size / np.exp(np.log(size).mean())
    floor = (ROUND_OFF * np.abs(value).max() / scale) ** 2
    y = (value - value[-1]) / scale
    distributions = [_limit_distributions(x, y, floor, coarse) for coarse in range(len(value) - 2)]
    centre, width, evidence = np.concatenate(distributions, axis=1)
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    low, middle, high = _quantiles(centre, width, weight, len(value) - 2 + PRIOR_WEIGHT)
    orders = np.tile(ORDERS, len(value) - 2)
    order = float(weight @ orders)
    decreasing = changes[-1] < max(0.9 * float(np.median(changes[:-1])), 0.05 * scale)
    value_range = float(np.ptp(value))
    agreeing = not decreasing and value_range <= AGREEMENT * np.abs(value).max()
    return Limit(
        value=float(value[-1] + scale * middle),
        uncertainty=max(float(scale * max(high - middle, middle - low)), value_range if agreeing else 0.0),
        order=order,
        order_uncertainty=float(np.sqrt(weight @ (orders - order) ** 2)),
        n_levels=len(value),
        converging=bool(decreasing or agreeing),
    )


def _sorted_finite(h: ArrayLike, values: ArrayLike) -> tuple[Array, Array]:
    """Return the mesh sizes with finite values in descending order, and these values.

    Raises CaseError if sizes or values are invalid, or if there are fewer than three finite values.
    """
    size, value = np.asarray(h, np.float64), np.asarray(values, np.float64)
    if size.shape != value.shape or size.ndim != 1:
        raise CaseError(f"mesh sizes and values must be lists of equal length, not {size.shape} and {value.shape}")
    finite = np.isfinite(value)
    size, value = size[finite], value[finite]
    if len(value) < 3:
        raise CaseError(f"a limit needs the values of at least 3 meshes, not {len(value)}: compute more levels")
    order = np.argsort(-size)
    size, value = size[order], value[order]
    if not size[-1] > 0 or (np.diff(size) >= 0).any():
        raise CaseError(f"the mesh sizes must be positive and all different, not {size.tolist()}")
    return size, value


def _limit_distributions(x: Array, y: Array, floor: float, coarse: int) -> Array:
    """Return location and scale of the Student distribution of the limit, and the log evidence, for each order (3, n_orders).

    `x` (n,) and `y` (n,) are normalised mesh sizes and values [-]. `floor`, the square of the round-off of the values, is
    added to the sum of squares, whose logarithm would otherwise be undefined for values without scatter. The first `coarse`
    meshes are assumed to be too coarse for a single power of the mesh size.
    """
    result = np.empty((3, len(ORDERS)))
    dof = len(x) - 2 + PRIOR_WEIGHT
    noise = np.where(np.arange(len(x)) < coarse, COARSE_NOISE, 1.0)
    # The density of each value that is assumed too coarse has the factor 1 / COARSE_NOISE.
    log_prior = coarse * np.log(COARSE_PROBABILITY / COARSE_NOISE)
    for i, p in enumerate(ORDERS):
        deviation = noise * x**p
        A = np.column_stack([1.0 / deviation, 1.0 / noise])
        inverse = np.linalg.inv(A.T @ A)
        solution = inverse @ (A.T @ (y / deviation))
        residual = y / deviation - A @ solution
        squares = residual @ residual + PRIOR_WEIGHT * (PRIOR_NOISE * solution[1]) ** 2 + floor
        evidence = 0.5 * np.log(np.linalg.det(inverse)) - 0.5 * dof * np.log(squares)
        evidence += log_prior - 0.5 * (np.log(p / PRIOR_ORDER) / PRIOR_DEVIATION) ** 2
        result[:, i] = solution[0], np.sqrt(squares / dof * inverse[0, 0]), evidence
    return result


def _quantiles(centre: Array, width: Array, weight: Array, dof: float) -> list[float]:
    """Return lower bound, median and upper bound of the central 95 % interval of a mixture of Student distributions.

    Each distribution has a `centre`, a `width` and a `weight` (n,), and `dof` degrees of freedom.
    """
    from scipy.optimize import brentq
    from scipy.special import stdtr

    def excess(value: float, probability: float) -> float:
        return float(weight @ stdtr(dof, (value - centre) / width)) - probability

    reach = 1e3 * width.max()
    low, high = centre.min() - reach, centre.max() + reach
    tail = 0.5 * (1.0 - CONFIDENCE)
    return [float(brentq(excess, low, high, args=(q,), xtol=1e-15)) for q in (tail, 0.5, 1.0 - tail)]


def step_orders(h: Sequence[float], values: Sequence[float], limit: float) -> list[float]:
    """Return the observed order of convergence (n,) [-] between each mesh and the previous one; the first is NaN.

    `h` (n,) [length] contains the mesh sizes, and `values` (n,) and `limit` are in the unit of the quantity. Unlike the
    fitted order, these orders are sensitive to the scatter of the values.
    """
    error = np.abs(np.asarray(values, np.float64) - limit)
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.log(error[:-1] / error[1:]) / np.log(np.asarray(h[:-1]) / np.asarray(h[1:]))
    return [float("nan"), *(float(step) if np.isfinite(step) else float("nan") for step in steps)]
