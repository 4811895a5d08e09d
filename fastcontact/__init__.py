"""fastcontact: fast, trustworthy elastic-contact finite elements.

Public names load when first used, so that ``import fastcontact`` costs next to nothing.
"""

from __future__ import annotations

import gc
import importlib
import logging
import os
from types import ModuleType
from typing import TYPE_CHECKING, Any

# Threads that wait for work sleep. Spinning is the default of GNU's OpenMP, and costs ten times the CPU time as soon as other
# processes want the same cores; threads of OpenBLAS spin, too, a tenth of a second as they are made. Both libraries look
# once: as the first parallel kernel runs, and as NumPy or SciPy are first imported.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "4")

__version__ = "0.1.0"
logging.getLogger(__name__).addHandler(logging.NullHandler())  # nothing on screen unless someone listens

if TYPE_CHECKING:
    from fastcontact import analytic, generate, obstacles, plot, recovery, topology
    from fastcontact.convergence import adaptive_study, convergence_study, parameter_sweep
    from fastcontact.criteria import Criteria
    from fastcontact.error_estimate import ErrorEstimate, estimate_error
    from fastcontact.error_norms import ErrorNorms, error_against
    from fastcontact.errors import (
        CaseError,
        ContactError,
        ConvergenceError,
        FastcontactError,
        FastcontactWarning,
        FileError,
        MeshError,
        ModelError,
    )
    from fastcontact.io.med import read_med_field, write_med_results
    from fastcontact.io.mesh_files import read_mesh, write_mesh
    from fastcontact.io.result_reader import open_results
    from fastcontact.io.result_writer import ResultWriter
    from fastcontact.io.tables import contact_table, line_table, write_csv
    from fastcontact.io.xmgrace import write_agr
    from fastcontact.materials import LinearElastic
    from fastcontact.mesh import Mesh
    from fastcontact.mesh_quality import quality
    from fastcontact.model import Model
    from fastcontact.ramp import Ramp, linear_ramp
    from fastcontact.results import ContactResult, StepResult
    from fastcontact.solving import solve, solve_steps
    from fastcontact.topology import ordered_line

_MODULES = ("analytic", "generate", "obstacles", "plot", "recovery", "topology")
_HOME = {
    "CaseError": "errors",
    "ContactError": "errors",
    "ContactResult": "results",
    "ConvergenceError": "errors",
    "Criteria": "criteria",
    "ErrorEstimate": "error_estimate",
    "ErrorNorms": "error_norms",
    "FastcontactError": "errors",
    "FastcontactWarning": "errors",
    "FileError": "errors",
    "LinearElastic": "materials",
    "Mesh": "mesh",
    "MeshError": "errors",
    "Model": "model",
    "ModelError": "errors",
    "Ramp": "ramp",
    "ResultWriter": "io.result_writer",
    "StepResult": "results",
    "adaptive_study": "convergence",
    "contact_table": "io.tables",
    "convergence_study": "convergence",
    "error_against": "error_norms",
    "estimate_error": "error_estimate",
    "line_table": "io.tables",
    "linear_ramp": "ramp",
    "open_results": "io.result_reader",
    "ordered_line": "topology",
    "parameter_sweep": "convergence",
    "quality": "mesh_quality",
    "read_med_field": "io.med",
    "read_mesh": "io.mesh_files",
    "solve": "solving",
    "solve_steps": "solving",
    "write_agr": "io.xmgrace",
    "write_csv": "io.tables",
    "write_med_results": "io.med",
    "write_mesh": "io.mesh_files",
}

__all__ = [
    "CaseError",
    "ContactError",
    "ContactResult",
    "ConvergenceError",
    "Criteria",
    "ErrorEstimate",
    "ErrorNorms",
    "FastcontactError",
    "FastcontactWarning",
    "FileError",
    "LinearElastic",
    "Mesh",
    "MeshError",
    "Model",
    "ModelError",
    "Ramp",
    "ResultWriter",
    "StepResult",
    "adaptive_study",
    "analytic",
    "contact_table",
    "convergence_study",
    "error_against",
    "estimate_error",
    "generate",
    "line_table",
    "linear_ramp",
    "obstacles",
    "open_results",
    "ordered_line",
    "parameter_sweep",
    "plot",
    "quality",
    "read_med_field",
    "read_mesh",
    "recovery",
    "solve",
    "solve_steps",
    "topology",
    "write_agr",
    "write_csv",
    "write_med_results",
    "write_mesh",
]


def _imported(module: str) -> ModuleType:
    """Import a module; what imports make stays, and Python need not look through it for cycles time and again."""
    looking = gc.isenabled()
    gc.disable()
    try:
        return importlib.import_module(f"{__name__}.{module}")
    finally:
        if looking:
            gc.enable()


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(_imported(_HOME[name]), name)
    elif name in _MODULES:
        value = _imported(name)
    else:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
