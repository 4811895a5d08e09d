"""Suffixes of the names of groups that accompany another group."""

# Facets on the other side of a cut along the group.
OPPOSITE = " opposite"
# The point whose displacement is the rotation of a reference point.
ROTATION = " rotation"
