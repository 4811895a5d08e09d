"""Rendering of all studies: tables, figures and pages from plain rows, curves and strings."""
