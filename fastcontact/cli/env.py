"""``fastcontact env``: versions, threads, cache folder; compiles all kernels on request."""

from __future__ import annotations

import argparse
import os
import time
import warnings

from fastcontact.cli._terminal import say
from fastcontact.errors import FastcontactWarning

HELP = "show versions, threads and the cache folder of compiled kernels"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this command."""
    parser.add_argument("--warmup", action="store_true", help="compile the kernels now, so that later runs start fast")


def run(options: argparse.Namespace) -> int:
    """Print the environment."""
    from fastcontact._jit import decorators as _jit
    from fastcontact.cases import summary
    from fastcontact.elasticity import element_2d_kernels

    for name, version in summary.versions().items():
        say(f"{name:<12} {version}")
    say(f"{'threads':<12} {_jit.threads()} of {os.cpu_count()}")
    files = getattr(getattr(element_2d_kernels.add_stiffness, "_cache", None), "_cache_file", None)
    say(f"{'cache':<12} {getattr(files, 'folder', 'none: kernels compile in every process')}")
    if options.warmup:
        started = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FastcontactWarning)  # the results are not used
            _warm_up()
        say(f"{'warm-up':<12} {time.perf_counter() - started:.1f} s")
    return 0


def _warm_up() -> None:
    """Run small problems through the kernels that most runs need, in two and three dimensions."""
    from fastcontact.analysis.run import solve
    from fastcontact.elasticity.materials import LinearElastic
    from fastcontact.mesh import generate
    from fastcontact.model.model import Model
    from fastcontact.model.ramp import linear_ramp

    for element, formulation in (("tri3", "node_to_segment"), ("tri6", "continuous"), ("tri3", "mortar")):
        model = Model(generate.half_spheres(element, size=10.0), "axisymmetric")
        model.add_material(LinearElastic(E=1.0, nu=0.3))
        model.fix("A1A2", "x")
        model.prescribe("A2B2", y=-0.1)
        model.prescribe("A1B1", y=0.1)
        model.add_contact("pair", secondary="CONT1", primary="CONT2", formulation=formulation)
        solve(model, linear_ramp(1))
    for element, formulation, solver, friction in (
        ("hex8", "node_to_segment", "amg", 0.0), ("hex8", "node_to_segment", "amg", 0.1), ("tet4", "mortar", "direct", 0.0),
    ):  # fmt: skip
        model = Model(generate.sphere_on_block(element, R=1.0, size=0.4, contact_size=0.2, contact_radius=0.2), "3d")
        model.add_material(LinearElastic(E=1.0, nu=0.3))
        model.fix("SYMMETRY_X", "x")
        model.fix("SYMMETRY_Z", "z")
        model.fix("BLOCK_BOTTOM", "y")
        model.prescribe("SPHERE_TOP", y=-0.02)
        model.add_contact(
            "pair", secondary="CONT_SPHERE", primary="CONT_BLOCK", formulation=formulation, friction=friction
        )
        solve(model, linear_ramp(1), linear_solver=solver)
