"""The model of a contact problem: a mesh with kinematics, materials, supports, loads and contact pairs."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.html_table import html_table
from fastcontact.arrays import Array, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.elasticity.constrained_system import ConstrainedMotion
from fastcontact.elasticity.multipoint_constraints import TemporaryConstraint
from fastcontact.elasticity.varying_constants import is_along_radius
from fastcontact.errors import ModelError
from fastcontact.heat.loads import TemporaryHeat
from fastcontact.model import rigid_motions
from fastcontact.model.checks import check_motions, check_overlap, check_penetration, check_ramps, check_supports
from fastcontact.model.contact_pair import check_rotations
from fastcontact.model.description import sentences
from fastcontact.model.parts.supports import ModelSupports
from fastcontact.model.prescribed_overlap import Supports, check_prescribed
from fastcontact.model.pretension import check_locks
from fastcontact.model.ramp import PartHistory, Ramp, combined, multiplier
from fastcontact.model.rigid_motions import FreeMotions, cone_rows, free_motions, generalised_forces, mechanisms

# Types of items that may act in only some of the load steps.
TEMPORARY = (TemporaryConstraint, TemporaryHeat)
# Public methods and attributes of a model besides `add_...`. `dir` lists only these; the analysis uses further ones.
PUBLIC = (
    "check", "contact", "couple", "describe", "fix", "fix_temperature", "internal_forces", "kinematics", "loads", "materials",
    "mesh", "prescribe", "relate", "relate_groups", "strain", "supports", "units",
)  # fmt: skip


def _public(names: Iterable[str]) -> list[str]:
    return sorted(name for name in names if name in PUBLIC or name.startswith(("__", "add_")))


class _PublicNames(type):
    """Metaclass of a class whose `dir` lists the public names only."""

    def __dir__(cls) -> list[str]:
        return _public(super().__dir__())


@typed(ModelError)
class Model(ModelSupports, metaclass=_PublicNames):
    """A contact problem of elastic or elastoplastic bodies.

    Each method checks its arguments, and `check` checks the complete model. A check that fails raises MeshError, ModelError
    or ContactError, whose message states the cause and the remedy in one line.

    Prescribed values are numbers, or functions from reference positions (n, dim) [length] to numbers (n,). They are
    multiplied by a history, a piecewise linear function of the load factor. The parameter `ramp` of many methods gives
    an item a separate history, as pairs (load factor, multiplier) or as a `Ramp`, whose load steps are ignored. By
    default all items have the history of the analysis, see `solve`. Normals and areas refer to the reference
    configuration unless stated otherwise.

    Parameters
    ----------
    mesh : Mesh
        Mesh of all bodies.
    kinematics : {"plane_strain", "plane_stress", "axisymmetric", "3d"}
        In axisymmetry x is the radius and y the axis, and the radial displacement on the axis is fixed at zero.
    case_text : str
        Text that result files store, usually the case file.
    strain : {"small", "finite"}
        If ``"finite"``, strains and rotations may be large (total Lagrangian formulation). Admissible materials
        are then hyperelastic ones such as `NeoHookean`, the elastic-plastic `ElasticPlastic`, and `LinearElastic`, which is
        interpreted as the Saint Venant-Kirchhoff law for small strains and large rotations. Pressures follow the deformed
        surface; other loads keep their directions and reference areas. Stresses are Cauchy stresses.
    reference_temperature : float
        Initial temperature of the bodies, at which the thermal strain is zero, unless `add_temperature` specifies
        another one [temperature].
    units : str or mapping of str to str, optional
        Names of the units of length, force and pressure, either in this order as a string such as ``"mm, N, MPa"``, or by
        the keys ``"length"``, ``"force"`` and ``"pressure"``. Tables, reports, plots and result files show them, and a
        warning is given if force / length^2 is not the unit of pressure. Computed numbers do not depend on them.

    Examples
    --------
    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.half_spheres(size=10.0), kinematics="axisymmetric")
    >>> model.add_material(fc.LinearElastic(E=20_000.0, nu=0.3))
    >>> model.fix("A1A2", "x")
    >>> model.prescribe("A2B2", y=-2.0)
    >>> model.prescribe("A1B1", y=+2.0)
    >>> model.add_contact("hertz", secondary="CONT1", primary="CONT2")
    """

    def __repr__(self) -> str:
        pairs = ", ".join(f"{p.name}: {p.secondary} on {p.opposite}, {p.method}" for p in self.contact)
        return f"Model({self.kinematics}, {self.mesh!r}, {self.n_dofs} degrees of freedom; contact: {pairs or 'none'})"

    def __dir__(self) -> list[str]:
        return _public(super().__dir__())

    def _repr_html_(self) -> str:
        """Return `describe` as a table for notebooks."""
        head, *lines = sentences(self)
        rows = [sentence.split(": ", 1) for sentence in lines if ": " in sentence]
        return html_table(rows, caption=head)

    def describe(self) -> str:
        """Return a description of the model, with a line for the kinematics and for each material, support, load and pair.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_material(fc.LinearElastic(E=210_000.0, nu=0.3))
        >>> model.fix("BOTTOM", "xy")
        >>> print(model.describe())
        A model in plane strain (forces are those for a depth of 1) of 25 points, 16 quad4: 50 degrees of freedom.
        Material: E = 210000, nu = 0.3 in all solid cells.
        Support: x = 0, y = 0 on 'BOTTOM' (5 points).
        Contact: none.
        ...
        """
        return "\n".join(sentences(self))

    def check(self, ramp: Ramp | None = None) -> None:
        """Check the complete model, and the consistency of its histories with the load steps; `solve` calls this method.

        Parameters
        ----------
        ramp : Ramp, optional
            Load steps of the analysis. By default the histories are not checked.

        Raises
        ------
        MeshError, ModelError, ContactError
            If the model is incomplete or contradictory; the message states the cause and the remedy in one line.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_material(fc.LinearElastic(E=210_000.0, nu=0.3))
        >>> model.fix("BOTTOM", "y")
        >>> model.check()
        Traceback (most recent call last):
            ...
        fastcontact.errors.ModelError: 1 rigid-body motion is not restrained: body 'BLOCK': translation along x. ...
        """
        self.material_numbers()
        items: list[Any] = [*self.supports, *self.loads, *self.relations]
        items += [*self.temperatures, *self.initial_states, *self.heat_loads]
        if self.kinematics == "axisymmetric":
            named_items = [(item.name, item) for item in items]
            named_items += [(f"the material with {material.described}", material) for material, _ in self.materials]
            named_items += [(f"contact '{pair.name}'", pair) for pair in self.contact]
            for name, item in named_items:
                if is_along_radius(item):
                    raise ModelError(f"{name}: in axisymmetry the radius is x: use a table along x instead of radius")
        if self.initial_states:
            self.refuse_nonlinear("initial stresses and strains are")
        fixed, prescribed = self.prescribed_by_ramp()
        self._log_axis_nodes()
        forces = self.forces_by_ramp()
        self.thermal_forces_by_ramp()
        self._check_each_temporary_set(self._check_heat_of)
        if ramp is not None:
            ramps = [(item.name, item.ramp) for item in items]
            ramps += [(f"the motion of obstacle '{p.name}'", p.ramp) for p in self.contact]
            ramps += [(f"the clearance of contact '{p.name}'", p.clearance_ramp) for p in self.contact]
            ramps += [(f"the friction of contact '{p.name}'", p.friction_ramp) for p in self.contact]
            ramps += [(f"the fluid in contact '{p.name}'", p.fluid.ramp) for p in self.contact if p.fluid is not None]
            ramps += [(f"the rotation of '{s.group}'", s.rotation_ramp) for s in self.supports]
            ramps += [(f"the rotation of obstacle '{p.name}'", p.rotation_ramp) for p in self.contact]
            check_ramps(ramps, ramp.instants)
            check_rotations(self.contact, ramp)
            check_locks(self.pretensions, ramp.instants)
        self._check_relations(fixed, prescribed, ramp or Ramp((1.0,)))
        check_supports(self.mesh, [(s.name, s.group) for s in self.supports], self.related_points())
        bound_pairs = [(pair, self.bind(pair)) for pair in self.contact]
        for pair, formulation in bound_pairs:
            check_penetration(pair.name, formulation)
        check_prescribed(bound_pairs, Supports(fixed, prescribed, ramp or Ramp((1.0,))))
        sides = [(p.secondary, p.primary) for p in self.contact if p.obstacle is None]
        check_overlap(self.mesh, self.kinematics, sides)
        nodal_forces = list(self.force_driven.forces(forces).values())
        self._check_each_temporary_set(lambda model: model._check_motions(fixed, nodal_forces))

    def _check_each_temporary_set(self, check: Callable[[Model], None]) -> None:
        """Call `check` once for every set of temporary items that act together, with a model that has no other such items."""
        temporary = [item for item in (*self.relations, *self.heat_loads) if isinstance(item, TEMPORARY)]
        starts = {0.0, *(t for item in temporary for t in (item.begins, item.ends) if 0.0 < t < np.inf)}
        for begin in sorted(starts):
            try:
                check(self._model_of_step(begin))
            except ModelError as error:
                raise ModelError(f"in the load steps after {begin:g}: {error}" if begin else str(error)) from None

    def _check_heat_of(self, model: Model) -> None:
        """Check the heat conduction problem of `model`, which contains the temporary items of some load steps only."""
        model.check_heat()
        if self.conducts and not model.conducts:
            raise ModelError(
                "no heat load acts, so the temperatures are undetermined: add a film condition (convection)"
            )

    def _model_of_step(self, begin: float) -> Model:
        """Return a copy of the model with only the items that act in the load step that begins at the load factor `begin`."""
        model = copy.copy(self)
        model.relations = [r for r in self.relations if not isinstance(r, TemporaryConstraint) or r.acts_from(begin)]
        model.heat_loads = [h for h in self.heat_loads if not isinstance(h, TemporaryHeat) or h.acts_from(begin)]
        return model

    def _check_relations(self, fixed: Mask, prescribed: Mapping[PartHistory, Array], ramp: Ramp) -> None:
        """Raise ModelError if multi-point constraints contradict each other or a support at an instant of `ramp`."""
        relations = [relation for relation in self.relations if not isinstance(relation, TemporaryConstraint)]
        if not relations:
            return
        motion = ConstrainedMotion(fixed.ravel(), relations)
        for instant in ramp.instants:
            displacement = combined(prescribed, ramp, instant, fixed.shape)
            motion.lift(displacement.ravel(), [multiplier(r.ramp, ramp, instant) for r in relations])

    def _check_motions(self, fixed: Mask, forces: Sequence[Array]) -> None:
        """Raise ModelError if a rigid-body motion is possible.

        Supports, constraints and springs prevent rigid-body motions. Contact prevents motions that close a gap. A motion
        that opens a gap is also accepted if a load does work in it, since this load may press the body against the contact.
        """
        motions = self.force_driven.motions(free_motions(self.mesh, self.kinematics, fixed, self.constraint_rows()))
        if not len(motions):
            return
        work = np.reshape([generalised_forces(motions, force.ravel()) for force in forces], (-1, len(motions)))
        # Whether friction suffices is checked in the load steps, whose errors state the coefficient that would suffice.
        gaps = gap_changes(self, motions, rigid_motions.LARGEST_FRICTION_FACTOR)
        unstopped = mechanisms(gaps, work, motions.simple)
        check_motions(self.mesh, motions.combined(unstopped), rigid_motions.tipping(motions, gaps, work.sum(axis=0)))


def gap_changes(model: Model, motions: FreeMotions, factor: float = 1.0) -> Array:
    """Return the changes (m, k) of the m gaps of the undeformed bodies for each of k rigid-body motions.

    A constraint with friction is represented by the edges of its friction cone, see `cone_rows`; `factor` multiplies all
    coefficients of friction.
    """
    obstacles, initial, zero = model.force_driven, Configuration.undeformed(model.mesh.points), np.zeros(model.mesh.dim)
    contact = [obstacles.constraints(pair.name, model.bind(pair).constraints(initial), zero) for pair in model.contact]
    rows = [cone_rows(constraints, factor)[0] @ motions.displacement for constraints in contact]
    return np.vstack([*rows, np.empty((0, len(motions)))])
