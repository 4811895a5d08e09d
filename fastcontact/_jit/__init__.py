"""Compilation of kernels, their cache on disk, and threads."""
