"""Array arguments of public calls: masked entries and imaginary parts are refused, never dropped."""

import inspect

import numpy as np
import pytest
from refusals import refused

import fastcontact as fc
from fastcontact._tools import argument_types
from fastcontact._tools.argument_types import fits, types_of
from fastcontact.elasticity.material_axes import frames
from fastcontact.results.xmgrace import Curve

SPACES = ("analytic", "generate", "obstacles", "plot", "recovery", "topology")
ARRAYS = ("ArrayLike", "ndarray", "Sequence", "Array", "Value", "Constant", "Table", "Mapping", "dict", "tuple")
# Of numbers among them, in words of the annotation: names and objects have neither masks nor imaginary parts.
WITHOUT_NUMBERS = (
    "Sequence[str]",
    "Iterable[str]",
    "Sequence[StepResult]",
    "Sequence[Axes]",
    "Mapping[str, str]",
    "dict[str, str]",
)
# What the package itself makes and hands over; `ResultWriter.write` refuses masks in them.
RESULTS = (
    "ContactResultants", "ContactResult", "Deck", "ErrorEstimate", "FoundContacts", "Modes", "OrderedLine", "Sensitivities",
    "StepResult",
)  # fmt: skip
MASK = np.ma.array([1.0, 2.0], mask=[False, True])
REFUSED = "has masked entries, which are not supported: fill or remove them"


def functions():
    """Return public functions and methods outside `analytic` by name, with the class of a method."""
    found = {}
    for space in (fc, *(getattr(fc, name) for name in SPACES if name != "analytic")):
        own = [name for name, made in vars(space).items() if getattr(made, "__module__", "") == space.__name__]
        for name in getattr(space, "__all__", None) or own:
            made = getattr(space, name)
            if name.startswith("_"):
                continue
            if inspect.isclass(made) and not issubclass(made, BaseException) and made.__name__ not in RESULTS:
                found[name] = (made.__init__, made)
                for method in (m for m in dir(made) if not m.startswith("_")):
                    call = inspect.getattr_static(made, method)
                    if inspect.isfunction(call):
                        found[f"{name}.{method}"] = (call, made)
            elif inspect.isfunction(made) and made.__module__.startswith("fastcontact"):
                found[name] = (made, None)
    return found


def arrays_of(call):
    """Return the names of the arguments of a function that may be arrays of numbers."""
    known = inspect.signature(call).parameters.values()
    return [p.name for p in known if any(w in _annotation(p) for w in ARRAYS)]


def _annotation(parameter):
    text = str(parameter.annotation)
    for words in WITHOUT_NUMBERS:
        text = text.replace(words, "")
    return text


CALLS = functions()
# Protocols, and what takes an array only to hand it to a call that is in the list.
HANDED_ON = {"Obstacle", "Obstacle.distance", "Curve", "Curve.project", "ResultWriter.write"}
CASES = [(name, key) for name, (call, _) in CALLS.items() if name not in HANDED_ON for key in arrays_of(call)]


@pytest.mark.parametrize(("name", "argument"), CASES)
def test_a_masked_entry_is_refused(name, argument, monkeypatch):
    """Before anything else is looked at, whatever the other arguments are."""
    monkeypatch.setattr(argument_types, "fits", lambda value, annotation: True)
    call, owner = CALLS[name]
    parameters = inspect.signature(call).parameters
    own = [owner.__new__(owner)] if owner is not None and "self" in parameters else []
    needed = [p for key, p in parameters.items() if key != "self" and p.default is p.empty]
    others = {p.name: object() for p in needed if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)}
    refused(fc.FastcontactError, REFUSED, call, *own, **{**others, argument: MASK})


@pytest.mark.parametrize(("name", "argument"), CASES)
def test_complex_numbers_fit_no_argument(name, argument):
    call, owner = CALLS[name]
    kind = types_of(inspect.unwrap(call)).get(argument) or (types_of(owner).get(argument) if owner else None)
    if kind is not None and name not in ("Orthotropic", "Anisotropic"):  # tried below: these look for themselves
        assert not fits(np.array([1.0, 2.0]) + 1j, kind), kind


def theories():
    """Return an object of every theory whose methods take positions."""
    a, bodies = fc.analytic, {"E1": 1e3, "nu1": 0.3}
    like = {**bodies, "E2": 1e3, "nu2": 0.3, "R1": 1.0, "force": 1.0}
    half_space, slip = {"E": 1e3, "nu": 0.3}, {"friction": 0.5, "tangential_force": 0.1}
    return [
        a.hertz_point(**bodies, R1=1.0, force=1.0), a.hertz_line(**bodies, R1=1.0, force=1.0),
        a.hertz_elliptical(**bodies, R1x=1.0, R1y=2.0, force=1.0),
        a.cattaneo_mindlin_line(**like, **slip), a.cattaneo_mindlin_sphere(**like, **slip),
        a.flat_punch(**half_space, radius=1.0, force=1.0), a.flat_punch_2d(nu=0.3, half_width=1.0, force=1.0),
        a.cone_punch(**half_space, slope_angle=5.0, force=1.0),
        a.thick_cylinder(**half_space, inner_radius=0.5, outer_radius=3.0, inner_pressure=1.0),
        a.persson_pin(E=1e3, R=1.0, clearance=1e-3, force=1.0), a.hertz_box(),
        a.receding_layer(**bodies, thickness=1.0, force=1.0),
    ]  # fmt: skip


POSITIONS = [
    (theory, name, key)
    for theory in theories()
    for name in dir(type(theory))
    if not name.startswith("_") and inspect.isfunction(getattr(type(theory), name))
    for key in arrays_of(getattr(type(theory), name))
]


@pytest.mark.parametrize(
    ("theory", "method", "argument"), POSITIONS, ids=[f"{type(t).__name__}.{m}.{k}" for t, m, k in POSITIONS]
)
def test_positions_of_theories_have_no_mask_and_are_real(theory, method, argument):
    call = getattr(theory, method)
    shape = (2, 2) if argument == "points" else (2,)
    good = {p.name: -np.ones(shape) for p in inspect.signature(call).parameters.values() if p.name in "rxyz"}
    good[argument] = np.full(shape, 1.0 if argument in "rx depth angle" else -0.5)
    filled = call(**good)
    for wrong, message in (
        (np.ma.array(good[argument], mask=np.arange(good[argument].size).reshape(shape) == 1), REFUSED),
        (good[argument] + 1j, "must be a number or an array of real numbers"),
        ([[1.0], [1.0, 2.0]], "must be a number or an array of real numbers|inhomogeneous"),
        ("far", "must be a number or an array of real numbers"),
    ):
        refused(fc.ModelError, message, call, **{**good, argument: wrong})
    unmasked = call(**{**good, argument: np.ma.array(good[argument], mask=False)})
    for with_mask, without in zip(parts(unmasked), parts(filled), strict=True):
        assert np.array_equal(with_mask, without)
        assert not isinstance(with_mask, np.ma.MaskedArray)


def parts(found):
    """Return the arrays that a method returns."""
    return found if isinstance(found, tuple) else (found,)


def test_every_theory_is_among_these():
    from_positions = {type(theory).__name__ for theory, _, _ in POSITIONS}
    classes = {
        name: getattr(fc.analytic, name) for name in fc.analytic.__all__ if name[0].isupper() and name != "THEORIES"
    }
    with_arrays = {
        name
        for name, kind in classes.items()
        if any(
            arrays_of(call)
            for method, call in inspect.getmembers(kind, inspect.isfunction)
            if not method.startswith("_")
        )
    }
    assert with_arrays - {"LameShell"} <= from_positions
    assert "LameShell" in from_positions


def masked(shape, dtype=float):
    values = np.ones(shape, dtype)
    return np.ma.array(values, mask=np.arange(values.size).reshape(shape) == 0)


@pytest.mark.parametrize("what", ["points", "cells", "a set of cells"])
def test_masks_in_a_mesh_of_meshio_are_refused(what):
    import meshio

    cells = np.ma.array([[0, 1, 2]], mask=[[0, what == "cells", 0]])
    points = np.ma.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], mask=np.eye(3, 2) * (what == "points"))
    found = meshio.Mesh(np.eye(3), [("triangle", np.array([[0, 1, 2]]))])
    found.points, found.cells[0].data = points, cells
    found.cell_sets["A"] = [np.ma.array([0], mask=[what == "a set of cells"])]
    refused(fc.MeshError, REFUSED, fc.from_meshio, found)


def test_masks_in_a_curve_are_refused():
    refused(fc.CaseError, REFUSED, Curve, x=MASK, y=[1.0, 2.0])


class Floor:
    """An obstacle of the caller's own, whose gap is made by a function."""

    def __init__(self, gap):
        self.gap = gap

    def distance(self, points):
        return self.gap(len(points)), np.tile([0.0, 1.0], (len(points), 1))


@pytest.mark.parametrize(("kind", "text"), [(masked, "masked"), (lambda n: np.ones(n) + 1j, "real|complex")])
def test_results_of_functions_of_the_caller(kind, text):
    """A load, a modulus, axes and the gap of an obstacle."""
    from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide
    from fastcontact.elasticity.loads import evaluated

    points = np.zeros((3, 2))
    refused(fc.ModelError, text, evaluated, lambda x: kind(len(x)), points, "the pressure on 'TOP'")
    refused(fc.ContactError, text, RigidSide(Floor(kind), np.zeros(2)).project, points, Pose(np.zeros(2)))


def test_axes_of_a_function_have_no_mask_and_are_real():
    points = np.zeros((2, 2))
    hidden = np.ma.array(np.tile(np.eye(3), (2, 1, 1)), mask=np.arange(18).reshape(2, 3, 3) == 0)
    refused(fc.ModelError, REFUSED, frames, lambda x: hidden, points, "plane_strain")
    with pytest.raises(fc.ModelError, match="not unit vectors"):
        frames(lambda x: np.tile(np.eye(3), (2, 1, 1)) + 0.1j, points, "plane_strain")


WOOD = {"E": (10.0, 1.0, 1.0), "nu": (0.3, 0.3, 0.3), "G": (1.0, 1.0, 1.0)}


@pytest.mark.parametrize("name", ["E", "nu", "G", "axes", "density", "expansion"])
def test_constants_of_orthotropic_materials_are_real(name):
    with pytest.raises(fc.ModelError):
        fc.Orthotropic(**{**WOOD, name: np.eye(3) + 1j if name == "axes" else np.ones(3) + 1j})
    with pytest.raises(fc.ModelError):
        fc.Orthotropic(**{**WOOD, name: [[1j, 0, 0], [0, 1, 0]] if name == "axes" else (1j, 1.0, 1.0)})


@pytest.mark.parametrize("name", ["D", "axes", "density", "expansion"])
def test_constants_of_anisotropic_materials_are_real(name):
    with pytest.raises(fc.ModelError):
        fc.Anisotropic(**{"D": np.eye(6), name: np.eye(6 if name == "D" else 3) + 1j})


@pytest.mark.parametrize(("name", "value"), [("E_across", "1e3"), ("nu_across", "0.3"), ("nu_across", 1j)])
def test_constants_of_transversely_isotropic_materials(name, value):
    good = {"E_along": 10.0, "E_across": 1.0, "nu_along": 0.3, "nu_across": 0.3, "G_along": 1.0}
    with pytest.raises(fc.ModelError, match=f"{name} of a transversely isotropic material must be a number"):
        fc.Orthotropic.transversely_isotropic(**{**good, name: value})


@pytest.mark.parametrize("value", [10**400, 1e300, float("inf"), float("nan"), 1j, True, "1", [1.0]])
@pytest.mark.parametrize("name", sorted(fc.analytic.THEORIES))
def test_numbers_of_theories_are_in_range(name, value):
    """No argument of any theory makes an error of Python's own; infinity is a plane where there is one."""
    good = {
        "E": 1.0, "nu": 0.3, "E1": 1.0, "nu1": 0.3, "R1": 1.0, "R": 1.0, "force": 1.0, "friction": 0.1, "approach": 0.01,
        "tangential_force": 0.01, "radius": 1.0, "slope_angle": 3.0, "half_width": 1.0, "inner_radius": 1.0, "R1x": 1.0,
        "outer_radius": 2.0, "thickness": 1.0, "clearance": 1e-3, "R1y": 1.0,
    }  # fmt: skip
    factory = fc.analytic.THEORIES[name]
    parameters = inspect.signature(factory).parameters
    needed = {key: good.get(key, 1.0) for key, p in parameters.items() if p.default is p.empty}
    n_refused = 0
    for key in parameters:
        try:
            factory(**{**needed, key: value})
        except fc.FastcontactError:
            n_refused += 1
    assert n_refused >= len(needed) - 2  # at least all but radii that may be infinite
