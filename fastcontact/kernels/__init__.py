"""Numba kernels: arrays and scalars in, arrays or status codes out; they import nothing but `_jit`."""
