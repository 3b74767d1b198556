"""Behaviours: motor schemas, one a file, and the arbiter that sums them to a velocity. Pure functions."""
