"""Polygons: initiation, likelihood, search for the pose, and its posterior."""
