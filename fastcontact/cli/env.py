"""``fastcontact env``: versions, threads, cache folder; compiles all kernels on request."""

from __future__ import annotations

import argparse
import os
import time

HELP = "show versions, threads and the cache folder of compiled kernels"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this command."""
    parser.add_argument("--warmup", action="store_true", help="compile the kernels now, so that later runs start fast")


def run(options: argparse.Namespace) -> int:
    """Print the environment."""
    from fastcontact import _jit, summary
    from fastcontact.kernels import solid2d

    for name, version in summary.versions().items():
        print(f"{name:<12} {version}")
    print(f"{'threads':<12} {_jit.threads()} of {os.cpu_count()}")
    cache = getattr(
        getattr(solid2d.add_stiffness, "_cache", None), "cache_path", "none: kernels compile in every process"
    )
    print(f"{'cache':<12} {cache}")
    if options.warmup:
        started = time.perf_counter()
        _warm_up()
        print(f"{'warm-up':<12} {time.perf_counter() - started:.1f} s")
    return 0


def _warm_up() -> None:
    """Run a small problem through every kernel, with linear and quadratic cells."""
    from fastcontact.generate import half_spheres
    from fastcontact.materials import LinearElastic
    from fastcontact.model import Model
    from fastcontact.ramp import linear_ramp
    from fastcontact.solving import solve

    for element, formulation in (("tri3", "node_to_segment"), ("tri6", "continuous")):
        model = Model(half_spheres(element, size=10.0), "axisymmetric")
        model.add_material(LinearElastic(E=1.0, nu=0.3))
        model.fix("A1A2", "x")
        model.prescribe("A2B2", y=-0.1)
        model.prescribe("A1B1", y=0.1)
        model.add_contact("pair", secondary="CONT1", primary="CONT2", formulation=formulation)
        solve(model, linear_ramp(1))
