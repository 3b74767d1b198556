"""The robot side as a program of its own: acoustics, body, and the device that speaks the protocol."""
