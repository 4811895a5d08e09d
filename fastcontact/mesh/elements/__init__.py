"""Reference elements: each is a table in one file; a new file here is a new element.

Every module of this package whose name has no leading underscore defines one ``ELEMENT``.
"""

from __future__ import annotations

import importlib
import pkgutil

from fastcontact.errors import MeshError, unknown
from fastcontact.mesh.elements._element import Element

ELEMENTS: dict[str, Element] = {
    name: importlib.import_module(f"{__name__}.{name}").ELEMENT
    for _, name, _ in pkgutil.iter_modules(__path__)
    if not name.startswith("_")
}
BY_MESHIO = {element.meshio: element for element in ELEMENTS.values()}
BY_MED = {element.med: element for element in ELEMENTS.values()}
BY_VTK = {element.vtk: element for element in ELEMENTS.values()}


def get(name: str) -> Element:
    """Return the element called `name`.

    MeshError if there is no such element; the message offers the nearest names.
    """
    try:
        return ELEMENTS[name]
    except KeyError:
        raise MeshError(unknown("element", name, ELEMENTS)) from None


__all__ = ["BY_MED", "BY_MESHIO", "BY_VTK", "ELEMENTS", "Element", "get"]
