"""What every room uses: checks of arguments, tables for notebooks, paths, packed data, HDF5 and TOML with care."""
