"""The parts of a model, each a class that adds its methods to the one before; `Model` is the last."""
