"""Small vibrations about a settled load step."""
