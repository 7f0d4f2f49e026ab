"""Fit → gains: bounds of B, robust control, PI; one pure step() each."""
