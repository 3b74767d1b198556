"""When, whether and wiring: the cycle, its modes, its records, and the command."""
