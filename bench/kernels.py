"""Record the kernels that typical runs call in ``fastcontact/_jit/kernels.json``, from which they are compiled ahead of time.

Run it after a change of a kernel's arguments: ``python bench/kernels.py``. It solves a small model of each kind in a separate
process without compilation, and records the called kernels with their types, in order.
"""

from __future__ import annotations

import argparse
import functools
import importlib
import json
import os
import subprocess
import sys
import warnings
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

import fastcontact as fc
from fastcontact._jit import ahead, decorators, interpreting


def spheres(element: str, formulation: str) -> fc.Model:
    model = fc.Model(fc.generate.half_spheres(element, size=10.0), "axisymmetric")
    model.fix("A1A2", "x")
    model.prescribe("A2B2", y=-0.1)
    model.prescribe("A1B1", y=0.1)
    model.add_contact("pair", secondary="CONT1", primary="CONT2", formulation=formulation)
    return model


def blocks(formulation: str, friction: float) -> fc.Model:
    sizes = {"size_lower": (4.0, 2.0), "size_upper": (2.0, 2.0), "shift": 1.0}
    divisions = {"divisions_lower": (8, 4), "divisions_upper": (5, 4)}
    model = fc.Model(fc.generate.block_on_block("quad4", **sizes, **divisions), "plane_strain")
    model.fix("LOWER_BOTTOM", "xy")
    model.prescribe("UPPER_TOP", x=0.001, y=-0.01)
    model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", formulation=formulation, friction=friction)
    return model


def on_plane(friction: float, formulation: str) -> fc.Model:
    model = fc.Model(fc.generate.block((2.0, 1.0), (6, 3), "quad4"), "plane_strain")
    model.prescribe("TOP", x=0.001, y=-0.01)
    plane = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("pair", secondary="BOTTOM", obstacle=plane, formulation=formulation, friction=friction)
    return model


def ball(element: str, formulation: str, friction: float) -> fc.Model:
    mesh = fc.generate.sphere_on_block(element, R=1.0, size=0.4, contact_size=0.2, contact_radius=0.2)
    model = fc.Model(mesh, "3d")
    model.fix("SYMMETRY_X", "x")
    model.fix("SYMMETRY_Z", "z")
    model.fix("BLOCK_BOTTOM", "y")
    model.prescribe("SPHERE_TOP", y=-0.02)
    options = {"formulation": formulation, "friction": friction}
    model.add_contact("pair", secondary="CONT_SPHERE", primary="CONT_BLOCK", **options)
    return model


def octant(friction: float, formulation: str) -> fc.Model:
    model = fc.Model(fc.generate.sphere_octant("hex8", size=12.5, contact_size=4.0, contact_radius=6.0), "3d")
    model.fix("SYMMETRY_X", "x")
    model.fix("SYMMETRY_Z", "z")
    model.prescribe("SPHERE_TOP", y=-0.5)
    plane = fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    model.add_obstacle("pair", secondary="CONT_SPHERE", obstacle=plane, formulation=formulation, friction=friction)
    return model


def models() -> list[tuple[Callable[..., fc.Model], tuple[Any, ...], str]]:
    """Return a list of functions that return models, with their arguments and the linear solver of each run."""
    formulations = ("node_to_segment", "mortar", "continuous")
    return [
        *((spheres, ("tri3", formulation), "auto") for formulation in formulations),
        (blocks, ("mortar", 0.1), "auto"),
        (on_plane, (0.0, "continuous"), "auto"),
        *((ball, ("hex8", formulation, 0.0), "auto") for formulation in formulations),
        (octant, (0.0, "node_to_segment"), "auto"),
        (octant, (0.0, "node_to_segment"), "amg"),
        (ball, ("hex8", "mortar", 0.1), "amg"),
    ]


def type_entry(argument: Any) -> Any:
    """Return the type of an argument as `ahead.numba_type` reads it; None if the table cannot hold it."""
    if isinstance(argument, np.ndarray):
        plain = argument.flags.c_contiguous and argument.flags.aligned and argument.dtype.kind in "biuf"
        return [argument.dtype.str[1:], argument.ndim, *([] if argument.flags.writeable else ["r"])] if plain else None
    if isinstance(argument, tuple):
        members, named = [type_entry(member) for member in argument], hasattr(argument, "_fields")
        name = f"{type(argument).__module__}.{type(argument).__qualname__}" if named else ""
        return None if None in members else {name: members}
    for kind, scalar in ((bool | np.bool_, "b1"), (int | np.integer, "i8"), (float | np.floating, "f8")):
        if isinstance(argument, kind):
            return scalar
    return None


def recorder(kernels: list[list[Any]], work: Counter[int]) -> Callable[..., Any]:
    """Return a replacement of the compiler that leaves kernels in Python and records their calls in `kernels` and `work`.

    Calls by other kernels are not recorded. The work of a kernel is the number of entries of the arguments of all its calls.
    """
    active: list[str] = []

    def plain(function: Callable[..., Any], **_: Any) -> Callable[..., Any]:
        @functools.wraps(function)
        def recorded(*arguments: Any) -> Any:
            kernel = [function.__module__, function.__qualname__, [type_entry(argument) for argument in arguments]]
            if not active and None not in kernel[2]:
                if kernel not in kernels:
                    kernels.append(kernel)
                work[kernels.index(kernel)] += int(min(interpreting.n_entries(arguments), 1e9))
            active.append(function.__name__)
            try:
                return function(*arguments)
            finally:
                active.pop()

        return recorded

    return plain


def is_interpretable(module: str, name: str) -> bool:
    """Return whether Python may run a kernel while it is not compiled."""
    return isinstance(getattr(importlib.import_module(module), name), interpreting.InterpretableKernel)


def kernels_of_model(number: int) -> dict[str, Any]:
    """Solve a model; return its kind of run, the kernels that are called, in order, and their work."""
    kernels: list[list[Any]] = []
    work: Counter[int] = Counter()
    decorators._compile = recorder(kernels, work)
    make, arguments, solver = models()[number]
    model = make(*arguments)
    model.add_material(fc.LinearElastic(E=1.0, nu=0.3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # NumPy warns of operations for which compiled kernels give no warning
        fc.solve(model, 1, linear_solver=solver)
    kind = f"{model.mesh.dim}d{' amg' if solver == 'amg' else ''}"
    return {"kind": kind, "kernels": kernels, "work": [work[number] for number in range(len(kernels))]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--one", type=int, help="print the kernels that the model with this number calls")
    options = parser.parse_args()
    if options.one is not None:
        print(json.dumps(kernels_of_model(options.one)))
        return
    kernels: list[list[Any]] = []
    runs: dict[str, list[int]] = {}
    work: Counter[int] = Counter()
    for number, (make, arguments, solver) in enumerate(models()):
        plain = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
        command = [sys.executable, __file__, "--one", str(number)]
        done = subprocess.run(command, stdout=subprocess.PIPE, check=True, env=plain)
        recorded = json.loads(done.stdout)
        kernels.extend(kernel for kernel in recorded["kernels"] if kernel not in kernels)
        numbers = [kernels.index(kernel) for kernel in recorded["kernels"]]
        work.update(dict(zip(numbers, recorded["work"], strict=True)))
        runs[recorded["kind"]] = sorted({*runs.get(recorded["kind"], []), *numbers})
        print(f"{make.__name__}{arguments} {solver}: {len(numbers)} kernels, {len(kernels)} in all", flush=True)
    lines = ",\n".join(json.dumps(kernel) for kernel in kernels)
    small = {number for number, (module, name, _) in enumerate(kernels) if is_interpretable(module, name)}
    split = {
        name: [[n for n in numbers if n not in small], sorted(small.intersection(numbers), key=lambda n: -work[n])]
        for name, numbers in sorted(runs.items())
    }
    of_runs = ",\n".join(f"{json.dumps(name)}: {json.dumps(numbers)}" for name, numbers in split.items())
    ahead.TABLE.write_text(f'{{"kernels": [\n{lines}\n],\n"runs": {{\n{of_runs}\n}}}}\n', encoding="utf-8")


if __name__ == "__main__":
    main()
