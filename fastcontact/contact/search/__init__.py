"""The closest facet to each of many points, by a tree of boxes."""
