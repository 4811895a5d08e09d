"""Call two compiled functions, one of them interpretable: print as JSON whether they are correct and came from the cache."""

import json
import logging
import sys

import numpy as np

logging.basicConfig(level=logging.INFO, stream=sys.stderr, format="%(levelname)s %(name)s: %(message)s")

from fastcontact._jit import interpreting  # noqa: E402 - the log listens before kernels are declared
from fastcontact.linear.cholesky import factorisation_kernels  # noqa: E402
from fastcontact.linear.krylov import krylov_kernels  # noqa: E402

interpreting.MAX_SECONDS = -1.0  # not Python in the place of a kernel
a, b = np.arange(40.0), np.arange(40.0)
krylov_kernels.direction(0, 40, 2.0, a, b)
stats = [kernel.stats for kernel in (krylov_kernels.direction, factorisation_kernels.work_sizes.compiled)]
front = np.array([-1], np.int32), np.array([0, 3]), np.array([0, 0])  # one supernode of three columns
found = {
    "right": bool((3.0 * a == b).all()) and factorisation_kernels.work_sizes(*front) == (9, 0),
    "hits": sum(sum(s.cache_hits.values()) for s in stats),
    "misses": sum(sum(s.cache_misses.values()) for s in stats),
}
print(json.dumps(found))
