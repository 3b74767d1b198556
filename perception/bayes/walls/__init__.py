"""Walls and corners that the readings of the whole drive show, as far as each is sure."""
