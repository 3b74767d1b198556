"""Firmware of a sonar ring with a two-motor base, for MicroPython; it speaks the ring-and-base protocol."""
