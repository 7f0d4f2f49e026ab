"""Synthetic logs of a plant, and where the shipped datasets are."""
