"""Heat conduction in the solid cells: conduction matrix, heat flux and heat loads."""
