"""A hand before each sensor of a ring in turn: whether that sensor answers which the robot file has there.

It finds sensors whose wires are exchanged, a ring that is mounted turned, and sensors that never hear an echo: what a
robot that stands cannot know by itself.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Final

from config.robot import RingConfig

HELD_M: Final = (0.1, 0.3)
"""A hand is held so far from a sensor, m, or as much farther as the sensor hears nothing nearer."""
FARTHER_M: Final = 0.05
"""A hand is asked for farther from a sensor than its least range by this, m."""
NEARER_M: Final = 0.1
"""A hand is not farther than was asked for by this, m, and nearer than what the sensor heard before by this."""
READINGS: Final = 3
"""So many readings in a row of a sensor are of the hand."""
_SAME_RAD: Final = math.radians(5.0)
_SIDES: Final = ("ahead", "ahead to the left", "to the left", "behind to the left", "behind",
                 "behind to the right", "to the right", "ahead to the right")  # fmt: skip


def held_m(ring: RingConfig) -> tuple[float, float]:
    """Return how near to a sensor of a ring a hand is held, and how far from it, m."""
    near_m = max(HELD_M[0], ring.range_min_m + FARTHER_M)
    return near_m, near_m + HELD_M[1] - HELD_M[0]


class HandWatch:
    """Finds the sensor that a hand is held before.

    Parameters
    ----------
    before : sequence of float
        What each sensor heard before, m; +inf for nothing.
    far_m : float
        How far from a sensor a hand is held at most, m.
    """

    def __init__(self, before: Sequence[float], far_m: float) -> None:
        self._before = tuple(before)
        self._far_m = far_m + NEARER_M
        self._near = [0] * len(self._before)
        self._free = [False] * len(self._before)

    def ask(self) -> None:
        """Wait for another hand: one that is there already does not count until it has gone."""
        self._free = [near == 0 for near in self._near]

    @property
    def answering(self) -> frozenset[int]:
        """The sensors that hear something as near as a hand, in all but one of `READINGS` at least."""
        return frozenset(i for i, near in enumerate(self._near) if near >= READINGS - 1 and self._free[i])

    def take(self, ranges: Sequence[float], first: Collection[int] = ()) -> int | None:
        """Take the ranges of a firing; return the sensor that now hears a hand, None if none does.

        Where several do, it is one of `first` if it can be.
        """
        for i, (range_m, before_m) in enumerate(zip(ranges, self._before, strict=True)):
            if math.isnan(range_m):
                continue
            is_near = range_m < min(self._far_m, before_m - NEARER_M)
            self._near[i] = self._near[i] + 1 if is_near else 0
            self._free[i] |= not is_near
        found = [i for i, near in enumerate(self._near) if near >= READINGS and self._free[i]]
        return max(found, key=lambda i: (i in first, self._near[i]), default=None)


def side_of(angle_rad: float) -> str:
    """Return a direction in words and degrees, counter-clockwise from ahead."""
    degrees = math.degrees(math.remainder(angle_rad, math.tau))
    return f"{_SIDES[round(degrees / 45.0) % 8]} ({degrees:.0f} degrees)"


def judge_hands(ring: RingConfig, answered: Sequence[int | None], before: Sequence[float]) -> list[str]:
    """Return what is wrong, a line each; none if each sensor answered in its place.

    Parameters
    ----------
    ring : RingConfig
        Without servos.
    answered : sequence of int, optional
        Which sensor answered the hand in the place of each; None if none did.
    before : sequence of float
        What each sensor heard before, m; +inf for nothing.
    """
    axes = [mount.angle_rad for mount in ring.mounts]
    if all(answer is None for answer in answered):
        return [
            "NO SENSOR heard the hand: the ring is mounted the other way round, or no echo reaches the board: check "
            "the 5 V of the sensors and the wires of trigger and echo; an echo of 5 V needs a divider to the board's "
            "3.3 V, and without one the pin is destroyed"
        ]
    wrong = [(i, answer) for i, answer in enumerate(answered) if answer is not None and answer != i]
    turns = [math.remainder(axes[i] - axes[answer], math.tau) for i, answer in wrong]
    if len(wrong) > 1 and len(wrong) == sum(answer is not None for answer in answered):
        apart = max(abs(math.remainder(turn - turns[0], math.tau)) for turn in turns)
        if apart < _SAME_RAD:
            return [
                f"TURNED: the ring is mounted turned by {abs(math.degrees(turns[0])):.0f} degrees against the robot "
                f"file: turn it, or correct the order of SENSORS or of ring.sensors"
            ]
    lines = [
        f"EXCHANGED: a hand {side_of(axes[i])} is heard by sensor {answer}, and sensor {i} belongs there: exchange "
        f"their wires, or correct the order of SENSORS or of ring.sensors"
        for i, answer in wrong
    ]
    return [*lines, *(deaf_text(i, axes[i], before[i]) for i, answer in enumerate(answered) if answer is None)]


def deaf_text(sensor: int, angle_rad: float, before_m: float) -> str:
    """Return the finding about a sensor that does not hear a hand in this direction, and what it heard before, m."""
    missed = f"sensor {sensor} DOES NOT HEAR a hand {side_of(angle_rad)}"
    if before_m < math.inf:
        return (
            f"{missed}, and it reports {before_m:.2f} m: it looks elsewhere, or always reports that; clear what is "
            f"nearer than the hand, see how the sensor is mounted, then check its wires or replace it"
        )
    return (
        f"{missed}: check its 5 V and its wires of trigger and echo; an echo of 5 V needs a divider to the board's "
        f"3.3 V"
    )
