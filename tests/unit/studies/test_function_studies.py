"""Studies of Python functions and adaptive meshes: order and limit, accuracy, files, refusals."""

import json
import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from models import elastic_model, pressed_spheres, united
from pairwise import first_of
from refusals import refused

import fastcontact as fc
from fastcontact.cli import main

A, B, E, NU = 1.0, 2.0, 1000.0, 0.3  # a tube of Lame's under unit pressure inside, held between two planes
SIZES = [0.5, 0.25, 0.125, 0.0625]
BORE = (1 + NU) / E * A**2 / (B**2 - A**2) * ((1 - 2 * NU) * A + B**2 / A)


def tube(size, solved=True, element="quad4"):
    """Tube of Lame's."""
    n = round(1 / size)
    mesh = fc.generate.block(divisions=(n, 1), size=(1.0, size), origin=(A, 0.0), element=element)
    model = elastic_model(mesh, "axisymmetric", E=E, nu=NU, BOTTOM="y", TOP="y")
    model.add_pressure("LEFT", 1.0)
    return fc.solve(model, 1) if solved else model


def bore(step):
    return step.displacement[:, 0].max()


def overlap(size, friction=0.0):
    """Half-spheres, loaded by Hertz."""
    sizes = {"arc_sizes": (size, 4 * size), "radial_sizes": (size, 4 * size), "segments": 8}
    mesh, material = fc.generate.half_spheres("quad4", **sizes), fc.LinearElastic(E=20_000.0, nu=NU)
    return fc.solve(pressed_spheres(mesh, 0.5, material=material, friction=friction), 1)


@pytest.mark.parametrize(("element", "order"), [("quad4", 2.0), ("tri3", 2.0)])
def test_lame_is_the_limit_and_the_order_is_that_of_the_element(element, order):
    def of_size(size):
        return tube(size, element=element)

    study = fc.convergence_study(of_size, SIZES[::-1], quantities={"bore": bore})
    limit = study.best.limits["bore"]
    assert limit.contains(BORE)
    assert limit.uncertainty < 0.01 * BORE
    assert abs(limit.order - order) < 2 * limit.order_uncertainty < 1.0
    assert study.best.h == SIZES
    assert list(study.table()["bore"]) == study.best.values("bore")
    assert "the mesh error of the bore is" in study.lines()[-1]
    assert study.figure().axes[0].get_title() == "Mesh error of the bore"
    assert "def of_size" in study.html()
    json.dumps(study.as_dict())


def test_a_theory_of_a_function_separates_its_error_from_that_of_the_mesh():
    study = fc.convergence_study(tube, SIZES[::-1], quantities={"bore": bore}, theory={"bore": 0.8 * BORE})
    split = study.best.split("bore")
    assert split.theory == 0.8 * BORE
    assert split.model == pytest.approx(0.25, abs=study.best.limits["bore"].uncertainty / (0.8 * BORE))
    assert split.model + split.mesh == pytest.approx(study.best.values("bore")[-1] / (0.8 * BORE) - 1.0)
    assert "under the given load the bore differs from theory by" in str(study)


def test_the_force_of_a_press_fit_is_that_all_round():
    def fit(size):
        n = round(1 / size)
        rings = {
            name: fc.generate.block((1.0, 1.0), (n, n), "quad8", (r, 0.0), name=name[:-1])
            for r, name in ((1, "IN_"), (2, "OUT_"))
        }
        model = elastic_model(united(**rings), "axisymmetric", E=E, nu=NU, IN_BOTTOM="y", OUT_BOTTOM="y")
        model.add_contact("fit", secondary="IN_RIGHT", primary="OUT_LEFT", clearance=-1e-4)
        return fc.solve(model, 1)

    study = fc.convergence_study(fit, [0.5, 0.25], quantities={"around": lambda step: step.contact["fit"].normal_force})
    assert study.best.values("force") == study.best.values("around")
    assert min(study.best.values("force")) > 0.0


def test_standard_quantities_of_a_model_and_of_its_steps():
    models = fc.convergence_study(lambda size: tube(size, solved=False), SIZES, quantities=["von_mises_max"])
    bored = math.sqrt(0.5 * ((5 / 3 + 1) ** 2 + (5 / 3 - 0.2) ** 2 + (0.2 + 1) ** 2))  # at the bore: -1, 5/3, 0.2
    assert models.best.limits["von_mises_max"].contains(bored)
    steps = fc.convergence_study(overlap, [3.0, 1.5, 0.75], quantities=["force", "pressure_max"])
    limits = steps.best.limits
    exact = fc.analytic.hertz_point(
        R1=50.0, E1=20_000.0, nu1=NU, R2=50.0, E2=20_000.0, nu2=NU, force=limits["force"].value
    )
    assert limits["pressure_max"].value == pytest.approx(exact.pressure_max, rel=0.02)
    assert steps.figure().axes[2].get_title().startswith("Contact pressure")


def test_a_sweep_calls_the_function_with_all_choices():
    found = fc.parameter_sweep(tube, {"size": [0.5, 0.25], "element": ["quad4", "quad8"]}, quantities={"bore": bore})
    assert [tuple(point.parameters.values()) for point in found.points][1] == (0.5, "quad8")
    assert all(math.isclose(point.values["bore"], BORE, rel_tol=0.05) for point in found.points)
    single = fc.parameter_sweep(tube, [0.5, 0.25], quantities={"bore": bore}, executor=ThreadPoolExecutor(2))
    assert list(single.table()["size"]) == [0.5, 0.25]
    assert not {"h"} & {*single.table().dtype.names, *single.as_dict()["points"][0]}  # unknown of solved steps
    assert list(single.table()["bore"]) == list(found.table()["bore"][::2])
    assert pytest.importorskip("pandas").DataFrame(single.table()).equals(single.to_pandas())
    loaded = fc.parameter_sweep(lambda force: tube(0.5), {"force": [7.0]}, quantities={"force": bore}, workers=1)
    assert loaded.table()["force"].tolist() == [7.0]
    assert loaded.table()["computed_force"].tolist() == [loaded.points[0].values["force"]]
    case = fc.parameter_sweep("forma04a", {"approach": [0.4]}, quantities=["von_mises_max"], level=0, workers=1)
    assert any("von_mises_max" in line for line in case.lines())


@pytest.mark.parametrize(("values", "over", "curves", "heading"), [
    ({"size": [0.5], "solved": [True], "element": ["quad4", "quad8"]}, "element", 1, "tube\nsize = 0.5, solved = True"),
    ({"element": ["quad4", "quad8"], "size": [0.5, 0.25]}, "element size", 2, "tube"),
])  # fmt: skip
def test_a_sweep_is_drawn_over_the_first_parameter_with_several_numbers(values, over, curves, heading):
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    figure = fc.parameter_sweep(tube, values, quantities={"bore": bore}).figure()
    assert figure.get_suptitle().endswith(heading)
    assert figure.axes[0].get_xlabel().startswith(over)
    assert len(figure.axes[0].lines) == curves


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((tube,), r"needs its mesh sizes, such as \[4.0, 2.0, 1.0\], not 5 levels"),
        ((tube, [1.0, -1.0]), "must be positive and all different"),
        ((tube, [1.0], ["tri3"]), "leave out 'elements', which is only for case files"),
        (("forma04a", [1.0, 0.5]), "give a case its number of levels"),
        (("forma04a", 3, None, None, {"force": 1.0}), "its theory in the table .theory.PAIR."),
        ((tube, [1.0], None, None, {"force": math.nan}), "theory: the value nan of 'force' is not a finite number"),
        ((tube, [1.0], None, None, {"force_": 1.0}), "theory: unknown quantity 'force_': did you mean 'force'"),
        ((lambda size: None, [1.0]), "size = 1: the function <lambda> must return a Model, or what fc.solve returns"),
        ((lambda size: 1 / 0, [1.0]), "the function <lambda> failed at line .*: ZeroDivisionError"),
    ],
)
def test_what_no_study_can_use_is_told(given, message):
    refused(fc.CaseError, message, fc.convergence_study, *given[:4], theory=given[4] if len(given) > 4 else None)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"quantities": {"x": lambda step: step.x}}, "the quantity 'x' is a function that failed .AttributeError"),
        ({"quantities": ["bore"]}, "unknown quantity 'bore'"),
        ({"store": "there"}, "leave out 'store'"),
        ({"workers": 2, "quantities": {"x": lambda step: 1.0}}, "cannot be sent to other processes"),
    ],
)
def test_options_that_do_not_fit_a_function_are_told(options, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused(fc.CaseError, message, fc.convergence_study, tube, [0.5, 0.25, 0.125], **options)


def test_a_wrong_quantity_stops_a_sweep_at_its_first_point():
    solved = []

    def solving(size):
        solved.append(size)
        return tube(size)

    def late(step):
        return bore(step) if len(solved) < 2 else step.missing

    with pytest.raises(fc.CaseError, match=r"size = 0\.5: the quantity 'x' is a function that failed"):
        fc.parameter_sweep(solving, [0.5, 0.25, 0.125], quantities={"x": lambda step: step.x})
    assert solved == [0.5]
    solved.clear()
    sweep = fc.parameter_sweep(solving, [0.5, 0.25], quantities={"x": late})
    assert [point.parameters for point in sweep.points] == [{"size": 0.5}]
    assert "'x' is a function that failed" in sweep.failed[0][1]
    table = sweep.to_pandas()
    assert table["size"].tolist() == [0.5, 0.25]
    assert table["failed"].dropna().tolist() == [sweep.failed[0][1]]
    assert sweep.table()["failed"].tolist() == ["", sweep.failed[0][1]]
    assert table["x"].isna().tolist() == [False, True]


def test_sizes_that_are_numbers_of_cells_are_told():
    with pytest.warns(fc.FastcontactWarning, match="sizes must decrease as meshes become finer"):
        fc.convergence_study(lambda n: tube(1 / n), [2, 4, 8], quantities={"bore": bore})


ADAPTED = [
    ("forma04c", "quad8", "continuous", 8_000),
    ("forma04b", "tri6", "continuous", 8_000),
    ("forma04c", "quad4", "node_to_segment", 10_000),
    ("forma04a", "tri3", "node_to_segment", 10_000),
]


@pytest.mark.parametrize(("name", "element", "formulation", "most"), first_of(2, ADAPTED))
def test_the_largest_pressure_within_a_thousandth_unattended(root, name, element, formulation, most):
    case = root / f"data/cases/{name}.toml"
    study = fc.adaptive_study(case, "pressure_max", 1e-3, element=element, formulation=formulation)
    assert study.reached
    # Of the mesh-converged solution, found by another method. Uniform refinement of linear cells takes 86 000 and more.
    assert study.rounds[-1].true_error("pressure_max") <= 1e-3
    assert study.rounds[-1].n_dofs <= most
    assert study.effectivity() >= 1.0


def test_the_force_too(case):
    study = fc.adaptive_study(case, "force", 1e-3)
    assert study.reached
    ((caption, rows),) = study.tables()
    assert str(caption) in study._repr_html_()
    assert len(rows) == 1 + len(study.rounds)
    assert study.rounds[-1].true_error("force") <= 1e-3


def test_the_command_writes_what_it_shows(case, tmp_path, capsys):
    files = {name: tmp_path / f"adaptive.{name}" for name in ("json", "csv", "png", "html")}
    options = [text for name, path in files.items() for text in (f"--{name}", str(path))]
    result = tmp_path / "last.vtkhdf"
    assert main(["converge", str(case), "--adaptive", "--tolerance", "0.01", "-o", str(result), *options]) == 0
    shown = capsys.readouterr().out
    study = json.loads(files["json"].read_text())
    assert study["reached"]
    assert f"{study['value']:.8g}" in shown
    assert files["png"].read_bytes()[:4] == b"\x89PNG"
    assert "data:image/png;base64" in files["html"].read_text()
    last = fc.open_results(result)[-1]
    model = fc.open_results(result).mesh
    cells = last.cell_fields["error"]
    assert len(cells) == sum(map(len, model.solids.values())) == study["rounds"][-1]["n_cells"]
    assert np.linalg.norm(cells) > 0


def test_not_reached_is_said_and_is_exit_code_two(case, capsys):
    arguments = ["converge", str(case), "--adaptive", "--tolerance", "1e-6", "--max-dofs", "4000"]
    assert main(arguments) == 2
    assert "NOT within the 1e-06 requested" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"quantity": "presure_max"}, "'pressure_max'"),
        ({"tolerance": 0.0}, "between 0 and 1"),
        ({"element": "quad5"}, "unknown element"),
    ],
)
def test_what_is_wrong_is_told(case, options, words):
    refused(fc.CaseError, words, fc.adaptive_study, case, **options)
