"""The live view of a run on a terminal, and its keys."""
