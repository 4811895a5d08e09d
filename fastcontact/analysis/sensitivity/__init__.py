"""Derivatives of results by parameters: what `sensitivities` is made of."""
