"""What the emulated robots of all families share: acoustics, body, faults, transports, control of time."""
