"""Read beyond the end of an array in a serial and in a parallel kernel, and print the error of each."""

import numba
import numpy as np

from fastcontact._jit.decorators import kernel, parallel_kernel


@kernel
def beyond(values, k):
    return values[k]


@parallel_kernel
def beyond_together(values, out):
    for k in numba.prange(len(out)):
        out[k] = values[k]


if __name__ == "__main__":
    for call in (lambda: beyond(np.zeros(2), 2), lambda: beyond_together(np.zeros(2), np.zeros(3))):
        try:
            call()
            print("nothing")
        except IndexError:
            print("IndexError")
