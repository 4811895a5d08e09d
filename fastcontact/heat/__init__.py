"""Heat conduction in the solid cells: matrix, loads, and conductance of contacts."""
