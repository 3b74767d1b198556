"""The firing pattern as it rotates: which sensors fire next, and when a new pattern takes the old one's place."""

from __future__ import annotations

import math
from dataclasses import dataclass

from config.robot import SOUND_SPEED_M_S
from drivers.denning.frames import TENTH_FT_M, Pattern


@dataclass(frozen=True, slots=True)
class Step:
    """One firing: its moment, its number in the pattern, who fires, and how far they listen."""

    at_us: int
    number: int
    mask: int
    window_m: float
    closes_us: int
    """When the window has closed."""


class Rotation:
    """Steps one pattern after another; a new one begins at a step's boundary, with its first step."""

    def __init__(self) -> None:
        self._pattern: Pattern | None = None
        self._next_pattern: Pattern | None = None
        self._number = 0
        self._at_us = 0

    @property
    def next_us(self) -> int | None:
        """When the next step begins, microseconds; None where nothing fires."""
        return None if self._pattern is None else self._at_us

    def take(self, pattern: Pattern, now_us: int) -> None:
        """Go on with `pattern` from the next boundary, which is now where nothing fires; no masks end the firing."""
        if self._pattern is not None:
            self._next_pattern = pattern
        elif pattern.masks:
            self._pattern, self._number, self._at_us = pattern, 0, now_us

    def step(self, now_us: int) -> Step | None:
        """Return the step that has begun by now and go on to the next, None where none has."""
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
        return Step(at_us, number, pattern.masks[number], window_m, at_us + window_us(pattern))


def window_us(pattern: Pattern) -> int:
    """Return how long sound takes to the window's end and back, microseconds."""
    return math.ceil(2e6 * pattern.window * TENTH_FT_M / SOUND_SPEED_M_S)
