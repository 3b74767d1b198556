"""Measurements: our methods against libraries on the same readings, and the timing of a run. No tests are here."""
