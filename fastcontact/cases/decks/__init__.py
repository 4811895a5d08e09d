"""Input decks of Abaqus and CalculiX: from keyword blocks to a model with a ramp; nothing is dropped silently."""
