"""Wear of the secondary nodes of a contact pair by slip.

By the law of Archard (J. Appl. Phys. 24, 1953), the wear depth is proportional to the product of pressure and sliding
distance. On quadratic facets the wear depth of each step is linear. In this module m is the number of secondary nodes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fastcontact.analysis.work import ContactForces
from fastcontact.arrays import Array, largest
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.integration import facet_measure, fine_rule
from fastcontact.contact.wear_compliance import WearCompliance
from fastcontact.mesh import elements
from fastcontact.results.step import ContactResult
from fastcontact.round_off import TINY


class Worn(NamedTuple):
    """Wear of a contact pair at the end of a load step.

    Attributes
    ----------
    depth, pressure : ndarray (m,)
        Wear depth at the secondary nodes [length], and the pressure there [pressure].
    largest_rate : float
        Largest ratio of the wear depth of a node in one step to its mean pressure in this step [length / pressure].
    passing : float
        Sum over nodes of the wear depths of load steps in which a moving contact reaches or leaves them [length].
    """

    depth: Array
    pressure: Array
    largest_rate: float = 0.0
    passing: float = 0.0

    @classmethod
    def nothing(cls, count: int) -> Worn:
        """Return zero wear for `count` nodes, the state before the first step."""
        return cls(np.zeros(count), np.zeros(count))

    def after(self, pair: Formulation, configuration: Configuration, result: ContactResult, coefficient: float) -> Worn:
        """Return the wear after one more load step; for parameters see `wear_depth_in_step`."""
        depth = wear_depth_in_step(pair, configuration, result, self.pressure, coefficient)
        mean = _linear_on_facets(pair, 0.5 * np.maximum(result.pressure + self.pressure, 0.0))
        largest_rate = np.divide(depth, mean, out=np.zeros_like(depth), where=mean > 0.0)
        change, one_end = result.pressure - self.pressure, (result.pressure > 0.0) != (self.pressure > 0.0)
        gained, lost = float(np.maximum(change, 0.0).sum()), float(np.maximum(-change, 0.0).sum())
        passing = float(depth[one_end].sum()) * min(gained, lost) / max(gained, lost, TINY)
        largest_rates = max(self.largest_rate, float(largest_rate.max(initial=0.0)))
        return Worn(self.depth + depth, result.pressure, largest_rates, self.passing + passing)


def wear_depth_in_step(
    pair: Formulation, configuration: Configuration, contact: ContactResult, earlier_pressure: Array | float,
    coefficient: float,
) -> Array:  # fmt: skip
    """Return the wear depth (m,) of a load step at the secondary nodes [length].

    Parameters
    ----------
    pair : Formulation
    configuration : Configuration
        Configuration at the end of the step.
    contact : ContactResult
        Contact result at the end of the step.
    earlier_pressure : ndarray (m,) or float
        Nodal pressures at the beginning of the step [pressure]. Wear without friction is computed with the mean of the
        pressures at the beginning and at the end, and the slip from the beginning of the step.
    coefficient : float
        Archard's coefficient divided by the hardness [1 / pressure].
    """
    if contact.sliding_load is not None:
        return coefficient * _linear_on_facets(pair, contact.sliding_load)
    pressure = np.maximum(contact.pressure + earlier_pressure, 0.0)
    return coefficient * 0.5 * _linear_on_facets(pair, pressure * _sliding_distance(pair, configuration, contact))


def wear_compliance(
    pair: Formulation, configuration: Configuration, contact: ContactResult, worn: Worn, forces: ContactForces,
    coefficient: float,
) -> WearCompliance:  # fmt: skip
    """Return the wear of a load step, linearised about a solution of the step.

    Parameters
    ----------
    pair : Formulation
    configuration, contact, coefficient
        See `wear_depth_in_step`.
    worn : Worn
        Wear at the end of the step for this solution.
    forces : ContactForces
        Contact forces of the solution.
    """
    slope = 0.5 * coefficient * _sliding_distance(pair, configuration, contact)
    return WearCompliance(worn.depth, worn.pressure, slope, contact.coordinates, forces.pressure, forces.positions)


def wear_work(depth: Array, earlier_depth: Array, forces: ContactForces, before: ContactForces | None) -> float:
    """Return the work of the normal forces in a load step on the increase of the wear depth (m,) [energy].

    `forces` and `before` are the contact forces at the end and at the beginning of the step, None before the first step. A
    node that a moving contact reaches or leaves wears only while its force acts, which is therefore not halved.
    """
    if before is None:
        return 0.0
    pressing = forces.pressing_with(before, 2.0) + before.pressing_with(forces, 2.0)
    return 0.5 * float(pressing @ (depth - earlier_depth))


def linearisation_error(pair: Formulation, wear: WearCompliance, after: WearCompliance) -> float:
    """Return the largest error of the depth that `wear` predicts for the next solution, with the wear `after` [length]."""
    linear_change = _linear_on_facets(pair, wear.slope * (after.nodal_pressure - wear.nodal_pressure))
    return largest(after.depth - wear.depth - linear_change)


def _sliding_distance(pair: Formulation, configuration: Configuration, contact: ContactResult) -> Array:
    """Return the sliding distances (m,) of the secondary nodes in a load step; zero where they stick [length]."""
    distance = np.linalg.norm(pair.nodal_slip(configuration), axis=1)
    return np.where(contact.sticking, 0.0, distance) if pair.friction else distance


def _linear_on_facets(pair: Formulation, values: Array) -> Array:
    """Return nodal values (m,) that are linear in the facets and have the integral of `values` (m,).

    Pressures at corners and mid-side nodes of quadratic facets differ by their scatter, which the wear would amplify in every
    step. The values at corners are means, weighted with the linear shape functions.
    """
    elements_of_blocks = [elements.get(block.element) for block in pair.secondary.blocks]
    if all(element.order == 1 for element in elements_of_blocks):
        return values
    integrals, areas, linear = np.zeros(len(values)), np.zeros(len(values)), np.empty_like(values)
    for block, element in zip(pair.secondary.blocks, elements_of_blocks, strict=True):
        xi, weights = fine_rule(block.element)
        N, corner_shape = element.shape(xi), element.corner_shape(xi)
        dA = facet_measure(block.facets, block.element, pair.points, xi, pair.axisymmetric) * weights
        corners = block.local[:, : corner_shape.shape[1]]
        np.add.at(integrals, corners, (dA * (values[block.local] @ N.T)) @ corner_shape)
        np.add.at(areas, corners, dA @ corner_shape)
    means = np.divide(integrals, areas, out=np.zeros_like(values), where=areas > 0.0)
    for block, element in zip(pair.secondary.blocks, elements_of_blocks, strict=True):
        shape = element.corner_shape(element.nodes)
        linear[block.local] = means[block.local[:, : shape.shape[1]]] @ shape.T
    return linear


def ratio_to_elastic_waves(pair: Formulation, worn: Worn) -> float:
    """Return the ratio of the wear per step to that which levels the shortest waves of the surface [-].

    Let h be the length of a facet edge, and E* the contact modulus. A wave of the gap with the wavelength 2 h causes
    pressures of ``pi E* / (2 h)`` times its amplitude (Johnson, Contact Mechanics, 1985, section 13.2). If half the product
    of `Worn.largest_rate` and this stiffness is 1, the wear of one step levels such waves. With a larger product, their
    pressures change sign in each step and decrease more slowly. For pressures at integration points, the stiffness is up to
    twice as large, so that the ratio is the product itself.
    """
    return worn.largest_rate * np.pi * pair.modulus / (2.0 * pair.smallest_node_spacing)
