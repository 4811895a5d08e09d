"""The one place that compiles kernels, keeps them on disk, and shares work between threads."""
