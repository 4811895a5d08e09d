"""Building blocks of `sensitivities`: derivatives of results with respect to parameters."""
