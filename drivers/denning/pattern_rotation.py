"""The emulated ring's schedule: which sensors fire next, and when a new pattern replaces the current one."""

from __future__ import annotations

import math
from dataclasses import dataclass

from config.robot import SOUND_SPEED_M_S
from drivers.denning.frames import TENTH_FT_M, Pattern


@dataclass(frozen=True, slots=True)
class Step:
    """One firing: its time, its number in the pattern, which sensors fire, which only listen, and how far."""

    at_us: int
    number: int
    mask: int
    listeners: int
    window_m: float
    closes_us: int
    """When the window closes."""


class Rotation:
    """Steps through a firing pattern; a new pattern starts with its first step, at the end of a step."""

    def __init__(self) -> None:
        self._pattern: Pattern | None = None
        """The present one; None if nothing fires."""
        self._next_pattern: Pattern | None = None
        """What replaces it at the end of the step."""
        self._listeners: tuple[int, ...] = ()
        self._number = 0
        """Number of the next step."""
        self._at_us = 0
        """When it starts."""

    @property
    def next_us(self) -> int | None:
        """When the next step starts, µs; None if nothing fires."""
        return None if self._pattern is None else self._at_us

    def set_pattern(self, pattern: Pattern, now_us: int) -> None:
        """Use `pattern` from the end of the current step, or from now if nothing fires; without masks, stop.

        No sensor listens without firing until the next `set_listeners`.
        """
        self._listeners = ()
        if self._pattern is not None:
            self._next_pattern = pattern
        elif pattern.masks:
            self._pattern, self._number, self._at_us = pattern, 0, now_us

    def set_listeners(self, masks: tuple[int, ...]) -> bool:
        """Let the sensors of `masks` listen, one mask a step of the newest pattern; without masks, none.

        Returns
        -------
        bool
            False, and nothing changes, if the masks do not fit the pattern.
        """
        newest = self._next_pattern or self._pattern
        fired = () if newest is None else newest.masks
        if masks and (len(masks) != len(fired) or any(map(int.__and__, masks, fired))):
            return False
        self._listeners = masks
        return True

    def step(self, now_us: int) -> Step | None:
        """Return the step that has started by now, and advance to the next; None if none has started."""
        if self._pattern is None or self._at_us > now_us:
            return None
        if self._next_pattern is not None:
            self._pattern = self._next_pattern if self._next_pattern.masks else None
            self._next_pattern, self._number = None, 0
        pattern, number, at_us = self._pattern, self._number, self._at_us
        if pattern is None:
            return None
        self._number = (number + 1) % len(pattern.masks)
        self._at_us = at_us + 1000 * pattern.step_period_ms
        window_m = pattern.window * TENTH_FT_M
        listeners = self._listeners[number] if self._listeners else 0
        return Step(at_us, number, pattern.masks[number], listeners, window_m, at_us + window_us(pattern))


def window_us(pattern: Pattern) -> int:
    """Return how long sound takes to the window's end and back, µs."""
    return math.ceil(2e6 * pattern.window * TENTH_FT_M / SOUND_SPEED_M_S)
