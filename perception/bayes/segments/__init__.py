"""Outline segments from pairs of readings, and the map that holds them."""
