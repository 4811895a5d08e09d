"""Base classes of `Model`. Each of them extends the previous one by the methods for one kind of items.

Their order is `base`, `heat`, `loads`, `initial_states`, `connections`, `contact`, `supports`.
"""
