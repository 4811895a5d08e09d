"""Linear equations among unknowns, eliminated: which unknown each equation eliminates, and what that does to vectors."""
