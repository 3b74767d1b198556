"""The sonar boards of an emulated Pioneer: arrays of eight that fire one disc each, all arrays at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from config.robot import SOUND_SPEED_M_S
from drivers.arcos.firmware import Firmware
from drivers.arcos.frames import NO_ECHO_MM, SonarReading
from drivers.arcos.sonar import DISCS_PER_ARRAY
from drivers.arcos.wire_units import CYCLE_MAX_MS, CYCLE_MIN_MS
from drivers.emulator.body import Body
from drivers.emulator.faulty_sonar import FaultySonar

ARRAYS: Final = 4
"""Most arrays of a robot."""
FIRST_FLAG: Final = 1
"""Bit of the first array in the SIP's flags."""


class SonarArrays:
    """Which disc of each array fires when.

    `numbers` are those of the ring's sensors, counted from 0: the array is the number over eight. An array fires
    every `cycle_ms`.
    """

    def __init__(self, numbers: Sequence[int], cycle_ms: int) -> None:
        self._sensor_of = {number: sensor for sensor, number in enumerate(numbers)}
        """Index in the ring of each number."""
        self._cycle_us = 1000 * cycle_ms
        self._due_us: int | None = None
        """When discs fire next; None before `start`."""
        self._on = [True] * ARRAYS
        """Whether each array fires."""
        self._sequences = self._by_array(sorted(self._sensor_of))
        """The numbers that each array fires in turn."""
        self._at = [0] * ARRAYS
        """How many each has fired so far."""

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
        """Return the sensors that fire now, at most one of each array; none if it is not time. Go on to the next."""
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
        """Return the numbers of each array, in order, without those that the ring does not have."""
        known = [number for number in numbers if number in self._sensor_of]
        return [[number for number in known if number // DISCS_PER_ARRAY == array] for array in range(ARRAYS)]


class SonarReadings:
    """The ranges of discs that have fired; each is known at the end of its cycle.

    `firmware` has numbers and factor of the ranges, `sonar` is the discs with their faults, which listen up to
    `window_m`.
    """

    def __init__(self, firmware: Firmware, sonar: FaultySonar, window_m: float) -> None:
        self._firmware = firmware
        self._sonar = sonar
        self._window_m = min(window_m, 1e-3 * NO_ECHO_MM)
        self._pending: list[tuple[int, SonarReading]] = []
        """Readings, and when each is known, µs."""

    def fire(self, sensors: Sequence[int], now_us: int, cycle_us: int, body: Body) -> None:
        """Fire sensors together; they listen until the cycle ends."""
        if not sensors:
            return
        window_m = min(self._window_m, 0.5e-6 * cycle_us * SOUND_SPEED_M_S)
        ranges = self._sonar.fire(now_us, body.pose, body.ring_yaw, sensors, window_m)
        for sensor, range_m in zip(sensors, ranges, strict=True):
            if range_m is None:  # a disc that reports nothing
                continue
            raw = round(min(1e3 * range_m, NO_ECHO_MM) / self._firmware.mm_per_range)
            reading = SonarReading(self._firmware.sensor_numbers[sensor], min(raw, 0xFFFF))
            self._pending.append((now_us + cycle_us, reading))

    def take(self, now_us: int) -> list[SonarReading]:
        """Return the readings that are known by now, in the order of firing, and remove them."""
        known = [reading for known_us, reading in self._pending if known_us <= now_us]
        self._pending = [later for later in self._pending if later[0] > now_us]
        return known

    def clear(self) -> None:
        """Forget all readings."""
        self._pending.clear()
