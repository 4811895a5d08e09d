"""Modes of a ring from one sector, by nodal diameters: compared with the whole ring, and with Love's thin rings."""

import numpy as np
import pytest
from refusals import refused

import fastcontact as fc
from fastcontact.cli import main
from fastcontact.mesh.generate import block, box, merge_points, renamed, union

pytestmark = pytest.mark.pairwise


def turn(angle, dim=2):
    Q = np.eye(dim)
    Q[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return Q


def sector(sectors, inner, outer, divisions, element="quad8", name="RING", lean=0.4):
    """A sector of a ring whose ends wind by `lean` radian from the inside to the outside, in space of height 0.4."""
    dim = 2 if element in ("tri6", "quad8", "quad4") else 3
    mesh = block((1.0, 1.0), divisions, element) if dim == 2 else box((1.0, 1.0, 0.4), divisions, element)
    s, t = mesh.points[:, :2].T
    radius, angle = inner + (outer - inner) * t, -2.0 * np.pi / sectors * s + lean * t
    points = mesh.points.copy()
    points[:, :2] = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    sides = {"BOTTOM": "INSIDE", "YMIN": "INSIDE", "TOP": "OUTSIDE", "YMAX": "OUTSIDE", "LEFT": "FIRST", "XMIN": "FIRST",
             "RIGHT": "SECOND", "XMAX": "SECOND", "ZMIN": "LOW", "ZMAX": "HIGH", "BLOCK": "ALL", "BOX": "ALL"}  # fmt: skip
    return renamed(mesh.replace(points=points), lambda group: f"{name} {sides[group]}" if group in sides else None)


def whole(part, sectors):
    """All sectors in one mesh, with the groups of all."""
    turned = (part.replace(points=part.points @ turn(2 * np.pi * k / sectors, part.dim).T) for k in range(sectors))
    return merge_points(union(*turned), 1e-9)


def model_of(mesh, sectors=0, bodies=("RING",), E=1000.0, kinematics=None):
    model = fc.Model(mesh, kinematics or ("plane_stress" if mesh.dim == 2 else "3d"))
    for k, body in enumerate(bodies):
        model.add_material(fc.LinearElastic(E=E * (1 + k), nu=0.3, density=2.0), groups=[f"{body} ALL"])
        if sectors:
            model.add_cyclic_symmetry(f"{body} FIRST", f"{body} SECOND", sectors=sectors)
    return model


def compare(one, ring, steps=(None, None), n=3, rel=1e-7, **options):
    """All frequencies of the sector, each as often as it is there, are the lowest of the ring; so are effective masses."""
    found = fc.modes(one, steps[0], n, nodal_diameters="all", **options)
    order = np.argsort(found.frequencies)
    reached = min(found.frequencies[found.nodal_diameters == d].max() for d in set(found.nodal_diameters.tolist()))
    complete = order[found.frequencies[order] < reached * (1 - 1e-6)]
    together = fc.modes(ring, steps[1], len(complete), **options)
    scale = np.abs(found.frequencies).max()
    np.testing.assert_allclose(found.frequencies[complete], together.frequencies, rtol=rel, atol=rel * scale)
    np.testing.assert_allclose(found.mass, together.mass, rtol=1e-12)
    ends = np.flatnonzero(np.diff(together.frequencies) > 1e-4 * scale) + 1
    for mine, theirs in zip(
        np.split(found.effective_mass[complete], ends), np.split(together.effective_mass, ends), strict=True
    ):
        np.testing.assert_allclose(mine.sum(axis=0), theirs.sum(axis=0), atol=1e-5 * found.mass.max())
    return found, together


@pytest.mark.parametrize(
    ("sectors", "element", "solver"),
    [
        (2, "quad4", "amg"), (3, "quad8", "direct"), (5, "tri6", "amg"), (6, "quad8", "direct"), (4, "hex8", "direct"),
        pytest.param(4, "hex8", "amg", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_a_free_ring(sectors, element, solver):
    divisions = (6, 3, 2) if element == "hex8" else (6, 3)
    part = sector(sectors, 1.0, 2.0, divisions, element)
    found, together = compare(
        model_of(part, sectors), model_of(whole(part, sectors)), n=5, linear_solver=solver, rel=1e-6
    )
    assert np.abs(together.frequencies[: 3 if part.dim == 2 else 6]).max() < 1e-4 * together.frequencies.max()
    for k, (d, twin) in enumerate(zip(found.nodal_diameters, found.twins)):
        assert (twin == k) == (d in (0, sectors / 2))
        assert found.frequencies[twin] == found.frequencies[k]
    assert (
        not found.effective_mass[found.nodal_diameters > 1].any()
        or np.abs(found.effective_mass[found.nodal_diameters > 1]).max() < 1e-12
    )


@pytest.mark.parametrize("diameters", [2, 3])
def test_a_thin_ring_bends_as_love_says(diameters):
    """``w^2 = E I / (density A R^4) n^2 (n^2 - 1)^2 / (n^2 + 1)`` (Love, Mathematical Theory of Elasticity, section 293)."""
    found = fc.modes(model_of(sector(12, 0.995, 1.005, (20, 1), lean=0.0), 12, E=2.0), n=1, nodal_diameters=diameters)
    n = diameters
    exact = np.sqrt(0.01**2 / 12 * n**2 * (n**2 - 1) ** 2 / (n**2 + 1)) / (2 * np.pi)
    assert found.frequencies == pytest.approx([exact, exact], rel=2e-4)
    assert found.nodal_diameters.tolist() == [n, n]


OPTIONS = {
    "dual": {"formulation": "mortar", "multipliers": "dual"},
    "standard": {"formulation": "mortar", "multipliers": "standard"},
    "continuous": {"formulation": "continuous"},
    "nodes": {"formulation": "node_to_segment", "normals": "averaged"},
    "plain": {"formulation": "mortar", "multipliers": "dual", "surface_smoothing": False},  # it is fitted to one sector
}


def press_fit(sectors, element="quad8", cells=((6, 2), (6, 3)), **options):
    """A sector of a shaft in a hub that is too small, and the whole; what holds the shaft turns with the sectors."""
    made = []
    low, up = ((*own, 1) if element == "hex8" else own for own in cells)
    shaft, hub = (
        sector(sectors, 0.5, 1.0, low, element, "SHAFT", 0.2),
        sector(sectors, 1.0, 1.8, up, element, "HUB", 0.3),
    )
    hub = hub.replace(points=hub.points @ turn(0.2, hub.dim).T)  # the ends of both meet at the joint
    for parts, number in (((shaft, hub), sectors), ((whole(shaft, sectors), whole(hub, sectors)), 0)):
        mesh = union(*parts)
        model = model_of(mesh, number, ("SHAFT", "HUB"))
        model.fix("SHAFT INSIDE", "xyz"[: mesh.dim])
        if options.get("kind") != "tied":
            options = {"clearance": -0.01, **options}
        if "penalty" in options:
            model.fix("HUB OUTSIDE", "xyz"[: mesh.dim])
        model.add_contact("fit", secondary="HUB INSIDE", primary="SHAFT OUTSIDE", **options)
        made.append(model)
    return made


@pytest.mark.filterwarnings("ignore:contact 'fit' (penetrates|is closed where)")
@pytest.mark.each_value
@pytest.mark.parametrize(("options", "element"), [*((name, "quad8") for name in list(OPTIONS)[:4]), ("plain", "hex8")])
@pytest.mark.parametrize("law", ["friction", "none", "tied", "penalty"])
def test_a_press_fit(options, element, law):
    """Closed nodes held, about the settled step of each: conditions at the ends of the sector go on in the next one."""
    more = {"friction": {"friction": 0.5}, "none": {}, "tied": {"kind": "tied"}, "penalty": {"penalty": 3e4}}[law]
    one, ring = press_fit(5, element, **OPTIONS[options], **more)
    if law in ("none", "penalty"):
        for model in (one, ring):
            model.fix("HUB OUTSIDE", "xyz"[: model.mesh.dim])
    steps = (None, None) if law == "tied" else tuple(fc.solve(model, 1)[-1] for model in (one, ring))
    # In space the pressures of the step follow from facets of one sector: their stresses are equal to 1e-5.
    options = {"hold_sliding": law == "friction", "stress_stiffening": element == "quad8"}
    found, _ = compare(one, ring, steps, n=2, rel=1e-7 if element == "quad8" else 1e-6, **options)
    with pytest.warns(fc.FastcontactWarning, match="only modes with 0 nodal diameters"):
        alone = fc.modes(one, steps[0], 2, **options).frequencies
    np.testing.assert_allclose(alone, found.frequencies[:2], rtol=1e-9)


@pytest.mark.parametrize("options", ["dual", "standard", "nodes"])
def test_meshes_that_do_not_match_and_a_joint_that_is_not_a_circle(options):
    """Tied: what a mortar tests at the end of a sector is half a function, the other half is in the next sector."""
    one, ring = press_fit(6, cells=((5, 2), (7, 2)), kind="tied", **OPTIONS[options])
    compare(one, ring, n=2)


def test_a_block_that_meets_its_axis_stands_on_another():
    """A quarter of two square bars, tied: the conditions on the axis hold once round all sectors."""
    parts, sides = [], {"YMIN": "FIRST", "XMIN": "SECOND", "ZMIN": "UNDER", "ZMAX": "OVER", "BOX": "ALL"}
    for name, bottom, n in (("LOW", 0.0, 2), ("UP", 1.0, 3)):
        mesh = box((1.0, 1.0, 1.0), (n, n, 2), "hex8", (0.0, 0.0, bottom))
        parts.append(renamed(mesh, lambda group, name=name: f"{name} {sides[group]}" if group in sides else None))
    one = model_of(union(*parts), 4, ("LOW", "UP"))
    ring = model_of(union(*(whole(part, 4) for part in parts)), 0, ("LOW", "UP"))
    for model in (one, ring):
        model.fix("LOW UNDER", "xyz")
        model.add_contact("joint", kind="tied", secondary="UP UNDER", primary="LOW OVER", surface_smoothing=False)
    compare(one, ring, n=3)


def test_shapes_of_the_whole_ring(tmp_path):
    """They vibrate at their frequency, have unit modal mass, and waves of the diameters asked for."""
    part = sector(6, 1.0, 2.0, (5, 2))
    found = fc.modes(model_of(part, 6), n=2, nodal_diameters=[2, 1])
    assert found.nodal_diameters.tolist() == [1] * 4 + [2] * 4
    ring = found.whole_ring()
    merged = whole(part, 6)
    place = np.linalg.norm(merged.points[:, None] - ring.mesh.points[None], axis=2).argmin(axis=1)
    together = fc.modes(model_of(merged), n=14)
    ends = np.concatenate([part.points_of("RING FIRST"), part.points_of("RING SECOND")])
    inside = ~np.isin(place % part.n_points, ends)  # nodal stresses of a sector end with it
    for k, mode in enumerate(ring):
        same = np.flatnonzero(np.abs(together.frequencies - mode.load_factor) < 1e-6)
        shape = mode.displacement[place].ravel()
        # In the span of the ring's own shapes of that frequency, which are of unit modal mass.
        basis = together.shapes[same].reshape(len(same), -1).T
        factors, rest, *_ = np.linalg.lstsq(basis, shape)
        assert rest[0] < 1e-12 * (shape @ shape)
        assert np.linalg.norm(factors) == pytest.approx(1.0, rel=1e-6)
        stress = sum(factor * together[int(j)].stress for factor, j in zip(factors, same))
        if mode.load_factor > 1e-3:  # no rigid motion
            assert np.abs(mode.stress[place] - stress)[inside].max() < 1e-6 * np.abs(stress).max()
        assert len(found.phases(k, 8)) == 8
    with fc.ResultWriter(tmp_path / "ring.vtkhdf", ring) as out:
        for mode in ring.phases(0, 4):
            out.write(mode)
    with fc.open_results(tmp_path / "ring.vtkhdf") as results:
        np.testing.assert_allclose(results[2].displacement, -ring[0].displacement, atol=1e-12)
    assert "nodal diameters" in repr(found)


def test_what_is_refused():
    part = sector(6, 1.0, 2.0, (5, 2))
    model = model_of(part, 6)
    for given, said in (([4], "has 0 to 3"), ([], "has 0 to 3"), ("none", 'write "all"'), (-1, "has 0 to 3")):
        refused(fc.ModelError, said, fc.modes, model, nodal_diameters=given)
    refused(fc.ModelError, "need a sector of a ring", fc.modes, model_of(part), nodal_diameters=0)
    plate = fc.obstacles.HalfSpace((0.0, 3.0), (0.0, -1.0))
    model.add_obstacle("plate", secondary="RING OUTSIDE", obstacle=plate, force={"y": -1.0})
    refused(fc.ModelError, "'plate' is driven by a force", fc.modes, model, nodal_diameters=0)
    refused(fc.ModelError, "shapes of the whole ring need", fc.modes(model_of(part), n=1).whole_ring)


def test_a_case_file_and_the_command_line_ask_for_nodal_diameters(tmp_path, capsys):
    part = sector(6, 1.0, 2.0, (5, 2))
    fc.write_mesh(tmp_path / "part.vtu", part)
    path, out, shapes = (tmp_path / name for name in ("ring.toml", "ring.vtkhdf", "modes.vtkhdf"))
    path.write_text(
        'kinematics = "plane_stress"\n[mesh]\nfile = "part.vtu"\n[[material]]\nE = 1000.0\nnu = 0.3\ndensity = 2.0\n'
        '[[support]]\ngroup = "RING INSIDE"\nx = 0.0\ny = 0.0\n[ramp]\nsteps = 1\n[modes]\nn = 2\nnodal_diameters = "all"\n'
        '[[cyclic_symmetry]]\nfirst = "RING FIRST"\nsecond = "RING SECOND"\nsectors = 6\n'
    )
    assert main(["run", str(path), "-o", str(out), "--modes", str(shapes)]) == 0
    said = capsys.readouterr().out
    for d, pairs in enumerate(("s: ", ", each of two", "s, each of two", "s: ")):
        assert f"step, {d} nodal diameter{pairs}" in said
    with fc.open_results(shapes) as results:
        assert len(results) == 12
        assert results.mesh.n_points == 6 * part.n_points
    assert main(["run", str(path), "-o", str(out), "--modes", str(shapes), "--nodal-diameters", "0,3"]) == 0
    assert len(fc.open_results(shapes)) == 4
    assert main(["run", str(path), "-o", str(out), "--nodal-diameters", "0;3"]) == 1
    assert "integers separated by commas" in capsys.readouterr().err
    gif = tmp_path / "mode.gif"
    args = ["plot", str(shapes), "--step", "2", "--scale", "0.1", "--field", "displacement"]
    assert main([*args, "--animate", str(gif), "--phases", "3"]) == 0
    assert gif.read_bytes()[:4] == b"GIF8"
    assert main([*args, "--png", str(tmp_path / "mode.png"), "--phases", "3"]) == 1
    assert "--animate FILE" in capsys.readouterr().err
    assert main([*args, "--animate", str(gif), "--phases", "1"]) == 1
