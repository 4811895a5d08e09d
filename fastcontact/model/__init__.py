"""Description of a contact problem: materials, supports, loads and contact pairs, with checks before the solution."""
