"""fastcontact: fast finite elements for elastic contact problems.

Public names are imported on first use, which keeps ``import fastcontact`` at about 0.02 s.
"""

from __future__ import annotations

import importlib
import logging
import os
from typing import Any

from fastcontact._version import __version__ as __version__

# Without this setting, idle threads of OpenBLAS spin for about 0.1 s before they sleep. OpenBLAS reads the variable once,
# when NumPy or SciPy is first imported.
os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "4")

logging.getLogger(__name__).addHandler(logging.NullHandler())  # no output unless the user configures logging

# Public modules, and public names by the module that defines them. Type checkers read `__init__.pyi`.
_MODULES = {
    "analytic": "analytic",
    "generate": "mesh.generate",
    "obstacles": "contact.obstacles",
    "plot": "results.plot",
    "recovery": "elasticity.recovery",
    "topology": "mesh.topology",
}
_NAMES = {
    "analysis.criteria": ("Criteria",),
    "analysis.modal.shapes": ("Modes", "RingModes"),
    "analysis.modes": ("modes",),
    "analysis.resultants": ("ContactAnswers", "ContactResultants", "contact_answers", "contact_history",
        "contact_moment", "contact_resultants", "pretension_history", "spring_forces", "support_forces", "wear"),
    "analysis.run": ("solve", "solve_steps"),
    "analysis.sensitivities": ("Sensitivities", "sensitivities"),
    "cases.decks.deck": ("Deck", "read_deck"),
    "contact.found_contacts": ("FoundContacts", "find_contacts"),
    "elasticity.anisotropic_materials": ("Anisotropic", "Orthotropic"),
    "elasticity.material_axes": ("CylindricalAxes",),
    "elasticity.materials": ("LinearElastic",),
    "elasticity.nonlinear_materials": ("ElasticPlastic", "MooneyRivlin", "NeoHookean", "Ogden", "Yeoh"),
    "elasticity.varying_constants": ("Tabulated",),
    "errors": ("CaseError", "ContactError", "ConvergenceError", "FastcontactError", "FastcontactWarning",
        "FileError", "MeshError", "ModelError"),
    "mesh.files.med": ("read_med_field",),
    "mesh.files.mesh_fields": ("read_field",),
    "mesh.files.mesh_files": ("read_mesh", "write_mesh"),
    "mesh.from_libraries": ("from_gmsh", "from_meshio", "from_pyvista"),
    "mesh.mesh": ("Mesh",),
    "mesh.quality": ("quality",),
    "mesh.topology": ("ordered_line",),
    "model.model": ("Model",),
    "model.ramp": ("Ramp", "linear_ramp"),
    "results.med": ("write_med_results",),
    "results.reader": ("open_results",),
    "results.step": ("ContactResult", "StepResult"),
    "results.tables": ("contact_table", "line_table", "normal_stress", "write_csv"),
    "results.writer": ("ResultWriter",),
    "results.xmgrace": ("write_agr",),
    "studies.adaptive": ("adaptive_study",),
    "studies.error_norms": ("ErrorEstimate", "ErrorNorms", "error_against", "estimate_error"),
    "studies.runs": ("convergence_study", "parameter_sweep"),
}  # fmt: skip
_HOME = {name: module for module, names in _NAMES.items() for name in names}
__all__ = sorted([*_HOME, *_MODULES])


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)
    elif name in _MODULES:
        value = importlib.import_module(f"{__name__}.{_MODULES[name]}")
    else:
        from fastcontact.errors import module_access

        return module_access(__name__, __all__)[0](name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
