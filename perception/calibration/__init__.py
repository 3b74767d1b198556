"""Calibration: a robot's sensors, odometer and ranges from one recorded drive by walls and round objects."""
