"""The analysis of a model. Start reading in `load_step`: one load step from its loads to its result."""
