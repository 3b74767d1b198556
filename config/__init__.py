"""Settings: their schema, how files become settings, and the shipped files."""
