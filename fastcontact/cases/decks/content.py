"""Content of a deck before the model is built: parts with nodes, elements, sets and surfaces; properties; and steps."""

from __future__ import annotations

from array import array
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from fastcontact.cases.decks.blocks import Block, Item, Located, Location, key_of


@dataclass(frozen=True, slots=True)
class Cell(Located):
    """An element: its type, its node numbers, the location of its *ELEMENT (`block_location`), its line, and its set."""

    type: str
    nodes: Sequence[int]
    block_location: Location
    line: int
    element_set: str = ""

    @property
    def location(self) -> Location:  # type: ignore[override]
        """Location of the element in the deck."""
        return replace(self.block_location, line=self.line)


@dataclass(frozen=True, slots=True)
class Members(Item):
    """Entries of a set: node or element numbers, or the name of another set.

    The members belong to `instance` or, if this is empty, to the instance in which the set is defined.
    """

    numbers: Sequence[int] = ()
    name: str = ""
    instance: str = ""


@dataclass(frozen=True, slots=True)
class SurfaceEntry(Item):
    """An entry of a surface: the `name` of an element set or number, with the label of a face, or of a node set or number."""

    name: str
    label: str = ""


@dataclass
class Surface(Located):
    """A surface of element faces or, if `of_nodes` is true, of nodes."""

    name: str
    location: Location
    of_nodes: bool
    entries: list[SurfaceEntry] = field(default_factory=list)


@dataclass(frozen=True)
class Section(Item):
    """Material, thickness [length] (None if not given) and orientation of the elements of a set."""

    elements: str
    material: str
    thickness: float | None = None
    orientation: str = ""


@dataclass
class Part:
    """Nodes, elements, sets and surfaces of a part, of the assembly, or of a deck without parts.

    `nodes` contains the row of each node number in `coordinates` [length], which has three numbers for each row. Sets and
    surfaces are stored by their names in the form used for look-up (`key_of`), and `set_names` contains the original names.
    """

    name: str = ""
    nodes: dict[int, int] = field(default_factory=dict)
    coordinates: array[float] = field(default_factory=lambda: array("d"))
    cells: dict[int, Cell] = field(default_factory=dict)
    node_sets: dict[str, list[Members]] = field(default_factory=dict)
    element_sets: dict[str, list[Members]] = field(default_factory=dict)
    set_names: dict[str, str] = field(default_factory=dict)
    surfaces: dict[str, Surface] = field(default_factory=dict)
    sections: list[Section] = field(default_factory=list)

    def add(self, kind: str, name: str, members: list[Members]) -> None:
        """Add entries to a new or an existing set."""
        sets = self.node_sets if kind == "node" else self.element_sets
        sets.setdefault(key_of(name), []).extend(members)
        self.set_names.setdefault(key_of(name), name)


@dataclass
class Instance:
    """A part placed in the assembly.

    The rotation, which follows the translation [length], consists of two points on its axis [length] and an angle [degree].
    """

    name: str
    part: Part
    translation: tuple[float, ...] = (0.0, 0.0, 0.0)
    rotation: tuple[float, ...] = ()


@dataclass
class Material(Located):
    """A material of the deck.

    `law` returns the material of the model for given material axes (None: the global axes). `density` [mass / volume] and the
    coefficients of thermal `expansion` [1 / temperature], one or one for each axis, are None if they are not given.
    """

    name: str
    location: Location
    law: Callable[[Any], Any] | None = None
    density: float | None = None
    expansion: float | tuple[float, ...] | None = None
    conductivity: Block | None = None

    @property
    def prefix(self) -> str:
        """Beginning of messages about the material."""
        return f"material '{self.name}': "


@dataclass
class Interaction(Located):
    """Contact properties of surfaces.

    Attributes
    ----------
    penalty : float, list of (float, float), dict or None
        Penalty [pressure / length], pairs of overclosure [length] and pressure, or the constants of an exponential law, as in
        the option `penalty` of a contact pair; None for hard contact.
    friction : float
        Coefficient of friction [-].
    stick_slope : float or None
        Shear traction divided by slip while nodes stick [pressure / length]; None if sticking is exact.
    kind : str
        Kind of the contact pair.
    cohesion : dict of str to Block
        Blocks of the cohesive layer by keyword.
    conductance : list of Block
        Blocks *GAP CONDUCTANCE.
    friction_heat : (Location, float) or None
        Fraction [-] of the frictional work that becomes heat, with its location; None if friction generates no heat.
    friction_changes : list of (int, Interaction)
        Changes of the friction by later steps: the number of preceding steps, and the new friction.
    """

    name: str
    location: Location
    penalty: float | list[tuple[float, float]] | dict[str, float] | None = None
    friction: float = 0.0
    stick_slope: float | None = None
    kind: str = "unilateral"
    cohesion: dict[str, Block] = field(default_factory=dict)
    conductance: list[Block] = field(default_factory=list)
    friction_heat: tuple[Location, float] | None = None
    friction_changes: list[tuple[int, Interaction]] = field(default_factory=list)


@dataclass
class Pair(Located):
    """A contact pair or a tie (`tied`) of two surfaces.

    `adjust` is the value of ADJUST, empty without it. `clearance` is the initial gap [length] that replaces the gap in the
    coordinates; None if the coordinates determine the gap.
    """

    location: Location
    secondary: str
    primary: str
    interaction: str = ""
    tied: bool = False
    adjust: str = ""
    clearance: float | None = None

    @property
    def name(self) -> str:
        """Name of the pair in the results."""
        return f"{self.secondary}/{self.primary}"


@dataclass(frozen=True)
class MultiPoint(Item):
    """A multi-point constraint of a kind of *MPC except BEAM, with its nodes or node sets."""

    kind: str
    nodes: tuple[str, ...]


@dataclass(frozen=True)
class Coupling(Item):
    """A rigid body or coupling: a reference node, and the nodes that follow it or, if distributing, that it follows.

    `group` is the name of a set of nodes or elements or of a surface, as `kind` states. Of the constrained `components`, 1 to
    3 are displacements and 4 to 6 rotations. `rotation` is the node whose displacements are the rotations of the reference
    node; it is empty if there is no such node.
    """

    reference: str
    group: str
    kind: str  # nodes, elements or surface
    components: tuple[int, ...] = (1, 2, 3, 4, 5, 6)
    distributing: bool = False
    rotation: str = ""
    orientation: str = ""  # axes of the components


@dataclass(frozen=True)
class Axes(Item):
    """Local axes of nodes or materials.

    Rectangular axes are given by a point on the first axis and a point in the plane of the first two axes, cylindrical axes
    by two points on the axis of the cylinder.
    """

    name: str  # of an *ORIENTATION, or of the node set of a *TRANSFORM
    cylindrical: bool
    points: tuple[float, ...]
    distribution: str = ""  # name of a distribution of material axes by element, used instead of points
    part: Part | None = None  # part in which material axes are defined


@dataclass(frozen=True)
class Amplitude(Item):
    """Times and values of an amplitude, in total time if `total` is true, otherwise in step time."""

    name: str
    times: tuple[float, ...]
    values: tuple[float, ...]
    total: bool


@dataclass(slots=True)
class Step(Located):
    """A load step of the deck.

    `nonlinear` states whether NLGEOM is active. `period` is the duration of the step and `increment` its initial increment
    [time]. `n_modes` is the number of modes that *FREQUENCY requests; it is zero in other steps.
    """

    location: Location
    nonlinear: bool = False
    period: float = 1.0
    increment: float = 1.0
    has_procedure: bool = False
    perturbation: bool = False
    heat: str = ""  # "coupled" or "uncoupled" heat conduction; empty if temperatures are not computed
    n_modes: int = 0
    conditions: list[Block] = field(default_factory=list)  # blocks of supports, loads and temperatures


@dataclass
class Content:
    """The content of a deck.

    `blocks` contains the blocks that are interpreted when the model is built, by keyword.
    """

    title: str = ""
    root: Part = field(default_factory=Part)
    parts: dict[str, Part] = field(default_factory=dict)
    instances: dict[str, Instance] = field(default_factory=dict)
    materials: dict[str, Material] = field(default_factory=dict)
    interactions: dict[str, Interaction] = field(default_factory=dict)
    pairs: list[Pair] = field(default_factory=list)
    sector_ends: list[tuple[Block, str, str]] = field(default_factory=list)  # *TIE and its surfaces
    multi_points: list[MultiPoint] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    orientations: dict[str, Axes] = field(default_factory=dict)
    distributions: dict[str, Block] = field(default_factory=dict)
    amplitudes: dict[str, Amplitude] = field(default_factory=dict)
    blocks: defaultdict[str, list[Block]] = field(default_factory=lambda: defaultdict(list))
    steps: list[Step] = field(default_factory=list)
    modes: dict[str, Any] | None = None
    notes: list[str] = field(default_factory=list)
    outputs: list[Location] = field(default_factory=list)

    @property
    def heat(self) -> str:
        """`Step.heat` of the first step that conducts heat; empty if there is none."""
        return next((step.heat for step in self.steps if step.heat), "")

    def note(self, location: Location | Located, text: str) -> None:
        """Add a note on the interpretation of a line."""
        self.notes.append(f"{location}: {text}")
