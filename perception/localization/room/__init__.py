"""A known room: its surfaces, the ranges that a ring should hear in it, and how likely the heard ones are."""
