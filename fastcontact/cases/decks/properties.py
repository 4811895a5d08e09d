"""Keywords of materials, sections, contact properties and amplitudes."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import Any

import numpy as np

from fastcontact.arrays import Array
from fastcontact.cases.decks.blocks import Block, defined, folded, refusing, registered, unquoted
from fastcontact.cases.decks.content import Amplitude, Axes, Content, Interaction, Material, Part, Section
from fastcontact.contact.overclosure import TabularLaw
from fastcontact.elasticity.anisotropic_materials import Anisotropic, Orthotropic
from fastcontact.elasticity.materials import LinearElastic
from fastcontact.errors import ContactError

# Numbers of constants of elastic materials.
CONSTANTS = {"ISOTROPIC": 2, "ENGINEERING CONSTANTS": 9, "ORTHOTROPIC": 9, "ANISOTROPIC": 21}


def material(content: Content, block: Block) -> Material:
    """*MATERIAL: the beginning of a material."""
    name = block.required("NAME")
    return registered("material", name, content.materials, Material(name, block.location), block)


def elastic(content: Content, current: Material, block: Block) -> None:
    """*ELASTIC: constants at one temperature."""
    kind = " ".join(block.get("TYPE", "ISOTROPIC").upper().split())
    kinds = [known for known in CONSTANTS if len(kind) >= 3 and known.startswith(kind)]
    if not kinds:
        known = ", ".join(CONSTANTS)
        raise block.refuse(f"material '{current.name}': TYPE={kind[:40]} is not supported; known are {known}")
    if kinds[0] != "ISOTROPIC":
        _with_axes(current, block, kinds[0])
        return
    row = block.only("temperatures" if len(block.rows) > 1 else "")
    E, nu = row.number(0), row.number(1, 0.0)
    if row.text(2):
        content.note(row, "the temperature of the constants has no effect: there is one set of them")
    with refusing(row, f"material '{current.name}': "):
        law = LinearElastic(E=E, nu=nu)
    current.law = lambda axes: law


def _with_axes(current: Material, block: Block, kind: str) -> None:
    """Read the constants of a material with axes; they may span several lines, and a temperature may follow."""
    numbers, count = block.numbers(), CONSTANTS[kind]
    if not count <= len(numbers) <= count + 1:
        raise block.refuse(
            f"material '{current.name}': {len(numbers)} constants where {kind} has {count}, at one temperature"
        )
    values = numbers[:count]

    def law(axes: Any) -> Orthotropic | Anisotropic:
        if kind == "ENGINEERING CONSTANTS":
            return Orthotropic(E=values[:3], nu=values[3:6], G=values[6:], axes=axes)
        return Anisotropic(_moduli(values), axes=axes)

    with refusing(block, f"material '{current.name}': "):
        law(None)
    current.law = law


def _moduli(values: list[float]) -> Array:
    """Return moduli (6, 6) [pressure] from the upper triangle in a deck, by columns 11, 22, 33, 12, 13, 23."""
    D = np.zeros((6, 6))
    places = [(i, j) for j in range(6) for i in range(j + 1)]
    if len(values) == CONSTANTS["ORTHOTROPIC"]:
        places = [(i, j) for i, j in places if i == j or j < 3]
    for (i, j), value in zip(places, values, strict=True):
        D[i, j] = D[j, i] = value
    order = [0, 1, 2, 3, 5, 4]
    return D[np.ix_(order, order)]


def distribution_table(content: Content, part: Part, block: Block) -> None:
    """*DISTRIBUTION TABLE: content of distributions; only axes of cells are supported."""
    kinds = [entry.upper() for row in block.rows for entry in row.entries if entry]
    if kinds != ["COORD3D", "COORD3D"]:
        raise block.refuse(f"a distribution of {', '.join(kinds)[:80]} is not supported, only COORD3D, COORD3D of axes")


def distribution(content: Content, part: Part, block: Block) -> None:
    """*DISTRIBUTION: two points for the axes of each cell, relative to the origin; the line without a cell is the default."""
    block.choice("LOCATION", ("ELEMENT",))
    registered("distribution", block.required("NAME"), content.distributions, block, block)


def orientation(content: Content, part: Part, block: Block) -> None:
    """*ORIENTATION: material axes."""
    name, system = block.required("NAME"), block.choice("SYSTEM", ("RECTANGULAR", "CYLINDRICAL"))
    block.choice("DEFINITION", ("COORDINATES",))
    rows, key = block.rows, folded(name)
    points: tuple[float, ...] = ()
    if key in content.orientations:
        raise block.refuse(
            f"orientation '{name}' is defined twice, first in line {content.orientations[key].location.line}"
        )
    if not rows:
        raise block.refuse("a data line with six coordinates is needed")
    distribution = unquoted(rows[0].text(0)) if re.match("[A-Za-z_]", rows[0].text(0)) else ""
    if distribution and system == "CYLINDRICAL":
        raise block.refuse("a distribution of axes is supported with SYSTEM=RECTANGULAR only")
    if not distribution:
        points = tuple(rows[0].number(i) for i in range(6))
        if any(rows[0].entries[6:]) and any(rows[0].number(6 + i, 0.0) for i in range(3)):
            raise rows[0].refuse("an origin of the axes is not supported: give points seen from 0, 0, 0")
    if len(rows) > 1 and rows[1].number(1, 0.0):
        raise rows[1].refuse("a further rotation of the axes is not supported: turn the points of the first line")
    content.orientations[key] = Axes(block.location, "", system == "CYLINDRICAL", points, distribution, part)


def density(content: Content, current: Material, block: Block) -> None:
    """*DENSITY."""
    current.density = block.only().number(0)
    if not current.density > 0:
        raise block.refuse(f"material '{current.name}': the density {current.density:g} must be positive")


def section(content: Content, part: Part, block: Block) -> None:
    """*SOLID SECTION: the material of the elements of a set."""
    thickness = None
    for row in block.rows[:1]:
        thickness = row.number(0, 1.0)
        if not thickness > 0:
            raise row.refuse(f"the thickness {thickness:g} must be positive")
    orientation = block.get("ORIENTATION")
    part.sections.append(
        Section(block.location, block.required("ELSET"), block.required("MATERIAL"), thickness, orientation)
    )


def interaction(content: Content, block: Block) -> Interaction:
    """*SURFACE INTERACTION: the beginning of the properties of contact pairs."""
    name = block.required("NAME")
    properties = registered("surface interaction", name, content.interactions, Interaction(name, block.location), block)
    if block.rows:
        block.rows[0].number(0, 1.0)
        content.note(block.rows[0], "the thickness of the interaction has no effect: that of the sections counts")
    return properties


def changed_interaction(content: Content, block: Block) -> Interaction:
    """*CHANGE FRICTION: the beginning of a change from the current step on, given by the *FRICTION below it."""
    name = block.required("INTERACTION")
    before = defined("surface interaction", name, content.interactions, block)
    changed = Interaction(name, block.location, friction=-1.0)  # to be set by *FRICTION
    before.changes.append((len(content.steps) - 1, changed))
    return changed


def behaviour(content: Content, current: Interaction, block: Block) -> None:
    """*SURFACE BEHAVIOR: hard, or soft with a slope, a table or an exponential law."""
    law = block.choice("PRESSURE-OVERCLOSURE", ("HARD", "LINEAR", "EXPONENTIAL", "TABULAR", "TIED"))
    if law == "LINEAR":
        current.penalty = block.only().positive(0, "slope")
    elif law == "EXPONENTIAL":
        row = block.only()
        current.penalty = {"clearance": row.positive(0, "clearance"), "pressure": row.positive(1, "pressure")}
    elif law == "TABULAR":
        current.penalty = _table(block)
    elif law == "TIED":
        current.kind = "tied"
    if "NO SEPARATION" in block.parameters:
        current.kind = "bilateral_once_closed"


def _table(block: Block) -> float | list[tuple[float, float]]:
    """Return a table of overclosures and pressures, or the slope if it is one straight line through the origin."""
    points = [(row.number(1), row.number(0)) for row in block.rows]
    try:
        TabularLaw("", points)
    except ContactError:
        raise block.refuse(
            "TABULAR needs pressures and overclosures that both ascend, the first pressure zero"
        ) from None
    return points[1][1] / points[1][0] if len(points) == 2 and points[0][0] == 0.0 else points


def friction(content: Content, current: Interaction, block: Block) -> None:
    """*FRICTION: the coefficient, and in CalculiX the stick slope."""
    row = block.only()
    current.friction = row.number(0)
    if current.friction < 0:
        raise row.refuse(f"the coefficient of friction {current.friction:g} is negative")
    if row.text(1) and row.number(1):
        current.stick = row.positive(1, "stick slope")
        content.note(row, f"{current.stick:g} is taken for the stick slope, as in CalculiX (shear by slip)")
    if len(row.entries) > 2 and any(row.entries[2:]):
        raise row.refuse("friction that depends on pressure or temperature is not supported: give one coefficient")


def amplitude(content: Content, block: Block) -> None:
    """*AMPLITUDE: pairs of time and multiplier."""
    name = block.required("NAME")
    block.choice("DEFINITION", ("TABULAR",))
    block.choice("VALUE", ("RELATIVE",))
    total = block.choice("TIME", ("STEP TIME", "TOTAL TIME")) == "TOTAL TIME"
    numbers = block.numbers()
    times, values = numbers[::2], numbers[1::2]
    if not times or len(times) != len(values) or any(b <= a for a, b in pairwise(times)):
        raise block.refuse(f"amplitude '{name}' needs pairs of ascending times and multipliers")
    content.amplitudes[folded(name)] = Amplitude(block.location, tuple(times), tuple(values), total)


def gap(content: Content, block: Block) -> None:
    """*GAP: clearance and direction of gap elements."""
    row = block.only()
    direction = tuple(row.number(i, 0.0) for i in (1, 2, 3))
    if not any(direction):
        raise row.refuse("the direction of the gap elements is missing")
    content.gaps[folded(block.required("ELSET"))] = (block.location, row.number(0), direction)


def spring(content: Content, block: Block) -> None:
    """*SPRING: stiffness of springs along their axis."""
    rows = block.rows
    if len(rows) != 1:
        raise block.refuse("linear springs along their line need an empty line and then one with the stiffness")
    if rows[0].text(1):
        raise rows[0].refuse("only linear springs are supported: one stiffness")
    content.springs[folded(block.required("ELSET"))] = (block.location, rows[0].positive(0, "stiffness"))
