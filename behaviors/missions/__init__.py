"""Missions: chains of schemas with conditions, as a finite state machine. Pure functions."""
