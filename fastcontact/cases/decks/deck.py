"""Input decks of Abaqus and CalculiX, which `read_deck` converts to a model with load steps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.html_table import html_table
from fastcontact._tools.paths import PathLike, existing_file
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.kinematics_warnings import largest_rotation, largest_strain
from fastcontact.analysis.resultants import multipliers
from fastcontact.analysis.run import solve_steps
from fastcontact.arrays import Array, Numbers
from fastcontact.cases.decks.blocks import Location, key_of, read_blocks
from fastcontact.cases.decks.building import Building
from fastcontact.cases.decks.content import Content
from fastcontact.cases.decks.keywords import read_content
from fastcontact.elasticity.multipoint_constraints import TemporaryConstraint
from fastcontact.errors import ContactError, FileError, MeshError, ModelError, warn
from fastcontact.mesh.mesh import ROTATION
from fastcontact.model.model import Model
from fastcontact.model.ramp import Ramp, table_value
from fastcontact.results.step import StepResult, Steps

# Attributes of `ContactResult` that are proportional to the thickness of a plane model.
EXTENSIVE_FIELDS = ("force", "force_vectors", "fluid_force_vectors", "dissipation", "primary_force_vectors")


@dataclass(frozen=True, eq=False)
class Deck:
    """Model and load steps of an input deck of Abaqus or CalculiX.

    Attributes
    ----------
    path : pathlib.Path
        Path of the deck.
    title : str
        First line of ``*HEADING``, or the name of the file without suffix.
    model : Model
        Model of the deck. Contact pairs are named ``SECONDARY/PRIMARY``, and groups have the names of the sets and
        surfaces of the deck. Plane models have unit thickness, and supports on local axes or with a limited period are
        multi-point constraints. Results of `fastcontact.solve` refer to this model: `StepResult.reference_reactions` lacks
        the forces of these constraints, and `reaction` includes those of couplings. `finished` converts such results to
        those of `Deck.solve`.
    ramp : Ramp
        Load steps. Step k of the deck ends at load factor k.
    criteria : Criteria
        Convergence criteria.
    notes : tuple of str
        Notes on keywords and parameters that have no effect, or whose meaning differs from Abaqus or CalculiX.
    thickness : float
        Thickness of a plane model [length]. `solve` returns forces for the whole thickness.
    modes : dict, optional
        Arguments of `fastcontact.modes` at the last step, from ``*FREQUENCY``; None without it.
    building : Building
        Correspondence between the nodes, supports and gap elements of the deck and those of the model.

    Examples
    --------
    See `read_deck`.

    >>> import fastcontact as fc
    >>> deck = fc.read_deck("press-fit.inp")  # doctest: +SKIP
    >>> steps = deck.solve()  # doctest: +SKIP
    """

    path: Path
    title: str
    model: Model
    ramp: Ramp
    criteria: Criteria
    notes: tuple[str, ...]
    thickness: float = 1.0
    modes: dict[str, Any] | None = None
    building: Building = field(repr=False, kw_only=True)

    def _repr_html_(self) -> str:
        """Return the title, the notes and the model as HTML tables for notebooks."""
        return html_table([("note", text) for text in self.notes], caption=self.title) + self.model._repr_html_()

    def solve(self, **options: Any) -> Steps:
        """Solve all steps.

        Parameters
        ----------
        **options
            Options of `fastcontact.solve_steps` except `resume`.

        Returns
        -------
        Steps
            Load steps; step k of the deck ends at load factor k. Displacements are along the global axes. Reactions [force]
            are those of supports, without the forces of equations and couplings. Forces of plane models are for the whole
            thickness.

        Warns
        -----
        FastcontactWarning
            If the deck requests NLGEOM but small strains are assumed. The warning states the largest strain and rotation,
            whose squares linear kinematics neglect. Other warnings, and all errors, are those of `fastcontact.solve`.
        """
        steps = Steps()
        for step in self.solve_steps(**options):
            if steps:
                steps[-1] = replace(steps[-1], restart=None)
            steps.append(step)
        return steps

    def solve_steps(self, **options: Any) -> Iterator[StepResult]:
        """Yield the results of `solve` step by step, as `fastcontact.solve_steps` does."""
        for step in solve_steps(self.model, self.ramp, **{"criteria": self.criteria, **options}):
            yield self.finished(step)

    def points_of(self, name: str) -> Numbers:
        """Return the sorted point numbers (n,) of a node set.

        Parameters
        ----------
        name : str
            Name of the set, in upper or lower case; ``Instance.set`` for a set of a part.

        Raises
        ------
        MeshError
            If the set does not exist.
        """
        names = {group.upper(): group for group in reversed([*self.model.mesh.point_groups])}
        return self.model.mesh.points_of(names.get(key_of(name), name))

    def point(self, number: int | str) -> int:
        """Return the point number of a node of the deck.

        Parameters
        ----------
        number : int or str
            Node number in the deck; ``"Instance.number"`` for a node of a part.

        Raises
        ------
        MeshError
            If the node does not exist.
        """
        assembly = self.building.assembly
        scope, label = assembly.split_name(str(number))
        if not label.isdecimal() or int(label[:19]) not in assembly.index[scope]:
            raise MeshError(f"node '{number}' is not defined in '{self.path.name}'")
        return assembly.index[scope][int(label[:19])]

    def finished(self, step: StepResult) -> StepResult:
        """Return a step of the model as a step of the deck, with the reactions and forces that `solve` describes."""
        reaction = self._support_reactions(step.reaction, float(np.nextafter(step.load_factor, -np.inf)))
        for name, ends in self.building.gap_ends.items():
            contact = step.contact[name]
            for point, force in zip(contact.points.tolist(), contact.force_vectors, strict=True):
                reaction[ends[point]] += force
        displacement = step.displacement.copy()
        for component, table in self.building.prescribed_motions.items():
            displacement[component] = table_value(table, step.load_factor)
        step = replace(step, displacement=displacement)
        if self.building.content.steps and step.load_factor == self.ramp.instants[-1]:
            self._warn_of_large_strains(step)
        thickness, mesh = self.thickness, self.model.mesh
        references = {
            name: {
                "force": (thickness * reaction[mesh.point(name)]).tolist(),
                "moment": (thickness * reaction[mesh.point(name + ROTATION), : 2 * mesh.dim - 3]).tolist(),
            }
            for name in mesh.point_groups
            if name + ROTATION in mesh.point_groups
        }
        iterations = step.iterations | ({"reference_reactions": references} if references else {})
        if thickness == 1.0:
            return replace(step, reaction=reaction, iterations=iterations)
        contacts = {}
        for name, contact in step.contact.items():
            values = ((key, getattr(contact, key)) for key in EXTENSIVE_FIELDS)
            contacts[name] = replace(contact, **{key: thickness * value for key, value in values if value is not None})
        sums = [name for name in ("work", "heat") if step.iterations.get(name)]
        iterations |= {name: _scaled(thickness, step.iterations[name]) for name in sums} | {"thickness": thickness}
        if step.pretension:
            sections = step.pretension.items()
            iterations["pretension"] = {name: {**s, "force": thickness * s["force"]} for name, s in sections}
        heat = None if step.heat_reaction is None else thickness * step.heat_reaction
        reaction = thickness * reaction
        return replace(step, reaction=reaction, contact=contacts, iterations=iterations, heat_reaction=heat)

    def _support_reactions(self, reaction: Array, instant: float) -> Array:
        """Return the reactions (n_points, dim) [force] at supports, without the forces of multi-point constraints.

        The Lagrange multipliers of the constraints follow from the reactions at components without a support.
        """
        constraints = self.model.relations[len(self.building.local_supports) :]
        if not constraints:
            return reaction.copy()
        supported = self.model.prescribed()[0].ravel()
        for support in self.building.local_supports:
            if not isinstance(support, TemporaryConstraint) or support.acts_from(instant):
                supported[support.rows.indices] = True
        rows = [constraint.rows for constraint in constraints]
        forces = multipliers(reaction.ravel(), rows, supported)
        constraint_forces = sum((R.T @ force for R, force in zip(rows, forces, strict=True)), np.zeros(supported.size))
        return reaction - constraint_forces.reshape(reaction.shape)

    def _warn_of_large_strains(self, step: StepResult) -> None:
        """Warn, with the largest equivalent strain and rotation, if the deck has NLGEOM but small strains were assumed."""
        if not self.building.small_strain_cause:
            return
        nonlinear = next(s for s in self.building.content.steps if s.nonlinear)
        strain, (angle, _) = largest_strain(self.model, step), largest_rotation(self.model.mesh, step.displacement)
        warn(
            f"{nonlinear.location}: NLGEOM, but small strains and rotations were assumed; the equivalent strain is up to "
            f"{strain:.3g} and the rotation up to {angle:.3g} rad, whose squares linear kinematics neglect"
        )


@typed(FileError)
def read_deck(path: PathLike) -> Deck:
    """Read an input deck of Abaqus or CalculiX.

    Static and steady heat transfer steps of elastic, elastic-plastic and hyperelastic bodies in contact are supported, and a
    final step with natural frequencies. Each keyword and parameter is translated, listed in a note because it has no effect,
    or rejected with an error. Included files must be in the folder of the deck or below.

    Parameters
    ----------
    path : path-like
        Path of the deck.

    Returns
    -------
    Deck
        Model and load steps.

    Raises
    ------
    CaseError
        If the deck is invalid or requires an unsupported feature; the message names file, line and keyword.
    FileError
        If a file cannot be read.
    FastcontactError
        If the model is invalid.

    Warns
    -----
    FastcontactWarning
        If a step has NLGEOM but small strains are assumed, for example because of couplings.

    Examples
    --------
    >>> deck = read_deck("flange.inp")                         # doctest: +SKIP
    >>> steps = deck.solve()                                   # doctest: +SKIP
    >>> steps[-1].reaction[deck.points_of("FLOOR")].sum(axis=0)  # doctest: +SKIP
    """
    file = existing_file(path)
    content = read_content(read_blocks(file))
    if not content.steps:
        raise Location(file.name, 1, "STEP").error("the deck has no step, so nothing is loaded")
    try:
        building = Building(content, f"# from the deck {file.name}\n")
    except (ModelError, MeshError, ContactError) as error:
        raise type(error)(f"{file.name}: {error}") from error
    if building.small_strain_cause:
        step = next(step for step in content.steps if step.nonlinear)
        warn(
            f"{step.location}: NLGEOM: with {building.small_strain_cause} small strains and rotations are assumed; the "
            "result is valid only while they stay small, and a warning after the solution reports how large they are"
        )
    return Deck(
        path=file,
        title=content.title or file.stem,
        model=building.model,
        ramp=building.ramp,
        criteria=Criteria(),
        notes=_notes(content, building.thickness),
        thickness=building.thickness,
        modes=content.modes,
        building=building,
    )


def _scaled(factor: float, sums: Mapping[str, Any]) -> dict[str, Any]:
    """Return sums of work or power, which may be nested by name, times a factor; the count `exchanges` is unchanged."""
    return {
        name: _scaled(factor, value) if isinstance(value, dict) else value if name == "exchanges" else factor * value
        for name, value in sums.items()
    }


def _notes(content: Content, thickness: float) -> tuple[str, ...]:
    """Return the notes of a deck without repetition, with those on output requests and on the thickness."""
    notes = list(dict.fromkeys(content.notes))
    requests = {location.keyword for location in content.outputs}
    if output := sorted(requests - {"CONTROLS"}):
        kinds = ", ".join(f"*{keyword}" for keyword in output)
        notes.append(f"{kinds}: no effect, the result file contains all output of all steps")
    if "CONTROLS" in requests:
        notes.append("*CONTROLS: no effect, the package has its own convergence criteria")
    if thickness != 1.0:
        notes.append(f"thickness {thickness:g}: the model has unit thickness, results are for the whole thickness")
    return tuple(notes)
