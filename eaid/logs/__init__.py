"""Files → Run: one reader a format, columns and units, data.h5."""
