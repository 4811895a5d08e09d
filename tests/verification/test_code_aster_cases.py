"""code_aster's validation cases, read from folders of specs (``pytest --cases DIR``) and run through the public API.

Every tested value must lie within the tolerance of its spec, but for the `AMENDMENTS`: there the stated value is wrong, or
belongs to something else than the case, or its tolerance stands for something, or an exact method must do better; and
for `STOPPED`, where code_aster ends early. A case that needs what fastcontact does not have is skipped, with the name of
what is missing; so is one that states no value.
"""

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import aster_spec
import aster_values
import pytest
from aster_mesh import MissingError

import fastcontact as fc

SHARED = Path(__file__).resolve().parents[3] / "shared"
FOLDERS = SHARED / "cases", SHARED / "more-cases"
# Load on the slider of SSNV503, its coefficient of friction and the slope it lies on.
SLIDER_FORCE, SLIDER_FRICTION, SLOPE = 300.0 * 40.0 * 20.0, 0.3, math.radians(30.0)


@dataclass(frozen=True)
class Amendment:
    """What is known better than a spec states, and why; `of` says for which tests of which problem."""

    family: str
    why: str
    of: Callable[[dict[str, Any], aster_spec.Problem], bool]
    tolerance: float | None = None
    reference: float | None = None
    more: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Stopped:
    """A run whose geometry updates code_aster ends by its own rule, and how many those are."""

    name: str
    run: int
    updates: int
    why: str


def exactly(test, problem):
    """Mortar represents a uniform pressure without error."""
    return all(pair.formulation == "mortar" for pair in problem.model.contact)


def sliding_force(component, frame="GLOBAL"):
    """The resultant of the slider's contact is tested while it slides, along the axes or along its own line."""

    def of(test, problem):
        found = (test.get("extraction") or {}).get("REPERE", "GLOBAL")
        return (test["run"], test.get("table_column"), found) == (2, component, frame)

    return of


DISTANCE = (
    "DIST_APPA = 1 is measured to the nearest node of the master side in code_aster, 50 away on its one facet, so that it "
    "finds no contact: -20. We measure to the surface, which is 0 away: -9.1e-7, and -8.9e-7 with cells an eighth as long"
)
# SSNA122B, axis node M, without and with friction.
FINITE_STRAIN = (
    "the values belong to finite strain and a mesh that is coarse for its quadratic facets: DY is -0.13294 and -0.13079 in "
    "code_aster, -0.13268 and -0.13055 here, SIYY -94.12 and -95.47 against -94.03 and -95.41; by mortar on cells a "
    "quarter as long DY is -0.13385 and -0.13172, SIYY -87.1 and -88.6"
)
AMENDMENTS = [
    Amendment("ssnp170", "a uniform stress is exact on any mesh", exactly, tolerance=1e-10),
    Amendment("ssnp121", "a uniform pressure is exact for nu = 0", exactly, tolerance=1e-8),
    Amendment(
        "ssna122", FINITE_STRAIN,
        lambda test, problem: test["tolerance_is_default"], tolerance=2e-3,
    ),
    Amendment(
        "zzzz237", DISTANCE, lambda test, problem: test["run"] in (2, 3) and test["component"] == "DY", reference=0.0,
    ),
    Amendment(
        "ssnv503", "the limit of friction is 3600 a unit of width, not 3624", sliding_force("DX", "LOCAL"),
        reference=-12000.0 * SLIDER_FRICTION, tolerance=1e-3,
    ),
    Amendment(
        "ssnp154", "the mesh was moved back before this value was taken",
        lambda test, problem: test.get("field") == "PRES_NOEU" and test["reference_kind"] == "SOURCE_EXTERNE",
        more={"geometry": "reference"},
    ),
    Amendment(
        "ssnv503", "the limit of friction is 3600 a unit of width, not 3624", sliding_force("DX"),
        reference=-SLIDER_FORCE * (math.sin(SLOPE) + SLIDER_FRICTION * math.cos(SLOPE)), tolerance=1e-3,
    ),
    Amendment(
        "ssnv503", "the limit of friction is 3600 a unit of width, not 3624", sliding_force("DY"),
        reference=SLIDER_FORCE * (math.cos(SLOPE) - SLIDER_FRICTION * math.sin(SLOPE)), tolerance=1e-3,
    ),
]  # fmt: skip


STOPPED = [
    Stopped(
        "ssnv104d", 0, 3,
        "code_aster stops where an update changes the displacement by less than 1 %: after three updates a step SIYY at N291 "
        "is -4647.96 at the end, where it computes -4648.04; settled it is -4703.27, 6.3 % from Hertz in place of 5.0 %. A "
        "finer mesh has no such value: N291 is held by itself (-8330, then -20551); at N55, held too, it is -4632 with "
        "cells a quarter as long",
    ),
]  # fmt: skip
# These cases go beyond small strain, mix materials, and leave facets beside the axis out of their sides, on purpose; any
# other warning is an error.
ON_PURPOSE = (
    "the largest equivalent strain",
    "the largest rotation",
    "Young's moduli differ by a factor of 1e\\+07",
    "contact .* lacks facets",
    "contact .* deviate from their arcs",  # geometry as in code_aster
    "contact .* integration points of complete facets",  # integration as in code_aster
)


# The first secondary node stands beyond the first primary one, since the facets at the axis belong to no side: it faces the
# last facet gone on straight, so that forces balance in moment; code_aster projects it on that facet's end.
AT_THE_END = pytest.mark.xfail(
    strict=True,
    reason="code_aster projects a node beyond the end of the master side on that end, which leaves a moment. SIYY at N55 in "
    "M293, Hertz's within 15 %: in the first step Hertz -1978.7, code_aster -2259.9, here -2349.1, and -2026 with cells a "
    "quarter as long; in the last one -4424.5, -5063.9, -5254.1 and -4578. Other values at N55 pass. At N291, which is "
    "held by itself, nothing converges (-1946, -3643, -8805 with shorter and shorter cells)",
)


def pytest_generate_tests(metafunc):
    if "spec_and_run" not in metafunc.fixturenames:
        return
    cases = []
    for folder in metafunc.config.getoption("--cases") or FOLDERS:
        found = [
            pytest.param((path, run), id=f"{path.stem}-{run}", marks=marks_of(path, run))
            for path, run in aster_spec.specs(folder)
        ]
        absent = pytest.mark.skip(reason=f"there are no specs in {folder}")
        cases += found or [pytest.param(None, id=f"none-{folder.name}", marks=absent)]
    metafunc.parametrize("spec_and_run", cases)


def marks_of(path, run):
    """Return the marks of a run: further runs of a spec are slow, and some have values decided beyond the end of a side."""
    at_the_end = path.stem == "ssnv104d" and run in (0, 2)
    return [*([pytest.mark.slow] if run else []), *([AT_THE_END] if at_the_end else [])]


def test_values_lie_within_the_tolerances_of_code_aster(spec_and_run):
    verdicts, missing = verdicts_of(*spec_and_run)
    wrong = [str(verdict) for verdict in verdicts if not verdict.ratio <= 1.0]
    assert not wrong, f"{len(wrong)} of {len(verdicts)} values deviate:\n" + "\n".join(wrong)
    if missing:
        pytest.skip(f"{len(verdicts)} values agree; {len(missing)} not tested: {'; '.join(dict.fromkeys(missing))}")
    if not verdicts:
        pytest.skip("the spec states no value with a reference")


def verdicts_of(path, run):
    """Return the verdicts on all values of a run that have a reference, and what is missing for others."""
    try:
        problem = aster_spec.problem(path, run)
        with warnings.catch_warnings():
            for beginning in ON_PURPOSE:
                warnings.filterwarnings("ignore", beginning, fc.FastcontactWarning)
            steps = aster_spec.solve(stopped_as_in_code_aster(problem))
    except MissingError as reason:
        pytest.skip(str(reason))
    verdicts, missing = [], []
    for test in problem.spec["tests"]:
        if test["run"] == run and test["value_reference"] is not None:
            try:
                verdicts.append(aster_values.verdict(*amended(test, problem), problem, steps))
            except MissingError as reason:
                missing.append(str(reason))
    return verdicts, missing


def amended(test, problem):
    """Return the test with what is known better than it states."""
    reference, tolerance = test["value_reference"], test["tolerance"]
    for amendment in AMENDMENTS:
        if problem.spec["family"] == amendment.family and amendment.of(test, problem):
            reference = reference if amendment.reference is None else amendment.reference
            tolerance = tolerance if amendment.tolerance is None else amendment.tolerance
            test = {**test, **amendment.more}
    return test, reference, tolerance


def stopped_as_in_code_aster(problem):
    """Return the problem, with the number of geometry updates after which code_aster stops where that shows."""
    for stop in STOPPED:
        if (problem.spec["name"], problem.run["run"]) == (stop.name, stop.run):
            return replace(problem, criteria=fc.Criteria(geometry_updates=stop.updates))
    return problem
