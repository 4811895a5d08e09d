"""Content of a deck before the model is built: parts with nodes, elements, sets and surfaces; properties; steps."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from fastcontact.cases.decks.blocks import Block, Item, Located, Location, folded


@dataclass(frozen=True, slots=True)
class Cell(Located):
    """An element: its type, the numbers of its nodes, the location of its keyword, and its line."""

    type: str
    nodes: Sequence[int]
    within: Location
    line: int
    set: str = ""

    @property
    def location(self) -> Location:  # type: ignore[override]
        """Location of the element in the deck."""
        return replace(self.within, line=self.line)


@dataclass(frozen=True, slots=True)
class Members(Item):
    """Entries of a set: numbers, or the name of another set, in an instance (empty: that of the definition).

    The numbers may come from several lines: `lines` holds the index of the first number and the line of each further one.
    """

    numbers: Sequence[int] = ()
    name: str = ""
    instance: str = ""
    lines: array[int] = field(default_factory=lambda: array("q"))

    def add(self, numbers: array[int], line: int) -> None:
        """Add the numbers of a further line."""
        assert isinstance(self.numbers, array)
        self.lines.extend((len(self.numbers), line))
        self.numbers.extend(numbers)

    def place_of(self, number: int) -> Location:
        """Return the location of the line that holds a number."""
        row = bisect_right(self.lines[::2], self.numbers.index(number))
        return replace(self.location, line=self.lines[2 * row - 1]) if row else self.location


@dataclass(frozen=True, slots=True)
class Face:
    """One entry of a surface: an element set or number and the label of the face, or a node set or number."""

    location: Location
    of: str
    label: str = ""


@dataclass
class SurfaceDefinition(Located):
    """A surface as the deck defines it."""

    name: str
    location: Location
    of_nodes: bool
    faces: list[Face] = field(default_factory=list)


@dataclass(frozen=True)
class Section(Item):
    """Material and thickness (None: not given) of the elements of a set."""

    elements: str
    material: str
    thickness: float | None = None
    orientation: str = ""


@dataclass
class Part:
    """Nodes, elements, sets and surfaces of a part, of the assembly, or of a deck without parts.

    `nodes` are rows by node number; `coordinates` holds three numbers per row.
    """

    name: str = ""
    nodes: dict[int, int] = field(default_factory=dict)
    coordinates: array[float] = field(default_factory=lambda: array("d"))
    flat: bool = False
    cells: dict[int, Cell] = field(default_factory=dict)
    node_sets: dict[str, list[Members]] = field(default_factory=dict)
    element_sets: dict[str, list[Members]] = field(default_factory=dict)
    set_names: dict[str, str] = field(default_factory=dict)
    surfaces: dict[str, SurfaceDefinition] = field(default_factory=dict)
    sections: list[Section] = field(default_factory=list)

    def add(self, kind: str, name: str, members: list[Members]) -> None:
        """Add entries to a set, which may exist already."""
        sets = self.node_sets if kind == "node" else self.element_sets
        sets.setdefault(folded(name), []).extend(members)
        self.set_names.setdefault(folded(name), name)


@dataclass
class Instance:
    """Placement of a part in the assembly: a translation, then a rotation about a line through two points [degree]."""

    name: str
    part: Part
    translation: tuple[float, ...] = (0.0, 0.0, 0.0)
    rotation: tuple[float, ...] = ()


@dataclass
class Material(Located):
    """A material of the deck; `law` returns the material of the model for given axes, None for those of the mesh."""

    name: str
    location: Location
    law: Callable[[Any], Any] | None = None
    density: float | None = None
    expansion: float | tuple[float, ...] | None = None
    conductivity: Block | None = None


@dataclass
class Interaction(Located):
    """Contact properties of surfaces."""

    name: str
    location: Location
    penalty: float | list[tuple[float, float]] | dict[str, float] | None = None
    friction: float = 0.0
    stick: float | None = None
    kind: str = "unilateral"
    cohesion: dict[str, Block] = field(default_factory=dict)
    conductance: list[Block] = field(default_factory=list)
    friction_heat: tuple[Location, float] | None = None
    changes: list[tuple[int, Interaction]] = field(default_factory=list)  # (steps before, friction)


@dataclass
class Pair(Located):
    """A contact pair or a tie."""

    location: Location
    secondary: str
    primary: str
    interaction: str = ""
    tied: bool = False
    adjust: str = ""
    clearance: float | None = None
    tolerance: float | None = None

    @property
    def name(self) -> str:
        """Name of the pair in the results."""
        return f"{self.secondary}/{self.primary}"


@dataclass(frozen=True)
class SectorEnds(Item):
    """The two end surfaces of a cyclic sector, and the name of their tie."""

    name: str
    surfaces: tuple[str, str]


@dataclass(frozen=True)
class Sectors(Item):
    """Number of cyclic sectors, two points of their axis, and the name of the tie of their ends."""

    count: int
    tie: str
    points: tuple[float, ...]


@dataclass(frozen=True)
class Equation(Item):
    """A linear equation: node, component and coefficient of each term."""

    terms: tuple[tuple[str, int, float], ...]


@dataclass(frozen=True)
class Pin(Item):
    """Nodes that follow the displacement of another node, or each of them that of a node in another set."""

    first: str
    second: str


@dataclass(frozen=True)
class MultiPoint(Item):
    """Nodes that stay in a plane or on a line, or whose mean rotation is that of the last node."""

    kind: str
    nodes: tuple[str, ...]


@dataclass(frozen=True)
class Link(Item):
    """A reference node with the nodes that follow it (rigid, kinematic) or whose mean motion it follows (distributing)."""

    reference: str
    group: str
    kind: str  # nodes, elements or surface
    components: tuple[int, ...] = (1, 2, 3, 4, 5, 6)
    distributing: bool = False
    rotation: str = ""
    orientation: str = ""  # the components refer to its axes


@dataclass(frozen=True)
class PretensionSection(Item):
    """A pretension section of a bolt: its surface, the node that carries its shortening and force, and its normal."""

    surface: str
    node: str
    normal: tuple[float, ...] | None


@dataclass(frozen=True)
class Axes(Item):
    """Local axes of nodes or materials: rectangular, by a point on the first axis and one in the plane, or cylindrical."""

    nodes: str
    cylindrical: bool
    points: tuple[float, ...]
    distribution: str = ""  # name of the distribution of material axes by cell, in place of points
    part: Part | None = None  # the part that defines axes of materials


@dataclass(frozen=True)
class Amplitude:
    """Points (time, multiplier), in step time or in total time."""

    location: Location
    times: tuple[float, ...]
    values: tuple[float, ...]
    total: bool


@dataclass(frozen=True, slots=True)
class Given:
    """Given supports, loads or temperatures: their block, whether earlier ones remain, and their amplitude."""

    block: Block
    new: bool
    amplitude: str = ""


@dataclass(slots=True)
class Step(Located):
    """A load step of the deck."""

    location: Location
    nonlinear: bool = False
    period: float = 1.0
    increment: float = 1.0
    static: bool = False
    perturbation: bool = False
    heat: str = ""  # "alone", "coupled" with displacements, or empty: not computed
    modes: int = 0
    given: list[Given] = field(default_factory=list)


@dataclass
class Content:
    """The whole content of a deck."""

    title: str = ""
    root: Part = field(default_factory=lambda: Part(flat=True))
    parts: dict[str, Part] = field(default_factory=dict)
    instances: dict[str, Instance] = field(default_factory=dict)
    materials: dict[str, Material] = field(default_factory=dict)
    interactions: dict[str, Interaction] = field(default_factory=dict)
    pairs: list[Pair] = field(default_factory=list)
    sector_ends: list[SectorEnds] = field(default_factory=list)
    sectors: list[Sectors] = field(default_factory=list)
    equations: list[Equation] = field(default_factory=list)
    pins: list[Pin] = field(default_factory=list)
    multi_points: list[MultiPoint] = field(default_factory=list)
    links: list[Link] = field(default_factory=list)
    axes: list[Axes] = field(default_factory=list)
    pretensions: list[PretensionSection] = field(default_factory=list)
    orientations: dict[str, Axes] = field(default_factory=dict)
    distributions: dict[str, Block] = field(default_factory=dict)
    amplitudes: dict[str, Amplitude] = field(default_factory=dict)
    gaps: dict[str, tuple[Location, float, tuple[float, ...]]] = field(default_factory=dict)
    springs: dict[str, tuple[Location, float]] = field(default_factory=dict)
    supports: list[Given] = field(default_factory=list)
    initial: list[Block] = field(default_factory=list)
    stresses: list[Block] = field(default_factory=list)
    steps: list[Step] = field(default_factory=list)
    heat: str = ""  # that of its steps
    modes: dict[str, Any] | None = None
    notes: list[str] = field(default_factory=list)
    outputs: list[Location] = field(default_factory=list)

    def note(self, at: Location | Located, text: str) -> None:
        """Add a note on the interpretation of a line where it is not obvious."""
        self.notes.append(f"{at}: {text}")
