"""Mesh and result files, in and out: one file a format."""
