"""Element types of decks with their mesh elements, kinematics and faces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from fastcontact.elasticity.incompatible_modes import ELEMENTS_WITH_MODES

# Indices of the facets of a mesh element that are its faces 1, 2, ... in Abaqus and CalculiX, by the first three letters of
# its name.
FACES = {"tet": (3, 0, 1, 2), "hex": (4, 5, 2, 1, 3, 0), "wed": (0, 1, 2, 3, 4), "tri": (0, 1, 2), "qua": (0, 1, 2, 3)}
# Mesh elements of solid and of plane element types, by the number of nodes at the end of the type name.
SOLIDS = {"4": "tet4", "6": "wedge6", "8": "hex8", "10": "tet10", "15": "wedge15", "20": "hex20"}
PLANES = {"3": "tri3", "4": "quad4", "6": "tri6", "8": "quad8"}
# Kinematics of plane element types, by the beginning of the type name.
FAMILIES = {"CPE": "plane_strain", "CPS": "plane_stress", "CAX": "axisymmetric"}
# Families of heat transfer elements, and the families of deformable elements of the same shape.
CONDUCTING = {"DC3D": "C3D", "DC2D": "CPE", "DCAX": "CAX"}
# Kinds of unsupported elements, by the beginning of their type name.
UNSUPPORTED = {
    "S": "shell", "STRI": "shell", "B": "beam", "T": "truss", "M": "membrane", "CPEG": "generalised plane strain",
    "DC": "convective heat transfer", "R": "rigid", "SC": "continuum shell", "C3D8P": "pore pressure", "CONN": "connector",
    "DASHPOT": "dashpot", "MASS": "mass", "F3D": "network", "D": "network", "U": "user", "COH": "cohesive",
    "GK": "gasket", "ITS": "tube support", "ISL": "slide line", "SPRING": "spring", "SFM": "surface", "DC1D": "heat link",
    "ROTARYI": "rotary inertia", "DCOUP": "distributing coupling",
}  # fmt: skip


@dataclass(frozen=True)
class ElementType:
    """Translation of an element type of the deck.

    Attributes
    ----------
    name : str
        Name in the deck.
    element : str
        Name of the mesh element.
    kinematics : str
        Kinematics of the model.
    note : str
        Difference between the element of the deck and that of the package, or an empty string.
    incompatible_modes : bool
        True if the element has incompatible modes.
    heat_only : bool
        True if the element conducts heat and has no displacements.
    """

    name: str
    element: str
    kinematics: str
    note: str = ""
    incompatible_modes: bool = False
    heat_only: bool = False

    @property
    def faces(self) -> tuple[int, ...]:
        """Indices of the facets of the mesh element that are the faces 1, 2, ... of the deck."""
        return FACES[self.element[:3]]


@cache
def element_type(name: str) -> ElementType | None:
    """Return the translation of an element type in upper case; None if the type is not supported."""
    heat_only = name[:4] in CONDUCTING
    base = CONDUCTING[name[:4]] + name[4:] if heat_only else name.removesuffix("T")
    note, incompatible = "", False
    for suffix, difference in (
        ("MH", "replaced by the standard quadratic element"),
        ("RH", "integrated fully, without hybrid pressure"), ("IH", "without hybrid pressure"),
        ("R", "integrated fully here"), ("I", ""),
        ("H", "without hybrid pressure: in nearly incompressible materials it has a mean dilatation"),
        ("M", "replaced by the standard quadratic element"),
    ):  # fmt: skip
        if base.endswith(suffix) and not heat_only:
            base, note, incompatible = base.removesuffix(suffix), difference, suffix[0] == "I"
            break
    table, kinematics = (SOLIDS, "3d") if base[:3] == "C3D" else (PLANES, FAMILIES.get(base[:3], ""))
    element = table.get(base[3:])
    if incompatible and kinematics == "axisymmetric":
        incompatible, note = False, "without incompatible modes, which makes thin parts stiffer in bending"
    elif incompatible and element not in ELEMENTS_WITH_MODES:  # C3D10I has improved surface stresses instead of modes
        incompatible, note = False, "replaced by the standard quadratic element"
    return ElementType(name, element, kinematics, note, incompatible, heat_only) if element and kinematics else None


def unsupported_kind(name: str) -> str:
    """Return the kind of an unsupported element type in parentheses, or an empty string for an unknown type."""
    prefixes = [prefix for prefix in UNSUPPORTED if name.startswith(prefix)]
    return f" ({UNSUPPORTED[max(prefixes, key=len)]})" if prefixes else ""
