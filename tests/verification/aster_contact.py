"""Contact zones of code_aster's specs: formulation, options, rigid surfaces, and unsupported features."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from aster_loads import Support, constant
from aster_mesh import Entry, MissingError, listed, nodes_of
from scipy.spatial import cKDTree

import fastcontact as fc
from fastcontact.contact.integration import nodal_areas
from fastcontact.contact.surface import surface

# How code_aster iterates, and how it describes the same thing to itself.
ITERATIONS = {
    "command", "name", "zones", "VERI_NORM", "ALGO_RESO_CONT", "ALGO_RESO_GEOM", "ALGO_RESO_FROT", "ITER_GEOM_MAXI",
    "ITER_CONT_MAXI", "ITER_CONT_MULT", "ITER_FROT_MAXI", "ITER_CONT_TYPE", "RESI_GEOM", "RESI_FROT", "RESI_CONT",
    "RESI_ABSO", "STOP_SINGULIER", "NB_RESOL", "MODELE", "INFO", "STOP_INTERP", "ITER_GCP_MAXI", "PRE_COND",
    "COEF_RESI", "RECH_LINEAIRE",
}  # fmt: skip
CONTACT = {"FORMULATION", "FROTTEMENT", "REAC_GEOM", "NB_ITER_GEOM", "LISSAGE"}
# Numbers of an augmented Lagrangian, of a projection or a search, on which its converged result does not depend.
ZONE_ITERATIONS = {
    "interface", "COEF_CONT", "COEF_FROT", "COEF_MATR_FROT", "ADAPTATION", "SEUIL_INIT", "SEUIL_AUTO", "TYPE_APPA",
    "TYPE_PROJECTION", "TYPE_JACOBIEN", "TOLE_INTERP", "ORDRE_INT",
}  # fmt: skip
ZONE = {
    "master", "slave", "ALGO_CONT", "ALGO_FROT", "APPARIEMENT", "NORMALE", "INTEGRATION", "CONTACT_INIT", "E_N", "E_T",
    "COULOMB", "TOLE_PROJ_EXT", "VECT_MAIT", "MAIT_FIXE", "MAIT_VECT_Y", "RESOLUTION", "SANS_GROUP_NO_FR",
    "SANS_NOEUD_FR", "GLISSIERE", "DIST_APPA",
}  # fmt: skip
# What a keyword may say: that which is translated, or makes no difference to a result.
CHOICES = {
    "ALGO_CONT": ("CONTRAINTE", "STANDARD", "PENALISATION", "LAGRANGIEN", "LAC"),
    "ALGO_FROT": ("STANDARD", "PENALISATION", "LAGRANGIEN"),
    "APPARIEMENT": ("MAIT_ESCL", "NODAL", "MORTAR"),
    "NORMALE": ("MAIT", "MAIT_ESCL", "ESCL"),
    "CONTACT_INIT": ("OUI", "NON", "INTERPENETRE"),
    # VECT_Y turns the frame of the tangents, and friction is the same in every direction.
    "VECT_MAIT": ("AUTO", "FIXE", "VECT_Y"),
    "RESOLUTION": ("OUI", "NON"),
    "GLISSIERE": ("OUI", "NON"),
}
INTEGRATION = {"AUTO": "node", "GAUSS": "gauss", "SIMPSON": "simpson"}
# Material added on a side, where we count what is added to the gap.
OFFSETS = {"DIST_ESCL": "clearance", "DIST_MAIT": "clearance_primary"}
NO_OFFSETS = ("DIST_POUTRE", "DIST_COQUE")
EXCLUSIONS = ("SANS_GROUP_NO", "SANS_NOEUD", "SANS_GROUP_MA", "SANS_MAILLE")


def add_zone(model: fc.Model, name: str, contact: Entry, zone: Entry, supports: Sequence[Support]) -> None:
    """Add a zone of DEFI_CONTACT as a contact pair, or as an obstacle where no solid lies behind the master side.

    The discrete method is node-to-segment. The continuous one is the continuous one where its integration points are Gauss
    points or the slave nodes (a value on a coarse mesh depends on that); where those carry quadratic fields, closing each
    is node-to-segment. It is mortar where code_aster integrates over cut facets, and for other rules on meshes that are
    quadratic or do not match. A penalty along the normal, which only approximates the exact method, is replaced by it.
    """
    mesh = model.mesh
    solid = np.unique(np.concatenate([block.ravel() for block in mesh.solids.values()]))
    behind, backed = (np.isin(nodes_of(mesh, {"GROUP_MA": zone[side]}), solid).all() for side in ("slave", "master"))
    if not behind:
        raise MissingError(f"needs a rigid meshed surface without solid as the secondary side ({zone['slave']})")
    options = _formulation(contact, zone, mesh, against_obstacle=not backed)
    options |= _normals(contact, zone, mesh.dim, options["formulation"]) if backed else {}
    options |= _kind(zone)
    options |= {ours: -constant(zone[key], f"{key} of a contact zone") for key, ours in OFFSETS.items() if key in zone}
    if contact.get("FROTTEMENT", "SANS") == "COULOMB":
        options["friction"] = constant(zone.get("COULOMB", 0.0), "COULOMB of a contact zone")
        options["slip"] = "primary"
        options |= _frictionless_nodes(zone, mesh, supports)
        if zone.get("ALGO_FROT") == "PENALISATION":
            options["tangential_penalty"] = _tangential_penalty(model, zone)
    options |= _excluded_nodes(zone, mesh, supports, options, against_obstacle=not backed)
    if backed:
        model.add_contact(name, secondary=zone["slave"], primary=zone["master"], **options)
    else:
        model.add_obstacle(name, secondary=zone["slave"], obstacle=_obstacle(mesh, zone, supports), **options)


def _kind(zone: Entry) -> dict[str, Any]:
    """Return what a zone says about closing, opening and searching."""
    options: dict[str, Any] = {}
    if "DIST_APPA" in zone:
        options["search_distance"] = float(zone["DIST_APPA"])
    if zone.get("GLISSIERE") == "OUI":
        # Only with OUI all nodes start closed.
        options["kind"] = "bilateral" if zone.get("CONTACT_INIT") == "OUI" else "bilateral_once_closed"
    if zone.get("RESOLUTION") == "NON":
        options["kind"] = "gap_only"
    return options


def _tangential_penalty(model: fc.Model, zone: Entry) -> Callable[[np.ndarray], np.ndarray]:
    """Return E_T, a force by slip at each slave node, as a shear by slip at reference positions."""
    side = surface(model.mesh, zone["slave"])
    areas = nodal_areas(side, model.mesh.points, model.kinematics == "axisymmetric")
    tree, stiffness = cKDTree(model.mesh.points[side.points]), float(zone["E_T"])
    circle = 2 * np.pi if model.kinematics == "axisymmetric" else 1.0
    return lambda positions: circle * stiffness / areas[tree.query(positions)[1]]


def _normals(contact: Entry, zone: Entry, dim: int, formulation: str) -> dict[str, Any]:
    """Return the option `normals` of a zone: those of the master facets, unless they are smoothed."""
    if zone.get("VECT_MAIT") == "FIXE":
        return {"normals": [float(component) for component in zone["MAIT_FIXE"][:dim]]}
    if zone.get("NORMALE") == "ESCL":
        return {"normals": "secondary"}
    # MAIT_ESCL is the mean of both sides' normals; the sides that have it are flat.
    if contact.get("LISSAGE") == "OUI":
        return {"normals": "averaged"}
    # Normals that jump between facets show where friction acts; without it they only keep the pairing from settling.
    faceted = dim == 2 and formulation != "mortar" and contact.get("FROTTEMENT", "SANS") == "COULOMB"
    return {"normals": "facet"} if faceted else {}


def _formulation(contact: Entry, zone: Entry, mesh: fc.Mesh, *, against_obstacle: bool) -> dict[str, Any]:
    facets = mesh.cells_of(zone["slave"], dim=mesh.dim - 1) | mesh.cells_of(zone["master"], dim=mesh.dim - 1)
    quadratic = not set(facets) <= {"line2", "tri3", "quad4"}
    matching = zone.get("interface", {}).get("matching", False)
    mortar = zone.get("APPARIEMENT") == "MORTAR" or zone.get("ALGO_CONT") == "LAC"
    rule = INTEGRATION.get(zone.get("INTEGRATION", "AUTO"), "gauss")
    if rule == "node" and set(facets) & {"tri6", "quad8"}:
        rule = "gauss"  # as AUTO does where nodes have no positive areas
    if contact.get("FORMULATION", "DISCRETE") == "DISCRETE":
        options: dict[str, Any] = {"formulation": "node_to_segment"}
        if zone.get("APPARIEMENT") == "NODAL" and not against_obstacle:
            options["opposite"] = "node"
    elif mortar or (rule == "simpson" and not against_obstacle and (quadratic or not matching)):
        return {"formulation": "mortar"}
    elif rule == "node" and quadratic and not against_obstacle:
        options = {"formulation": "node_to_segment"}
    else:
        options = {"formulation": "continuous", "integration": rule}
        if not against_obstacle:
            options["surface_smoothing"] = False
        if rule == "gauss":
            options["n_gauss"] = 3
    if not against_obstacle:
        options["projection_tolerance"] = float(zone.get("TOLE_PROJ_EXT", 0.5))
    return options


def missing_in_contact(contact: Entry) -> Iterator[str]:
    if not contact.get("zones"):
        yield "contact zones"
    if contact.get("FORMULATION", "DISCRETE") not in ("DISCRETE", "CONTINUE"):
        yield f"the contact FORMULATION {contact['FORMULATION']}"
    if contact.get("FROTTEMENT", "SANS") not in ("SANS", "COULOMB"):
        yield f"the friction law {contact['FROTTEMENT']}"
    yield from (f"{key} of {contact.get('command')}" for key in contact if key not in ITERATIONS | CONTACT)
    for zone in contact.get("zones", ()):
        yield from (f"gap offsets {key}" for key in NO_OFFSETS if zone.get(key, "NON") != "NON")
        known = {*ZONE_ITERATIONS, *ZONE, *OFFSETS, *NO_OFFSETS, *EXCLUSIONS}
        yield from (f"{key} of a contact zone" for key in zone if key not in known)
        yield from (f"{key} = {zone[key]}" for key, said in CHOICES.items() if zone.get(key, said[0]) not in said)


def _frictionless_nodes(zone: Entry, mesh: fc.Mesh, supports: Sequence[Support]) -> dict[str, Any]:
    """Name nodes without friction, but for those that a support holds, as on an axis: friction has no force there."""
    place = {"GROUP_NO": zone.get("SANS_GROUP_NO_FR", ()), "NOEUD": zone.get("SANS_NOEUD_FR", ())}
    nodes = nodes_of(mesh, {key: value for key, value in place.items() if value})
    held = mesh.dim == 2 and all(any(node in support.nodes for support in supports) for node in nodes)
    if not len(nodes) or held:
        return {}
    if zone.get("SANS_NOEUD_FR"):
        raise MissingError("needs nodes without friction by their number, SANS_NOEUD_FR")
    return {"frictionless": listed(zone["SANS_GROUP_NO_FR"])}


def _excluded_nodes(
    zone: Entry, mesh: fc.Mesh, supports: Sequence[Support], options: Entry, *, against_obstacle: bool
) -> dict[str, Any]:
    """Name excluded nodes, but for those that could not carry a force: held, each opposite to what stands still."""
    place = {key.removeprefix("SANS_"): zone[key] for key in EXCLUSIONS if key in zone}
    excluded = np.intersect1d(nodes_of(mesh, place), nodes_of(mesh, {"GROUP_MA": zone["slave"]}))
    nodal = options["formulation"] == "node_to_segment" or options.get("integration") == "node"
    held = all(
        any(node in support.nodes and support.component == axis for support in supports)
        for node in excluded
        for axis in "xyz"[: mesh.dim]
    )
    if not len(excluded) or (nodal and against_obstacle and held):
        return {}
    if {"SANS_NOEUD", "SANS_MAILLE"} & set(zone):
        raise MissingError("needs nodes excluded from contact by their number")
    groups = [name for key in ("SANS_GROUP_NO", "SANS_GROUP_MA") for name in listed(zone.get(key, ()))]
    return {"excluded": [name for name in groups if np.isin(mesh.points_of(name), excluded).any()]}


def _obstacle(mesh: fc.Mesh, zone: Entry, supports: Sequence[Support]) -> fc.obstacles.HalfSpace:
    """Return the half-space behind a flat master surface without a solid that stands still."""
    nodes, slave = (nodes_of(mesh, {"GROUP_MA": zone[side]}) for side in ("master", "slave"))
    for axis in "xyz"[: mesh.dim]:
        holding = [s for s in supports if s.component == axis and not callable(s.value) and s.value == 0.0]
        if not np.isin(nodes, np.concatenate([np.empty(0, int), *(s.nodes for s in holding)])).all():
            raise MissingError(f"needs a rigid meshed surface without solid that moves ({zone['master']})")
    centre = mesh.points[nodes].mean(axis=0)
    spread, directions = np.linalg.svd(mesh.points[nodes] - centre)[1:]
    if spread[-1] > 1e-9 * spread[0]:
        raise MissingError(f"needs a rigid meshed surface without solid that is not flat ({zone['master']})")
    # The body lies on the side where its own solid is.
    behind = np.concatenate([b[np.isin(b, slave).any(axis=1)].ravel() for b in mesh.solids.values()])
    normal = directions[-1] * np.sign((mesh.points[behind].mean(axis=0) - centre) @ directions[-1])
    return fc.obstacles.HalfSpace(tuple(centre), tuple(normal))


def criteria_of(contact: Entry) -> fc.Criteria:
    """Return how often to pair: fixed numbers where code_aster's user asks for one, otherwise until it stands still."""
    updates = str(contact.get("REAC_GEOM", "AUTOMATIQUE")).split()[0]
    if updates == "SANS":
        return fc.Criteria(keep_pairing=True)
    if updates == "CONTROLE":
        return fc.Criteria(geometry_updates=int(contact.get("NB_ITER_GEOM", 2)))
    return fc.Criteria()
