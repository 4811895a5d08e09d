"""Reference elements.

Each module without a leading underscore contains the elements of one shape in its tuple ``ELEMENTS``, to which new elements
are added.
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
    """Return the element called `name`. Raises MeshError, with similar names, if there is none."""
    try:
        return ELEMENTS[name]
    except KeyError:
        raise MeshError(unknown("element", name, ELEMENTS)) from None


__all__ = ["BY_MED", "BY_MESHIO", "BY_VTK", "ELEMENTS", "Element", "get"]
