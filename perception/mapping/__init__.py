"""The map of a whole building."""
