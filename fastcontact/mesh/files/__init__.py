"""Reading and writing of mesh files."""
