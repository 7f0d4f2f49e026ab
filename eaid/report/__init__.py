"""Results → figures, one HTML page, and the paper number by number."""
