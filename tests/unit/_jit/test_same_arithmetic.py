"""Planes of facets have the same bits in the process that compiles them and in one that finds them compiled."""

import os
import subprocess
import sys

import pytest

# Facets of a sphere.
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
