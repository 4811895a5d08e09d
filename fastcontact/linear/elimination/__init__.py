"""Linear equations eliminated from the unknowns of multigrid, one unknown for each equation."""
