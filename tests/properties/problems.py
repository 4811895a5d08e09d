"""Small random contact problems: two blocks pressed together, one with a crowned and tilted face."""

from dataclasses import dataclass

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from images import Image, Job, model_of
from stepping import Stepping
from two_bodies import boxes

import fastcontact as fc

FORMULATIONS = (("node_to_segment", ()), ("continuous", ()), ("mortar", ()), ("mortar", (("multipliers", "dual"),)))
FLAT, SOLIDS = ("tri3", "quad4", "tri6", "quad8", "quad9"), ("hex8", "tet4")
PLANES = ("plane_strain", "plane_stress", "axisymmetric")
E = 1000.0  # of the upper body


def examples(count: int) -> settings:
    """Return settings for `count` examples where a profile asks for 100; see ``conftest.py`` and ``--hypothesis-profile``."""
    return settings(max_examples=max(1, count * settings.default.max_examples // 100), deadline=None)


@dataclass(frozen=True)
class Blocks:
    """A recipe. Lengths are parts of the width of the bodies; moduli are those of the upper body and a ratio."""

    kinematics: str = "plane_strain"
    element: str = "quad4"
    lower: tuple[int, ...] = (3, 2)
    upper: tuple[int, ...] = (4, 2)
    crown: float = 0.0
    tilt: float = 0.0
    contrast: float = 0.0  # decades by which the lower body is stiffer
    nu: tuple[float, float] = (0.3, 0.3)
    push: float = 0.01
    aside: float = 0.0  # part of the push
    formulation: tuple[str, tuple] = FORMULATIONS[0]
    friction: float = 0.0
    steps: int = 1
    matching: bool = False  # whether nodes may lie opposite to nodes

    @property
    def dim(self) -> int:
        """2 or 3."""
        return 3 if self.kinematics == "3d" else 2

    @property
    def stiffest(self) -> float:
        """The larger modulus, times the depth of the bodies where they have one [force / length]."""
        depth = {"axisymmetric": 2 * np.pi * 10, "3d": 10.0}.get(self.kinematics, 1.0)
        return E * max(1.0, 10.0**self.contrast) * depth

    @property
    def names(self) -> dict[str, str]:
        """Groups by what they are."""
        if self.dim == 3:
            return {"upper": "U_BOX", "lower": "L_BOX", "secondary": "U_ZMIN", "primary": "L_ZMAX"}
        return {"upper": "UPPER", "lower": "LOWER", "secondary": "CONT_UPPER", "primary": "CONT_LOWER"}

    def mesh(self) -> fc.Mesh:
        """Two blocks of width 10 and height 5, the lower face of the upper one bent and turned, its inside distorted."""
        if self.dim == 3:
            mesh = boxes(self.element, self.lower, self.upper)
        else:
            mesh = fc.generate.block_on_block(
                self.element, divisions_lower=self.lower, divisions_upper=self.upper, distortion=0.2
            )
        points = mesh.points.copy()
        x = points[mesh.points_of(self.names["upper"])]
        # Narrower, and off the middle where there is no axis: no node lies opposite to another one.
        if not self.matching:
            x[:, :-1] = 9.3 / 10 * x[:, :-1] + (0.0 if self.kinematics == "axisymmetric" else 0.43)
        across = (x[:, :-1] - (0.0 if self.kinematics == "axisymmetric" else 5.0)) / 10
        lift = self.crown * 4 * (across**2).sum(axis=1) + self.tilt * (across[:, 0] + 0.5)
        x[:, -1] += 10 * lift * (1 - x[:, -1] / 5)
        points[mesh.points_of(self.names["upper"])] = x
        return mesh.replace(points=points)

    def supports(self) -> tuple:
        """The lower body is held, the upper one is moved."""
        down = 10 * self.push
        if self.dim == 3:
            return ("L_ZMIN", (0.0, 0.0, 0.0)), ("U_ZMAX", (self.aside * down, 0.5 * self.aside * down, -down))
        if self.kinematics == "axisymmetric":
            axis = (("LOWER_LEFT", (0.0, None)), ("UPPER_LEFT", (0.0, None)))
            return (("LOWER_BOTTOM", (None, 0.0)), ("UPPER_TOP", (None, -down)), *axis)
        return ("LOWER_BOTTOM", (0.0, 0.0)), ("UPPER_TOP", (self.aside * down, -down))

    def job(self, swap: bool = False) -> Job:
        """The problem as data."""
        name, options = self.formulation
        sides = [self.names["secondary"], self.names["primary"]][:: -1 if swap else 1]
        options = {**dict(options), **({"friction": self.friction} if self.friction else {})}
        stiffer = (self.names["lower"],), E * 10.0**self.contrast, self.nu[1]
        return Job(
            self.mesh(), self.kinematics, ((*sides, name, options),), supports=self.supports(), steps=self.steps,
            materials=((None, E, self.nu[0]), stiffer),
        )  # fmt: skip


def hundredths(low: int, high: int) -> st.SearchStrategy[float]:
    """Return a strategy of numbers that are easy to read and to shrink."""
    return st.integers(low, high).map(lambda k: k / 100)


def recipes(friction: bool = False, kinematics: tuple[str, ...] = PLANES, elements: tuple[str, ...] = FLAT, **fixed):
    """Return a strategy of recipes; `fixed` takes the place of what would be chosen."""
    solid = kinematics == ("3d",)
    cells = st.tuples(*[st.integers(1, 3)] * 3) if solid else st.tuples(st.integers(1, 5), st.integers(1, 3))
    choices = {
        "kinematics": st.sampled_from(kinematics),
        "element": st.sampled_from(SOLIDS if solid else elements),
        "lower": cells, "upper": cells,
        "crown": hundredths(0, 5), "tilt": hundredths(-2, 2),
        "contrast": hundredths(-200, 200), "nu": st.tuples(*[hundredths(0, 45)] * 2),
        "push": st.integers(1, 30).map(lambda k: k / 1000), "aside": hundredths(-50, 50),
        "formulation": st.sampled_from(FORMULATIONS),
        "friction": hundredths(5, 40) if friction else st.just(0.0),
    }  # fmt: skip
    return st.builds(Blocks, **{**choices, **{name: st.just(value) for name, value in fixed.items()}})


def analysis_of(job: Job, ramp: fc.Ramp | None = None, solver: str = "direct", **criteria) -> Stepping:
    """Return the analysis of a job, before its first step."""
    return Stepping(model_of(job, Image())[0], solver, 1e-12, fc.Criteria(**criteria), ramp)


def carried(step: fc.StepResult, recipe: Blocks) -> bool:
    """Whether the bodies press on each other by more than round-off."""
    return step.contact["pair 0"].pressure_max > 1e-4 * E * recipe.push
