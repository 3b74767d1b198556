"""Runs without a robot: the closed loop in virtual time, scenes with known truth, and the emulator as a process."""
