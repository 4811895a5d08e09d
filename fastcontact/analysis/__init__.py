"""The analysis of a model: load steps, contact geometry, active set, friction, restart."""
