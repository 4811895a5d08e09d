"""Meshes of code_aster's specs: groups of its command files, and points of its keywords."""

import functools
import re
from pathlib import Path
from typing import Any

import numpy as np

import fastcontact as fc

Entry = dict[str, Any]


class MissingError(Exception):
    """What a spec asks for and fastcontact, or this translation, does not have."""


def mesh_of(folder: Path, spec: Entry, model: Entry) -> fc.Mesh:
    mesh_spec = next(
        (m for m in spec["meshes"] if Path(m["snapshot_path"]).name == Path(model["mesh"] or "").name),
        spec["meshes"][0],
    )
    mesh = _file(folder / mesh_spec["file"])
    for entry in mesh_spec.get("derived_groups") or ():
        mesh = _with_derived(mesh, entry)
    return _modelled(mesh, model)


@functools.cache
def _file(path: Path) -> fc.Mesh:
    return fc.read_mesh(path)


def _with_derived(mesh: fc.Mesh, entry: Entry) -> fc.Mesh:
    """Return the mesh with the groups that DEFI_GROUP makes."""
    if any(key.startswith("unresolved") for key in entry):
        return mesh
    how = entry.get("how", "")
    sources = re.findall(r"'([^']+)'", how) or re.findall(r"same cells as (\S+)", how)
    if "new_node_groups" in entry:
        groups = {name: nodes_of(mesh, {"GROUP_MA": name}) for name in mesh.cell_groups}
        return mesh.with_groups(points={**groups, **mesh.point_groups})
    if "new_node_group" in entry and how.startswith("nodes of cell group"):
        nodes = nodes_of(mesh, {"GROUP_MA": sources})
        return mesh.with_groups(points=dict.fromkeys(listed(entry["new_node_group"]), nodes))
    if "new_node_group" in entry and how.startswith(("DIFFE", "INTERSEC")):
        first, *others = (nodes_of(mesh, {"GROUP_NO": name}) for name in sources)
        combine = np.setdiff1d if how.startswith("DIFFE") else np.intersect1d
        found = functools.reduce(combine, others, first)
        if len(found) != entry.get("n", len(found)):
            raise MissingError(f"finds {len(found)} nodes in the derived group {entry}")
        return mesh.with_groups(points=dict.fromkeys(listed(entry["new_node_group"]), found))
    if "new_cell_group" in entry and how.startswith(("UNION", "same cells")):
        members = np.concatenate([mesh.cell_groups[name] for name in sources])
        return mesh.with_groups(cells=dict.fromkeys(listed(entry["new_cell_group"]), members))
    raise MissingError(f"needs the derived group {entry}")


def _modelled(mesh: fc.Mesh, model: Entry) -> fc.Mesh:
    """Return the mesh without the solid cells that no part of the model names."""
    if any(part.get("TOUT") == "OUI" for part in model["parts"]):
        return mesh
    groups = [name for part in model["parts"] for name in listed(part.get("GROUP_MA", ()))]
    named = np.unique(np.concatenate([mesh.cell_groups[name] for name in groups]))
    solid = np.concatenate([mesh.offsets[name] + np.arange(len(block)) for name, block in mesh.solids.items()])
    if not np.isin(solid, named).all():
        raise MissingError(f"needs a model of a part of the mesh ({', '.join(groups)})")
    return mesh


def nodes_of(mesh: fc.Mesh, place: Entry) -> np.ndarray:
    """Return the points that the keywords TOUT, GROUP_MA, GROUP_NO and NOEUD of an entry name."""
    found = []
    if place.get("TOUT") == "OUI":
        found.append(np.arange(mesh.n_points))
    for name in listed(place.get("GROUP_NO", ())):
        found.append(mesh.points_of(name))
    for name in listed(place.get("GROUP_MA", ())):
        found += [block.ravel() for block in mesh.cells_of(name).values()]
        if not mesh.cells_of(name):  # a group of vertices
            found.append(mesh.points_of(name))
    for name in listed(place.get("NOEUD", ())):
        found.append(np.array([int(str(name).lstrip("N")) - 1]))
    if "MAILLE" in place:
        raise MissingError("needs cells by their number (MAILLE)")
    return np.unique(np.concatenate(found)) if found else np.empty(0, int)


def listed(value: Any) -> list[Any]:
    return list(value) if isinstance(value, (list, tuple)) else [value]
