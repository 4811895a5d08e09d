"""Small valid files of every supported format, from which the fuzzer starts."""

import contextlib
import io
import shutil
import warnings
from pathlib import Path

import numpy as np
from case_texts import square

import fastcontact as fc
from fastcontact.mesh.files.med import write_med_mesh

DATA = Path(__file__).resolve().parents[2] / "data"

# Formats by what reads them; the meshes of meshio go by their suffix, with a mark for the kind of the file.
MESHIO = {
    "gmsh41.msh": {"file_format": "gmsh", "binary": False},
    "gmsh41-binary.msh": {"file_format": "gmsh", "binary": True},
    "ascii.vtu": {"file_format": "vtu", "binary": False},
    "binary.vtu": {"file_format": "vtu", "binary": True, "compression": None},
    "zlib.vtu": {"file_format": "vtu", "binary": True, "compression": "zlib"},
    "lzma.vtu": {"file_format": "vtu", "binary": True, "compression": "lzma"},
    "xml.xdmf": {"file_format": "xdmf", "data_format": "XML"},
    "hdf.xdmf": {"file_format": "xdmf", "data_format": "HDF"},
    "dolfin.xml": {"file_format": "dolfin-xml"},
}
for file in ("gmsh22.msh", "gmsh40.msh", "vtk42.vtk", "vtk51.vtk", "ply.ply", "stl.stl"):  # in text and binary
    kind, _, suffix = file.partition(".")
    MESHIO[file] = {"file_format": kind, "binary": False}
    MESHIO[f"{kind}-binary.{suffix}"] = {"file_format": kind, "binary": True}
NAMED_BY_FORMAT = (
    "abaqus.inp", "medit.mesh", "medit.meshb", "nastran.bdf", "flac3d.f3grid", "mdpa.mdpa", "avsucd.avs", "permas.post",
    "tecplot.dat", "ugrid.ugrid", "netgen.vol", "netgen.vol.gz", "h5m.h5m", "hmf.hmf", "cgns.cgns", "su2.su2",
    "tetgen.node", "obj.obj", "off.off", "wkt.wkt",
)  # fmt: skip
MESHIO |= {file: {"file_format": file.partition(".")[0]} for file in NAMED_BY_FORMAT}


# Two cubes, one pressed and dragged over the other, with most of what decks may hold.
DECK = f"""*Heading
 two cubes
*Node
{square(1, 0)}{square(5, 1)}{square(11, 1)}{square(15, 2)}*Element, type=C3D8, elset=low
1, 1, 2, 3, 4, 5, 6, 7, 8
*Element, type=C3D8, elset=up
2, 11, 12, 13, 14,
 15, 16, 17, 18
*Nset, nset=bottom, generate
1, 4, 1
*Nset, nset=top
15, 16, 17, 18
*Elset, elset=both
low, up
*Surface, name=sm, type=ELEMENT
low, S2
*Surface, name=ss
up, S1
*Surface, name=roof
up, S2
*Material, name=steel
*Elastic
200000., 0.3
*Density
7.8E-9
*Expansion
1.2D-5
*Solid Section, elset=both, material=steel
*Surface Interaction, name=si
*Friction
0.2
*Contact Pair, interaction=si, type=SURFACE TO SURFACE
ss, sm
*Amplitude, name=up
0., 0., 1., 1., 2., 0.5
*Equation
2
15, 1, 1., 16, 1, -1.
*Boundary
bottom, 1, 3
top, 1, 2
*Step, nlgeom=NO
 press
*Static
0.5, 1.
*Dsload
roof, P, 100.
*Node Print, nset=top
U
*End Step
*Step
*Static
*Boundary, amplitude=up
top, 1, 1, 0.001
*Cload
17, 3, -2.
*End Step
"""


def small_mesh() -> fc.Mesh:
    """Two blocks of unlike elements, with groups of solids, facets and points."""
    points = [(x, y) for y in (0.0, 1.0, 2.0) for x in (0.0, 1.0, 2.0)]
    cells = {"quad4": [(0, 1, 4, 3), (1, 2, 5, 4)], "tri3": [(3, 4, 7), (3, 7, 6)], "line2": [(0, 1), (1, 2), (6, 7)]}
    groups = {"LOWER": [0, 1], "UPPER": [2, 3], "BOTTOM": [4, 5], "TOP": [6]}
    return fc.Mesh(points, cells, groups, {"CORNER": [0], "MIDDLE": [3, 4]})


def solid_mesh(tetrahedra: bool = False) -> fc.Mesh:
    """A cube of eight hexahedra, or one cut into six tetrahedra."""
    if not tetrahedra:
        return fc.generate.GENERATORS["box"](divisions=(2, 2, 2))
    corners = [(i & 1, i >> 1 & 1, i >> 2) for i in range(8)]
    cells = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]
    return fc.Mesh(corners, {"tet4": cells, "tri3": [(0, 1, 3), (0, 3, 2)]}, {"BASE": [6, 7]})


def contact_case() -> tuple[fc.Model, list[fc.StepResult]]:
    """A tiny solved contact problem."""
    mesh = fc.generate.half_spheres("tri3", size=12.0)
    model = fc.Model(mesh, kinematics="axisymmetric", case_text='title = "tiny"\n')
    model.add_material(fc.LinearElastic(E=20_000.0, nu=0.3))
    model.fix("A1A2", "x")
    model.prescribe("A2B2", y=-0.5)
    model.prescribe("A1B1", y=+0.5)
    model.add_contact("hertz", secondary="CONT1", primary="CONT2", formulation="node_to_segment")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return model, list(fc.solve(model, ramp=fc.linear_ramp(2)))


def make_seeds(folder: Path) -> dict[str, Path]:
    """Write a valid file of each format into `folder`; return them by the name of their kind."""
    folder.mkdir(parents=True, exist_ok=True)
    seeds = {"flat.med": folder / "flat.med", "solid.med": folder / "solid.med"}
    write_med_mesh(seeds["flat.med"], small_mesh())
    write_med_mesh(seeds["solid.med"], solid_mesh())
    model, steps = contact_case()
    seeds["fields.rmed"] = folder / "fields.rmed"
    fc.write_med_results(seeds["fields.rmed"], model.mesh, steps)
    seeds["results.vtkhdf"] = folder / "results.vtkhdf"
    with fc.ResultWriter(seeds["results.vtkhdf"], model) as out:
        for step in steps:
            out.write(step)
    seeds |= {f"{path.stem}.toml": _case(path, folder) for path in sorted((DATA / "cases").glob("*.toml"))}
    seeds["cubes.deck"] = folder / "cubes.deck"
    seeds["cubes.deck"].write_text(DECK, encoding="utf-8")
    return seeds | _foreign(folder)


def _case(path: Path, folder: Path) -> Path:
    """Copy a ready-made case; the meshes it names are copied beside it."""
    target = folder / path.name
    text = path.read_text(encoding="utf-8")
    if "../meshes/" in text:
        for mesh in (DATA / "meshes").glob("*.med"):
            if mesh.name in text:
                shutil.copy(mesh, folder / mesh.name)
        text = text.replace("../meshes/", "")
    target.write_text(text, encoding="utf-8")
    return target


def _foreign(folder: Path) -> dict[str, Path]:
    """Write the formats of meshio, each with the richest mesh that it takes."""
    import meshio

    flat, solid, tets = small_mesh(), solid_mesh(), solid_mesh(tetrahedra=True)
    surface = fc.Mesh(tets.points, {"tri3": [(0, 1, 3), (0, 3, 2), (1, 5, 3)]})
    triangles = fc.Mesh(flat.points, {"tri3": flat.cells["tri3"]})
    candidates = [_for_meshio(mesh) for mesh in (flat, solid, tets, surface, triangles)]
    seeds = {}
    for name, options in MESHIO.items():
        path = folder / name
        # meshio's reader of tetgen never ends on a file without tetrahedra.
        for mesh in candidates[2:3] if name.endswith(".node") else candidates:
            said = io.StringIO()
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    meshio.write(path, mesh(_carried(options["file_format"])), **options)
                    meshio.read(path, file_format=options["file_format"].rstrip("0124") or None)
                except (Exception, SystemExit):
                    path.unlink(missing_ok=True)
                    continue
            seeds[name] = path
            break
    return seeds


def _carried(file_format: str) -> str:
    """Return what stands for groups in a format."""
    if file_format.startswith("gmsh"):
        return "physical"
    return "arrays" if file_format in ("vtk42", "vtk51", "vtu", "xdmf") else "sets" if file_format == "abaqus" else ""


def _for_meshio(mesh: fc.Mesh):
    """Return a function that makes meshio's mesh with physical tags, arrays or sets."""
    import meshio

    from fastcontact.mesh import elements

    points = np.pad(mesh.points, [(0, 0), (0, 3 - mesh.dim)])
    cells = [(elements.get(name).meshio, np.array(block)) for name, block in mesh.cells.items()]

    def build(carried: str):
        parts: dict = {"points": points, "cells": cells}
        if carried == "physical":
            tags = [np.full(len(block), 1 + i) for i, (_, block) in enumerate(cells)]
            parts["cell_data"] = {"gmsh:physical": tags, "gmsh:geometrical": tags}
            parts["field_data"] = {"FIRST": np.array([1, mesh.dim])}
        if carried == "arrays":
            parts["cell_data"] = {"cell_group:FIRST": [np.ones(len(block), np.int32) for _, block in cells]}
            parts["point_data"] = {"point_group:ODD": np.arange(len(points), dtype=np.int32) % 2}
        if carried == "sets":
            parts["point_sets"] = {"ODD": np.arange(1, len(points), 2)}
        return meshio.Mesh(**parts)

    return build
