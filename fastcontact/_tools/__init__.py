"""Common tools: checks of arguments, tables for notebooks, paths, packed data, safe reading of HDF5 and TOML."""
