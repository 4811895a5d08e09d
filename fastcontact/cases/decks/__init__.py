"""Conversion of input decks of Abaqus and CalculiX to models with load steps. A note states each keyword without effect."""
