"""The robot followed through a known room, from an unknown start: a search, then particles for each place."""
