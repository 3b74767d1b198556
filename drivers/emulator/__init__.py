"""Parts common to the emulated robots of all families: acoustics, body, faults, transports, control of time."""
