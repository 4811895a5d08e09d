"""Heat: conduction in the solid cells, its loads, and the conductance of contacts."""
