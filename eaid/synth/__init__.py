"""Synthetic logs of a plant, and the three datasets that ship with the package."""
