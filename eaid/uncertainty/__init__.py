"""Fit → how sure it is: intervals, identifiability, lack of fit, what to record next."""
