"""A kernel has the same bits in the process that compiles it and in one that finds it compiled."""

import importlib
import inspect
import os
import pkgutil
import subprocess
import sys

import numba
import pytest

import fastcontact as fc
from fastcontact._jit.decorators import ANY_ORDER, compiled

# Planes of facets of a sphere: the kernel calls another one, which is too long to be taken into its code.
ASK = """
import hashlib
import numpy as np
from fastcontact.contact.formulations._cut_faces_kernels import planes

a, b = np.meshgrid(np.linspace(0.0, 0.2, 22), np.linspace(0.0, 0.2, 22), indexing="ij")
points = np.stack([np.sin(a), 1.0 - np.cos(a) * np.cos(b), np.cos(a) * np.sin(b)], axis=-1)
corners = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], axis=2).reshape(-1, 4, 3).copy()
origin, axes = np.zeros((len(corners), 3)), np.zeros((len(corners), 3, 3))
planes(corners, 4, origin, axes)
print(hashlib.sha256(axes.tobytes()).hexdigest(), sum(planes.stats.cache_hits.values()))
"""


def kernels():
    """Return all kernels of the package by the module and the name that they were written under."""
    found = {}
    for module in pkgutil.walk_packages(fc.__path__, "fastcontact."):
        if module.name.endswith("_kernels"):
            for value in vars(importlib.import_module(module.name)).values():
                if isinstance(value, numba.core.registry.CPUDispatcher):
                    found[value.py_func.__module__, value.py_func.__name__] = value
    return found


def called(kernel):
    """Return the kernels that a kernel names."""
    function = kernel.py_func
    names = inspect.getclosurevars(function).globals.values()
    return [value for value in names if isinstance(value, numba.core.registry.CPUDispatcher)]


@pytest.mark.skipif(not compiled(), reason="needs compiled kernels")
def test_only_kernels_that_stand_alone_change_the_order_of_sums():
    every = kernels()
    assert len(every) > 100
    free = {id(kernel) for kernel in every.values() if kernel.targetoptions["fastmath"]}
    assert free, "none is left to test"
    for name, kernel in every.items():
        allowed = kernel.targetoptions["fastmath"]
        assert not allowed or allowed == ANY_ORDER, name
        assert not (id(kernel) in free and called(kernel)), f"{name} calls others"
        assert not free.intersection(map(id, called(kernel))), f"{name} calls one that may sum in any order"


@pytest.mark.parametrize("threads", ["1", "2"])
def test_the_process_that_compiles_has_the_bits_of_the_others(tmp_path, threads):
    environment = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(tmp_path),
        "NUMBA_NUM_THREADS": threads,
        "NUMBA_DISABLE_JIT": "0",
    }
    answers = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", ASK], capture_output=True, text=True, check=True, env=environment, timeout=300
        )
        answers.append(done.stdout.split())
    assert [hits for _, hits in answers] == ["0", "1"]
    assert answers[0][0] == answers[1][0]
