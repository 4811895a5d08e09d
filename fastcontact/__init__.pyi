# The public names for type checkers. `__init__.py` reads them from this file, and imports their modules on first use.

from fastcontact import analytic as analytic
from fastcontact._version import __version__ as __version__
from fastcontact.analysis.criteria import Criteria as Criteria
from fastcontact.analysis.modal.shapes import Modes as Modes
from fastcontact.analysis.modal.shapes import RingModes as RingModes
from fastcontact.analysis.modes import modes as modes
from fastcontact.analysis.resultants import ContactAnswers as ContactAnswers
from fastcontact.analysis.resultants import ContactResultants as ContactResultants
from fastcontact.analysis.resultants import contact_answers as contact_answers
from fastcontact.analysis.resultants import contact_history as contact_history
from fastcontact.analysis.resultants import contact_moment as contact_moment
from fastcontact.analysis.resultants import contact_resultants as contact_resultants
from fastcontact.analysis.resultants import pretension_history as pretension_history
from fastcontact.analysis.resultants import spring_forces as spring_forces
from fastcontact.analysis.resultants import support_forces as support_forces
from fastcontact.analysis.resultants import wear as wear
from fastcontact.analysis.run import solve as solve
from fastcontact.analysis.run import solve_steps as solve_steps
from fastcontact.analysis.sensitivities import Sensitivities as Sensitivities
from fastcontact.analysis.sensitivities import sensitivities as sensitivities
from fastcontact.cases.decks.deck import Deck as Deck
from fastcontact.cases.decks.deck import read_deck as read_deck
from fastcontact.contact import obstacles as obstacles
from fastcontact.contact.found_contacts import FoundContacts as FoundContacts
from fastcontact.contact.found_contacts import find_contacts as find_contacts
from fastcontact.elasticity import recovery as recovery
from fastcontact.elasticity.anisotropic_materials import Anisotropic as Anisotropic
from fastcontact.elasticity.anisotropic_materials import Orthotropic as Orthotropic
from fastcontact.elasticity.material_axes import CylindricalAxes as CylindricalAxes
from fastcontact.elasticity.materials import LinearElastic as LinearElastic
from fastcontact.elasticity.nonlinear_materials import (
    ElasticPlastic as ElasticPlastic,
)
from fastcontact.elasticity.nonlinear_materials import (
    MooneyRivlin as MooneyRivlin,
)
from fastcontact.elasticity.nonlinear_materials import (
    NeoHookean as NeoHookean,
)
from fastcontact.elasticity.nonlinear_materials import (
    Ogden as Ogden,
)
from fastcontact.elasticity.nonlinear_materials import (
    Yeoh as Yeoh,
)
from fastcontact.elasticity.varying_constants import Tabulated as Tabulated
from fastcontact.errors import CaseError as CaseError
from fastcontact.errors import ContactError as ContactError
from fastcontact.errors import ConvergenceError as ConvergenceError
from fastcontact.errors import FastcontactError as FastcontactError
from fastcontact.errors import FastcontactWarning as FastcontactWarning
from fastcontact.errors import FileError as FileError
from fastcontact.errors import MeshError as MeshError
from fastcontact.errors import ModelError as ModelError
from fastcontact.mesh import generate as generate
from fastcontact.mesh import topology as topology
from fastcontact.mesh.files.med import read_med_field as read_med_field
from fastcontact.mesh.files.mesh_fields import read_field as read_field
from fastcontact.mesh.files.mesh_files import read_mesh as read_mesh
from fastcontact.mesh.files.mesh_files import write_mesh as write_mesh
from fastcontact.mesh.from_libraries import from_gmsh as from_gmsh
from fastcontact.mesh.from_libraries import from_meshio as from_meshio
from fastcontact.mesh.from_libraries import from_pyvista as from_pyvista
from fastcontact.mesh.mesh import Mesh as Mesh
from fastcontact.mesh.quality import quality as quality
from fastcontact.mesh.topology import ordered_line as ordered_line
from fastcontact.model.model import Model as Model
from fastcontact.model.ramp import Ramp as Ramp
from fastcontact.model.ramp import linear_ramp as linear_ramp
from fastcontact.results import plot as plot
from fastcontact.results.med import write_med_results as write_med_results
from fastcontact.results.reader import open_results as open_results
from fastcontact.results.step import ContactResult as ContactResult
from fastcontact.results.step import StepResult as StepResult
from fastcontact.results.tables import contact_table as contact_table
from fastcontact.results.tables import line_table as line_table
from fastcontact.results.tables import normal_stress as normal_stress
from fastcontact.results.tables import write_csv as write_csv
from fastcontact.results.writer import ResultWriter as ResultWriter
from fastcontact.results.xmgrace import write_agr as write_agr
from fastcontact.studies.adaptive import adaptive_study as adaptive_study
from fastcontact.studies.error_norms import ErrorEstimate as ErrorEstimate
from fastcontact.studies.error_norms import ErrorNorms as ErrorNorms
from fastcontact.studies.error_norms import error_against as error_against
from fastcontact.studies.error_norms import estimate_error as estimate_error
from fastcontact.studies.runs import convergence_study as convergence_study
from fastcontact.studies.runs import parameter_sweep as parameter_sweep
