"""The sonar boards of an emulated Pioneer: arrays of eight that fire one disc each, all arrays at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

ARRAYS, DISCS = 4, 8
"""Most arrays of a robot, and discs of an array."""
CYCLE_MIN_MS, CYCLE_MAX_MS = 2, 120
FIRST_FLAG: Final = 1
"""Bit of the first array in the SIP's flags."""


class SonarArrays:
    """Which disc of each array fires when.

    Parameters
    ----------
    numbers
        Number of each sensor of the ring, counted from 0; the array is the number over eight.
    cycle_ms
        Time between the firings of an array.
    """

    def __init__(self, numbers: Sequence[int], cycle_ms: int) -> None:
        self._sensor_of = {number: sensor for sensor, number in enumerate(numbers)}
        self._cycle_us = 1000 * cycle_ms
        self._due_us: int | None = None
        self._on = [True] * ARRAYS
        self._sequences = self._by_array(sorted(self._sensor_of))
        self._at = [0] * ARRAYS

    @property
    def next_us(self) -> int | None:
        """When discs fire next, µs; None while no SIP is sent."""
        return self._due_us

    @property
    def cycle_us(self) -> int:
        """Time between the firings of an array, µs."""
        return self._cycle_us

    @property
    def flags(self) -> int:
        """The bits of the SIP's flags: which arrays are on."""
        return sum(on << FIRST_FLAG + array for array, on in enumerate(self._on))

    def start(self, now_us: int) -> None:
        """Fire from now on."""
        self._due_us = now_us

    def poll(self, discs: Sequence[int]) -> None:
        """Fire the discs of a POLLING sequence, counted from 1, each array its own in turn; others are skipped."""
        self._sequences = self._by_array([disc - 1 for disc in discs])
        self._at = [0] * ARRAYS

    def switch(self, value: int) -> None:
        """Carry out SONAR: bit 0 is on or off, the others the array counted from 1, or 0 for all."""
        array, on = value >> 1, bool(value & 1)
        if array == 0:
            self._on = [on] * ARRAYS
        elif array <= ARRAYS:
            self._on[array - 1] = on

    def set_cycle(self, cycle_ms: int) -> None:
        """Set the time between firings."""
        self._cycle_us = 1000 * min(CYCLE_MAX_MS, max(CYCLE_MIN_MS, cycle_ms))

    def fire(self, now_us: int) -> list[int]:
        """Return the sensors that fire now, at most one of each array; none if it is not time."""
        if self._due_us is None or now_us < self._due_us:
            return []
        self._due_us += self._cycle_us
        fired = []
        for array, sequence in enumerate(self._sequences):
            if self._on[array] and sequence:
                fired.append(self._sensor_of[sequence[self._at[array] % len(sequence)]])
                self._at[array] += 1
        return fired

    def _by_array(self, numbers: Sequence[int]) -> list[list[int]]:
        known = [number for number in numbers if number in self._sensor_of]
        return [[number for number in known if number // DISCS == array] for array in range(ARRAYS)]
