"""Names of groups that go with another one: they are its name and one of these."""

# Facets on the other side of a cut along the group.
OPPOSITE = " opposite"
# The point whose displacement is the rotation of a reference point.
ROTATION = " rotation"
