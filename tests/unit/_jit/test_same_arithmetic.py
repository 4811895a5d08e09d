"""Kernels give the same bits in the process that compiles them and in one that loads them."""

import importlib
import os
import pkgutil
import subprocess
import sys

import pytest

import fastcontact

# Facets of a sphere.
ASK = """
import hashlib
import numpy as np
from fastcontact._jit import interpreting
from fastcontact.contact.formulations._cut_faces_kernels import planes

interpreting.SECONDS = -1.0  # not Python in the place of the kernel
a, b = np.meshgrid(np.linspace(0.0, 0.2, 22), np.linspace(0.0, 0.2, 22), indexing="ij")
points = np.stack([np.sin(a), 1.0 - np.cos(a) * np.cos(b), np.cos(a) * np.sin(b)], axis=-1)
corners = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], axis=2).reshape(-1, 4, 3).copy()
origin, axes = np.zeros((len(corners), 3)), np.zeros((len(corners), 3, 3))
planes(corners, 4, origin, axes)
print(hashlib.sha256(axes.tobytes()).hexdigest(), sum(planes.compiled.stats.cache_hits.values()))
"""


def test_the_process_that_compiles_has_the_bits_of_another_of_fewer_threads(tmp_path):
    answers = []
    for threads in "21":
        environment = {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_NUM_THREADS": threads, "NUMBA_DISABLE_JIT": "0"}
        done = subprocess.run(
            [sys.executable, "-c", ASK], capture_output=True, text=True, check=True, env=os.environ | environment
        )
        answers.append(done.stdout.split())
    assert [hits for _, hits in answers] == ["0", "1"]
    assert answers[0][0] == answers[1][0]


def kernels():
    """Every kernel of the package by its name, with its module."""
    found = {}
    for module in pkgutil.walk_packages(fastcontact.__path__, "fastcontact."):
        if module.name.endswith("_kernels"):
            values = vars(importlib.import_module(module.name)).items()
            compiled = {f"{module.name}.{name}": getattr(one, "compiled", one) for name, one in values}
            found |= {name: one for name, one in compiled.items() if hasattr(one, "targetoptions")}
    return found


def test_kernels_round_every_operation_unless_there_is_one_copy_of_them():
    """Kernels that others call are compiled once by themselves and once within those."""
    found = kernels()
    free = {name: one for name, one in found.items() if one.targetoptions["fastmath"]}
    assert len(found) > 100
    assert 0 < len(free) < 10
    for name, one in free.items():
        called = [part for part in one.py_func.__globals__.values() if hasattr(part, "targetoptions")]
        assert not {part.py_func.__name__ for part in called} & set(one.py_func.__code__.co_names), name
        users = [
            other
            for other, kernel in found.items()
            if any(part is one for part in kernel.py_func.__globals__.values())
            and one.py_func.__name__ in kernel.py_func.__code__.co_names
        ]
        assert not users, (name, users)


WHOLE = """
import hashlib, sys
import fastcontact as fc

mesh = fc.generate.sphere_on_block("hex8", R=1.0, size=0.3, contact_size=0.1, contact_radius=0.2)
model = fc.Model(mesh, "3d")
model.add_material(fc.LinearElastic(E=20000.0, nu=0.3))
model.fix("BLOCK_BOTTOM", "xyz")
model.fix("SYMMETRY_X", "x")
model.fix("SYMMETRY_Z", "z")
model.prescribe("SPHERE_TOP", y=-0.01)
model.add_contact("pair", secondary="CONT_SPHERE", primary="CONT_BLOCK", friction=0.2)
digest = hashlib.sha256()
for solver in ("direct", "amg"):
    for step in fc.solve(model, fc.linear_ramp(2), linear_solver=solver):
        digest.update(step.displacement.tobytes())
        digest.update(step.stress.tobytes())
print(digest.hexdigest())
"""


@pytest.mark.slow
def test_a_run_that_compiles_has_the_bits_of_later_ones(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    answers = [
        subprocess.run(
            [sys.executable, "-c", WHOLE], capture_output=True, text=True, check=True, env=environment, timeout=1500
        ).stdout
        for _ in range(2)
    ]
    assert answers[0] == answers[1]
