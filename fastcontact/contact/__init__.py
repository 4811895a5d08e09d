"""Contact: surfaces, contact detection, pairing, constraints and formulations."""
