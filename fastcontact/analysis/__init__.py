"""Analyses of a model: load steps with contact, modes and sensitivities. To read the code, begin with `load_step`."""
