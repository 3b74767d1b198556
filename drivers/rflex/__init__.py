"""Robots with an rFLEX controller: B21r, ATRV-Jr, Magellan: its wire format, its driver and an emulated robot."""
