"""What the log says of a run's cycles: modes, line, objects, alerts."""
