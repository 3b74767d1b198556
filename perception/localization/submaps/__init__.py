"""Drift corrected without known objects: maps of a few metres of way, their matches, and the graph of their poses."""
