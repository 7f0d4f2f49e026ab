"""Results → figures and one HTML page."""
