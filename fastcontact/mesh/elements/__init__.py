"""Reference elements. A new element is a new entry in the tuple ``ELEMENTS`` of the module of its shape.

Every module of this package whose name has no leading underscore contains the elements of one shape.
"""

from __future__ import annotations

from functools import cache

from fastcontact.errors import MeshError, unknown
from fastcontact.mesh.elements import hexahedra, lines, pyramids, quadrangles, tetrahedra, triangles, wedges
from fastcontact.mesh.elements._element import Element

_SHAPES = (hexahedra, lines, pyramids, quadrangles, tetrahedra, triangles, wedges)
ELEMENTS: dict[str, Element] = {element.name: element for shape in _SHAPES for element in shape.ELEMENTS}
BY_MESHIO = {element.meshio: element for element in ELEMENTS.values()}
BY_MED = {element.med: element for element in ELEMENTS.values()}
BY_VTK = {element.vtk: element for element in ELEMENTS.values()}


@cache
def get(name: str) -> Element:
    """Return the element called `name`; MeshError if there is none, with the most similar names."""
    try:
        return ELEMENTS[name]
    except KeyError:
        raise MeshError(unknown("element", name, ELEMENTS)) from None


__all__ = ["BY_MED", "BY_MESHIO", "BY_VTK", "ELEMENTS", "Element", "get"]
