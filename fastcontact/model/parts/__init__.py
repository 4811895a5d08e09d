"""Base classes of `Model`. Each of them extends the previous one by the methods for one kind of items."""
