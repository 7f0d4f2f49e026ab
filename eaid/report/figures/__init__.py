"""Figures as pure functions: result in, matplotlib Figure out; no file and no display."""
