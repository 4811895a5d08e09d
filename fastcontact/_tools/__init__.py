"""Common tools: checks of arguments, tables for notebooks, paths, serialisation, and safe reading of HDF5 and TOML."""
