"""Percepts to velocity: one motor schema a file, and the arbiter that sums them. Pure."""
