"""Kratos: ``python3 kratos_mortar.py PROBLEM.npz STEPS ANSWER.json`` writes a model part, solves it and reads nodal results.

Problem ``forma04``: axisymmetric elements and frictionless mortar contact with augmented Lagrangian multipliers. With
axisymmetric contact conditions the matrix cannot be factorised, so that the contact conditions are those of plane problems:
the multiplier is then the force per length of the meridian. AMGCL is the cheapest linear solver in the wheel. Normals that
follow the deformation cost more iterations and change the force by 1e-6.
"""

import json
import os
import sys

import KratosMultiphysics as Kratos
import numpy as np
from KratosMultiphysics.StructuralMechanicsApplication.structural_mechanics_analysis import StructuralMechanicsAnalysis

PARTS = ("nodes_A1A2", "nodes_A1B1", "nodes_A2B2")


def block(file, name, numbers, rows, form="%d"):
    file.write(f"Begin {name}\n")
    np.savetxt(file, np.column_stack([numbers, rows]), fmt=["%d", *[form] * rows.shape[1]])
    file.write(f"End {name.split()[0]}\n")


def write(given, path):
    points, cells = given["points"], given["cells"]
    with open(path + ".mdpa", "w") as file:
        file.write("Begin Properties 0\nEnd Properties\nBegin Properties 1\nEnd Properties\n")
        block(file, "Nodes", np.arange(1, len(points) + 1), np.column_stack([points, np.zeros(len(points))]), "%.16g")
        rows = np.column_stack([np.ones(len(cells)), cells + 1])
        block(file, "Elements AxisymSmallDisplacementElement2D4N", np.arange(1, len(cells) + 1), rows)
        facets = np.concatenate([given["facets_CONT1"], given["facets_CONT2"]])
        rows = np.column_stack([np.zeros(len(facets)), facets + 1])
        block(file, "Conditions LineCondition2D2N", np.arange(1, len(facets) + 1), rows)
        first = 1
        for name in ("CONT1", "CONT2"):
            members = given[f"facets_{name}"]
            part(file, name, np.unique(members), range(first, first + len(members)))
            first += len(members)
        for name in PARTS:
            part(file, name, given[name], [])
        part(file, "SOLID", np.arange(len(points)), [], range(1, len(cells) + 1))


def part(file, name, nodes, conditions, elements=()):
    file.write(f"Begin SubModelPart {name}\n")
    for kind, members in (("Nodes", nodes + 1), ("Elements", elements), ("Conditions", conditions)):
        file.write(f"Begin SubModelPart{kind}\n" + "\n".join(map(str, members)) + f"\nEnd SubModelPart{kind}\n")
    file.write("End SubModelPart\n")


def moved(name, x, y):
    """Prescribe components of the displacement; text is a function of the time."""
    return {
        "python_module": "assign_vector_variable_process",
        "kratos_module": "KratosMultiphysics",
        "Parameters": {
            "model_part_name": f"Structure.{name}",
            "variable_name": "DISPLACEMENT",
            "constrained": [x is not None, y is not None, False],
            "value": [x, y, None],
            "interval": [0.0, "End"],
        },
    }


def settings(given, steps, path):
    push = 0.5 * float(given["approach"])
    contact = {
        "python_module": "alm_contact_process",
        "kratos_module": "KratosMultiphysics.ContactStructuralMechanicsApplication",
        "Parameters": {
            "model_part_name": "Structure",
            "contact_model_part": {"0": ["CONT1", "CONT2"]},
            "assume_master_slave": {"0": ["CONT1"]},
            "contact_type": "Frictionless",
        },
    }
    return {
        "problem_data": {
            "problem_name": "forma04", "parallel_type": "OpenMP", "start_time": 0.0,
            "end_time": 1.0 - 0.5 / steps, "echo_level": 0,
        },
        "solver_settings": {
            "model_part_name": "Structure", "domain_size": 2, "echo_level": 0, "analysis_type": "non_linear",
            "solver_type": "Static",
            "model_import_settings": {"input_type": "mdpa", "input_filename": path},
            "material_import_settings": {"materials_filename": path + "_materials.json"},
            "time_stepping": {"time_step": 1.0 / steps},
            "contact_settings": {"mortar_type": "ALMContactFrictionless"},
            "convergence_criterion": "contact_residual_criterion",
            "residual_relative_tolerance": 1e-8, "residual_absolute_tolerance": 1e-9, "max_iteration": 50,
            "linear_solver_settings": {"solver_type": "amgcl"},
        },
        "processes": {
            "constraints": [
                moved("nodes_A1A2", 0.0, None), moved("nodes_A1B1", None, f"{push}*t"),
                moved("nodes_A2B2", None, f"-{push}*t"),
            ],
            "contact": [contact],
        },
    }  # fmt: skip


def materials(given, path):
    numbers = {"YOUNG_MODULUS": float(given["E"]), "POISSON_RATIO": float(given["nu"]), "THICKNESS": 1.0}
    law = {
        "properties": [
            {
                "model_part_name": "Structure.SOLID",
                "properties_id": 1,
                "Material": {"constitutive_law": {"name": "LinearElasticAxisym2DLaw"}, "Variables": numbers},
            }
        ]
    }
    with open(path + "_materials.json", "w") as out:
        json.dump(law, out)


class Counted(StructuralMechanicsAnalysis):
    """The analysis, with the iterations of all steps."""

    iterations = 0

    def FinalizeSolutionStep(self):
        super().FinalizeSolutionStep()
        self.iterations += self.model["Structure"].ProcessInfo[Kratos.NL_ITERATION_NUMBER]


def stress(part_of, given):
    """Return the stress yy at the pole, extrapolated from the 2 x 2 points of its element."""
    pole = int(given["POLE"])
    cell = int(np.flatnonzero((given["cells"] == pole).any(axis=1))[0])
    corner = int(np.flatnonzero(given["cells"][cell] == pole)[0])
    element = part_of.GetElement(cell + 1)
    values = element.CalculateOnIntegrationPoints(Kratos.CAUCHY_STRESS_VECTOR, part_of.ProcessInfo)
    near, far = 0.5 * (1 + 3**0.5), 0.5 * (1 - 3**0.5)
    weights = np.roll([near * near, near * far, far * far, near * far], corner)  # points in the order of the corners
    return float(weights @ [value[1] for value in values])


def main(problem, steps, answer):
    Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
    given, steps = np.load(problem), int(steps)
    path = os.path.splitext(os.path.abspath(answer))[0] + "_part"
    write(given, path)
    materials(given, path)
    model = Kratos.Model()
    analysis = Counted(model, Kratos.Parameters(json.dumps(settings(given, steps, path))))
    analysis.Run()
    part_of = model["Structure"]
    force = sum(part_of.GetNode(int(i) + 1).GetSolutionStepValue(Kratos.REACTION_Y) for i in given["nodes_A1B1"])
    found = {
        "version": Kratos.KratosGlobals.Kernel.Version().replace('"', ""),
        "contact": "mortar, augmented Lagrangian multipliers",
        "force": abs(force),
        "stress": stress(part_of, given),
        "iterations": int(analysis.iterations),
    }
    with open(answer, "w") as out:
        json.dump(found, out)


if __name__ == "__main__":
    main(*sys.argv[1:])
