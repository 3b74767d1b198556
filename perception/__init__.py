"""Echoes to objects: the paper's four steps and what goes beyond them. Pure: no clock, no I/O, no logging."""
