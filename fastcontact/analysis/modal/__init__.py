"""Small vibrations about a converged load step."""
