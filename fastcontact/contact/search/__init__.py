"""Search for the closest facet to each of many points, with a tree of bounding boxes."""
