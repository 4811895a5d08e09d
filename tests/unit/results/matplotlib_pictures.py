"""Positions of items in Matplotlib pictures."""

from itertools import combinations

import numpy as np

from fastcontact.results.step import ContactResult, StepResult


def step_of(mesh, values=None, displacement=None, stress=None, load_factor=1.0):
    """Return a step with these von Mises stresses, displacements and stresses at the nodes; without forces."""
    n, dim = mesh.points.shape
    u = np.zeros((n, dim)) if displacement is None else displacement
    stress = np.zeros((n, 4 if dim == 2 else 6)) if stress is None else stress
    values = np.zeros(n) if values is None else values
    return StepResult(1, load_factor, u, stress, values, values, np.zeros((n, dim)))


def contact_of(points, coordinates, **given):
    """Return a contact of nodes at `coordinates` (m, dim), all of whose values that are not `given` are zero."""
    zero, vector = np.zeros(len(points)), np.zeros_like(coordinates, float)
    fields = dict.fromkeys(("abscissa", "gap", "pressure", "multiplier"), zero) | {"active": zero > 0}
    fields |= {"force_vectors": vector, "normal": vector, "force": np.zeros(vector.shape[1]), "radius": (0.0, 1.0)}
    return ContactResult(
        **{"name": "c", "formulation": "mortar", **fields, **given}, points=points, coordinates=coordinates
    )


def polygons_of(monkeypatch):
    """Return a list of the polygons in space that matplotlib is given from now on."""
    from mpl_toolkits.mplot3d import art3d

    given = []

    class Recorded(art3d.Poly3DCollection):
        def __init__(self, verts, **options):
            given.extend(np.asarray(polygon) for polygon in verts)
            super().__init__(verts, **options)

    monkeypatch.setattr(art3d, "Poly3DCollection", Recorded)
    return given


def texts(ax):
    """Return boxes (left, bottom, right, top) of what is written, by name, in parts of the picture; ticks by their axis."""
    axes = {name: getattr(ax, f"{name}axis") for name in "xyz" if hasattr(ax, f"{name}axis")}
    found = {"title": ax.title, "legend": ax.get_legend(), "colours": ax.figure.axes[-1]}
    for name, axis in axes.items():
        found[f"{name} label"] = axis.label
        low, high = sorted(axis.get_view_interval())
        shown = [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
        found |= {f"{name} tick {k}": text for k, text in enumerate(shown) if text.get_text()}
    renderer, whole = ax.figure.canvas.get_renderer(), ax.figure.bbox
    boxes = {name: artist.get_tightbbox(renderer) for name, artist in found.items() if artist is not None}
    return {
        name: (box.x0 / whole.width, box.y0 / whole.height, box.x1 / whole.width, box.y1 / whole.height)
        for name, box in boxes.items()
    }


def overlaps(boxes, solid=False):
    """Return what the edge of the picture cuts off, and pairs that lie on each other.

    In space labels stand askew, and their boxes tell little: there those of one axis are held against each other alone.
    """
    cut = [name for name, box in boxes.items() if min(box) < -0.001 or max(box) > 1.001]
    pairs = [
        (one, other)
        for one, other in combinations(boxes, 2)
        if not solid
        or {one, other} & {"title", "legend", "colours"}
        or one.split(" tick")[0] == other.split(" tick")[0]
    ]
    return cut + [(one, other) for one, other in pairs if _meet(boxes[one], boxes[other])]


def _meet(a, b):
    return min(a[2], b[2]) - max(a[0], b[0]) > 0.002 and min(a[3], b[3]) - max(a[1], b[1]) > 0.002


def frames_of(monkeypatch, draw):
    """Call `draw`; return of each picture of the animation what overlaps, the proportions and the limits of its axes."""
    from matplotlib.animation import PillowWriter

    seen, grab = [], PillowWriter.grab_frame

    def grabbed(writer, **options):
        grab(writer, **options)
        ax = writer.fig.axes[0]
        ends = [getattr(ax, f"get_{name}lim")() for name in "xyz"]
        limits = [float(high - low) for low, high in ends]
        # Unit vectors along the axes are drawn as long as they are in the view, if all are scaled alike.
        seen.append({"overlaps": overlaps(texts(ax), solid=True), "scales": scales(ax), "limits": limits})

    monkeypatch.setattr(PillowWriter, "grab_frame", grabbed)
    draw()
    return seen


def scales(ax):
    """Return how long a unit of length along each axis (3,) is drawn, by how long it is seen."""
    import numpy as np
    from mpl_toolkits.mplot3d import proj3d

    elevation, azimuth = np.radians([ax.elev, ax.azim])
    eye = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    middle = np.array([np.mean(getattr(ax, f"get_{name}lim")()) for name in "xyz"])
    size = min(np.ptp(getattr(ax, f"get_{name}lim")()) for name in "xyz")
    shown = [np.array(proj3d.proj_transform(*at, ax.get_proj())[:2]) for at in (middle, *(middle + size * np.eye(3)))]
    return [float(np.linalg.norm(end - shown[0]) / np.sqrt(1 - k**2)) for end, k in zip(shown[1:], eye, strict=True)]
