"""Contact: surfaces, the search for who faces whom, pairing, constraints and formulations."""
