"""Gmsh files of versions 1 to 4.1 and code_aster's text: the same mesh from each."""

import numpy as np
import pytest
from models import body_of
from refusals import refused

import fastcontact as fc
from fastcontact.mesh import elements
from fastcontact.mesh.files import aster_mail

pytestmark = pytest.mark.usefixtures("meshio_here")

GMSH_KINDS = {"line2": 1, "tri3": 2, "quad4": 3, "tet4": 4, "hex8": 5, "wedge6": 6, "pyramid5": 7}
MAIL_KINDS = {element: keyword for keyword, element in aster_mail.TYPES.items()}
SOLIDS = [name for name, element in elements.ELEMENTS.items() if element.dim > 1]


def version_1(mesh):
    """Return the text of a Gmsh file of version 1; the physical group of a cell is the number of its kind."""
    rows = [f"{i + 1} {x} {y} {z}" for i, (x, y, z) in enumerate(np.pad(mesh.points, [(0, 0), (0, 3 - mesh.dim)]))]
    cells = [
        f"{len(block)} {GMSH_KINDS[name]} {GMSH_KINDS[name]} 1 {block.shape[1]} {' '.join(map(str, row + 1))}"
        for name, block in mesh.cells.items()
        for row in block
    ]
    return "\n".join(["$NOD", str(len(rows)), *rows, "$ENDNOD", "$ELM", str(len(cells)), *cells, "$ENDELM", ""])


@pytest.mark.parametrize("element", ["tri3", "quad4", "tet4", "hex8", "wedge6", "pyramid5"])
def test_gmsh_version_1(element, tmp_path):
    mesh = body_of(element)
    (tmp_path / "a.msh").write_text(version_1(mesh))
    found = fc.read_mesh(tmp_path / "a.msh")
    np.testing.assert_array_equal(found.points, mesh.points)
    for name, block in mesh.cells.items():
        np.testing.assert_array_equal(found.cells[name], block)
    tag = ("surface", "volume")[mesh.dim - 2]
    np.testing.assert_array_equal(found.cells_of(f"{tag}_{GMSH_KINDS[element]}")[element], mesh.cells[element])


@pytest.mark.parametrize(("version", "binary"), [(2.2, False), (2.2, True), (4.0, False), (4.1, False), (4.1, True)])
def test_gmsh_versions_of_today(gmsh, version, binary, tmp_path):
    box = gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [box], name="BODY")
    if version != 4.0:
        gmsh.model.addPhysicalGroup(3, [box], name="AGAIN")
    gmsh.model.addPhysicalGroup(2, [1], name="SIDE")
    gmsh.model.mesh.generate(3)
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", binary)
    gmsh.write(str(tmp_path / "a.msh"))
    expected = fc.from_gmsh()
    found = fc.read_mesh(tmp_path / "a.msh")
    assert set(found.group_names) == set(expected.group_names)
    for name in expected.cell_groups:
        assert len(found.cell_groups[name]) == len(expected.cell_groups[name])
    assert len(found.cells["tri3"]) == len(expected.cells["tri3"])


def test_gmsh_version_4_with_cells_in_several_groups(tmp_path):
    entities = ["$Entities", "0 0 1 0", "1 0 0 0 1 1 0 2 7 8 0", "$EndEntities", ""]
    (tmp_path / "a.msh").write_text("\n".join(["$MeshFormat", "4 0 8", "$EndMeshFormat", *entities]))
    refused(fc.FileError, r"version 4\.0, with cells in several physical groups", fc.read_mesh, tmp_path / "a.msh")


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda s: s.replace("$ENDELM", ""), "has no complete section [$]ELM"),
        (lambda s: s.replace("$ENDNOD", ""), "has no complete section [$]NOD"),
        (lambda s: s[: s.index("$ENDELM") - 6] + "\n$ENDELM\n", "is damaged"),
    ],
)
def test_a_damaged_file_of_version_1(change, text, tmp_path):
    (tmp_path / "a.msh").write_text(change(version_1(body_of("quad4"))))
    refused(fc.FileError, text, fc.read_mesh, tmp_path / "a.msh")


def mail(mesh):
    """Return the text of a file of code_aster, with the heads that its own writers give."""
    text = ["TITRE", "A mesh, written as code_aster's IMPR_RESU does % not a comment here", "FINSF", "% a comment"]
    text += [f"COOR_{mesh.dim}D NOM=INDEFINI NBOBJ={mesh.n_points} NUMIN=1 NUMAX=9"]
    text += [
        f"N{i + 1} " + " ".join(f"{x:.16E}".replace("E", "D") for x in place) for i, place in enumerate(mesh.points)
    ]
    text += ["FINSF"]
    number = 0
    for name, block in mesh.cells.items():
        text += [f"{MAIL_KINDS[name]} NOM=INDEFINI"]
        order = aster_mail.NODE_ORDER.get(MAIL_KINDS[name], range(block.shape[1]))
        for row in block[:, np.argsort(order)] + 1:
            number += 1
            nodes = [f"N{node}" for node in row]
            text += [f"M{number} {' '.join(nodes[:7])}", f"   {' '.join(nodes[7:])}"]  # rows go on in the next line
        text += ["FINSF"]
    text += ["HEXA20", "FINSF", "POI1", "MP N1", "FINSF", "GROUP_MA NOM=TIP", "MP", "FINSF"]  # no hexahedra
    for group, members in mesh.cell_groups.items():
        text += ["GROUP_MA", group, *(f"M{m + 1}" for m in members), "FINSF"]
    return "\n".join([*text, "GROUP_NO", "PAIR N1 N2", "FINSF", "FIN", "what follows is not read"])


@pytest.mark.parametrize("element", SOLIDS)
def test_code_aster_s_text(element, tmp_path):
    mesh = body_of(element)
    (tmp_path / "a.mail").write_text(mail(mesh))
    found = fc.read_mesh(tmp_path / "a.mail")
    np.testing.assert_array_equal(found.points, mesh.points)
    assert sorted(found.cell_groups) == sorted(mesh.cell_groups)
    for group in mesh.cell_groups:
        for name, block in mesh.cells_of(group).items():
            np.testing.assert_array_equal(found.cells_of(group)[name], block)
    assert [found.points_of(name).tolist() for name in ("TIP", "PAIR")] == [[0], [0, 1]]


@pytest.mark.parametrize("element", ["hex20", "hex27", "wedge15", "wedge18"])
def test_middle_nodes_of_code_aster_stand_on_its_edges(element):
    """Bottom edges, upright ones, top ones, then faces: as the order of its cells is documented (U3.01.00)."""
    place = elements.get(element).nodes
    order = np.argsort(aster_mail.NODE_ORDER[MAIL_KINDS[element]])
    corners = 8 if element.startswith("hex") else 6
    half = corners // 2
    ring = [(i, (i + 1) % half) for i in range(half)]
    edges = ring + [(i, i + half) for i in range(half)] + [(i + half, j + half) for i, j in ring]
    faces = [(i, j, j + half, i + half) for i, j in ring]
    if element == "hex27":
        faces = [(0, 1, 2, 3), *faces, (4, 5, 6, 7), tuple(range(8))]
    elif element != "wedge18":
        faces = []
    expected = [place[list(nodes)].mean(axis=0) for nodes in [*edges, *faces]]
    np.testing.assert_allclose(place[order][corners:], expected, atol=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("FIN\nwhat follows is not read", "", "ends without FIN"),
        ("N1 N2\nFINSF\nFIN", "N1 N2\n", "GROUP_NO has no FINSF"),
        ("PAIR N1 N2", "PAIR N1 N77", r"line \d+: there is no node 'N77'"),
        ("TIP\nMP", "TIP\nMP M999", r"line \d+: there is no cell 'M999'"),
        ("COOR_2D", "COOR_4D", r"line 5: COOR_4D is not known; a mesh has COOR_2D"),
        ("MP N1\n", "MP\n", r"POI1 has 1 words, which do not form rows of 2"),
        ("N1 0.0", "N1 zero", r"line \d+: 'zero\S*' is not a number"),
        ("MP N1\n", "MP N99\n", r"line \d+: there is no node 'N99' before this line"),
        ("GROUP_NO\nPAIR N1 N2", "GROUP_NO", r"GROUP_NO has no name"),
    ],
)
def test_damaged_text_of_code_aster(old, new, text, tmp_path):
    whole = mail(body_of("quad4"))
    assert old in whole
    (tmp_path / "a.mail").write_text(whole.replace(old, new))
    refused(fc.FileError, text, fc.read_mesh, tmp_path / "a.mail")
