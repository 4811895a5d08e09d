"""code_aster's validation cases, read from a folder of specs (``pytest --cases DIR``) and run through our interface.

Every tested value must lie within the tolerance of its spec, but for the `AMENDMENTS`: there the spec itself says that
the stated value is wrong, or what its tolerance stands for, or that an exact method must do better. A case that needs
what fastcontact does not have is skipped, with the name of what is missing.
"""

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import aster_spec
import aster_values
import pytest
from aster_mesh import MissingError

import fastcontact as fc

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


def exactly(test, problem):
    """Mortar represents a uniform pressure without error."""
    return all(pair.formulation == "mortar" for pair in problem.model.contact)


def sliding_force(component):
    """The resultant of the slider's contact is tested while it slides."""
    return lambda test, problem: test["run"] == 2 and test.get("table_column") == component


AMENDMENTS = [
    Amendment("ssnp170", "a uniform stress is exact on any mesh", exactly, tolerance=1e-10),
    Amendment("ssnp121", "a uniform pressure is exact for nu = 0", exactly, tolerance=1e-8),
    Amendment(
        "ssna122", "the value belongs to finite strain, from which small strain differs by 0.2 %",
        lambda test, problem: test["tolerance_is_default"], tolerance=2e-3,
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


def pytest_generate_tests(metafunc):
    if "spec_and_run" not in metafunc.fixturenames:
        return
    folder = metafunc.config.getoption("--cases")
    found = list(aster_spec.specs(folder))
    absent = pytest.param(None, id="none", marks=pytest.mark.skip(reason=f"there are no specs in {folder}"))
    cases = [pytest.param((path, run), id=f"{path.stem}-{run}") for path, run in found]
    metafunc.parametrize("spec_and_run", cases or [absent])


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
            # These cases go beyond small strain on purpose; any other warning is an error.
            warnings.filterwarnings("ignore", "the largest equivalent strain", fc.FastcontactWarning)
            steps = aster_spec.solve(problem)
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
