"""Conversion of input decks of Abaqus and CalculiX to models with load steps. Notes list the keywords without effect."""
