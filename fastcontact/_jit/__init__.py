"""Kernels: compilation, cache on disk, and threads."""
