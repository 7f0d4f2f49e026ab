"""Results: frozen types whose field names are the keys of the result files, and the one codec."""
