"""One cycle of the main process: inputs, the pure step, modes, drive requests, the connection, live settings."""
