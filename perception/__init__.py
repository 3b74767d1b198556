"""Perception: objects from echoes, by the paper's four steps or by a Bayesian method. Pure: no clock, I/O or log."""
