"""Timing of cycles: clocks, timers, pacing, and measurement of costs and delays."""
