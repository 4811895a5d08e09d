"""Contact: surfaces, pairing, constraints and the formulations that join them."""
