"""Read beyond the end of an array in a kernel, alone and in threads, and print the error of each."""

import numpy as np

from fastcontact._jit.decorators import kernel
from fastcontact._jit.parallel import SINGLE_THREAD_WORK, parallel_for


@kernel
def beyond(low, high, values, out):
    for k in range(low, high):
        out[k] = values[k]


if __name__ == "__main__":
    for work in (1, SINGLE_THREAD_WORK):
        try:
            parallel_for(beyond, 3, work, np.zeros(2), np.zeros(3))
            print("nothing")
        except IndexError:
            print("IndexError")
