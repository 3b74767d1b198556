"""Whether a ring log can be in metres, radians and seconds.

Such a file may come from any program. One in millimetres or degrees is valid CSV, and perception finds nothing in it:
so positions, headings, times and ranges are compared with what the robot can do and its ring can hear.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Final

import numpy as np

from config.robot import RobotConfig
from drivers.messages import Firing
from runtime.recording.conventions.table import LENGTHS
from runtime.recording.ring_log import RingLogError

FIRST: Final = 400
"""Firings that are judged before the first one is passed on; later ones at each doubling, and at the end."""
MOVED_MIN_M: Final = 0.003
"""A shorter step has no direction."""
STEPS_MIN: Final = 30
"""Steps that moved or turned before they are judged."""
STEPS_KEPT: Final = 4096
"""Newest steps that are judged."""
FAST_FACTOR, TURN_FACTOR = 20.0, 5.0
"""A log whose median speed or rate of turning exceeds the robot's by such a factor is in another unit: millimetres
give a thousand, degrees 57. A median, because a leap of the odometry is no unit."""
ALONG_MIN: Final = 0.95
AGAINST_MAX: Final = 0.8
"""Median |cos| between path and heading: a robot drives along its heading; in a wrong unit, that is anywhere."""
DISTINCT: Final = 0.1
"""Least difference of that cosine between radians and degrees for a step that can show the unit: on a straight drive
along x, both fit."""
FAR_SHARE: Final = 0.3
"""Share of the ranges that may lie beyond the ring's."""
CEILING_SHARE: Final = 0.3
"""Share of the ranges that may be one and the same largest number."""
RANGES_MIN: Final = 50
PERIOD_MAX_S: Final = 10.0
"""Longest mean time between firings."""


class RingLogUnits:
    """Steps and ranges of a log, and what they say about its units.

    Parameters
    ----------
    robot : RobotConfig
        The robot that the log is said to be of.
    """

    def __init__(self, robot: RobotConfig) -> None:
        self._robot = robot
        self.count = 0
        self._first_t = 0.0
        self._last: Firing | None = None
        self._moves: deque[tuple[float, float, float]] = deque(maxlen=STEPS_KEPT)
        """Speed, and |cos| of the angle between the step and theta in rad and in degrees."""
        self._turns: deque[float] = deque(maxlen=STEPS_KEPT)
        """Turning rates."""
        self._ranges = self._far = self._ceiling = 0
        self._highest = 0.0

    def add(self, firing: Firing) -> None:
        """Take in a firing."""
        self.count += 1
        last, self._last = self._last, firing
        if last is None:
            self._first_t = firing.robot_s
        else:
            self._add_step(last, firing)
        heard = firing.ranges_m[np.isfinite(firing.ranges_m)]
        self._ranges += len(heard)
        self._far += int(np.count_nonzero(heard > 1.2 * self._robot.ring.range_max_m))
        highest = float(heard.max(initial=0.0))
        if highest > self._highest:
            self._highest, self._ceiling = highest, 0
        self._ceiling += int(np.count_nonzero(heard == self._highest))

    def problem(self) -> str | None:
        """Return why the log cannot be in metres, radians and seconds, None if it can."""
        body, ring = self._robot.body, self._robot.ring
        if self._ranges >= RANGES_MIN and self._far > FAR_SHARE * self._ranges:
            return (
                f"{100 * self._far / self._ranges:.0f} % of the ranges are beyond ring.range_max_m "
                f"{ring.range_max_m:g}, the greatest is {self._highest:g}: "
                f"ranges are in metres{_remedy(self._highest, ring.range_max_m)}"
            )
        moves = np.array(self._moves).reshape(-1, 3)
        speed = float(np.median(moves[:, 0])) if len(moves) >= STEPS_MIN else 0.0
        if speed > FAST_FACTOR * body.speed_max_m_s:
            return (
                f"x and y move at {speed:.3g} m/s, and this robot's body.speed_max_m_s is {body.speed_max_m_s:g}: "
                f"positions are in metres and t in seconds{_of_thousandths(speed, '--length-unit mm')}"
            )
        if self.count > 1 and (period := self._period()) > PERIOD_MAX_S:
            return f"the firings are {period:.3g} s apart: t is in seconds{_of_thousandths(period, '--time-unit ms')}"
        distinct = moves[np.abs(moves[:, 1] - moves[:, 2]) > DISTINCT, 1:]
        along, along_degrees = np.median(distinct, axis=0).tolist() if len(distinct) >= STEPS_MIN else (1.0, 0.0)
        if along < AGAINST_MAX and along_degrees > ALONG_MIN:
            return (
                "the robot moves along theta only if theta is in degrees: it is in radians, counter-clockwise; "
                "say --angle-unit deg"
            )
        rate = float(np.median(self._turns)) if len(self._turns) >= STEPS_MIN else 0.0
        if rate > TURN_FACTOR * body.turn_max_rad_s:
            return (
                f"theta turns at {rate:.3g} rad/s, and this robot's body.turn_max_rad_s is {body.turn_max_rad_s:g}: "
                "theta is in radians; say --angle-unit deg where it is in degrees"
            )
        return None

    def warning(self) -> str | None:
        """Return what is suspicious in a log that can be in the right units, None if nothing is."""
        share = self._ceiling / self._ranges if self._ranges else 0.0
        if self._ranges < RANGES_MIN or share < CEILING_SHARE:
            return None
        return (
            f"{100 * share:.0f} % of the ranges are exactly {self._highest:g}: where that stands for no echo, "
            f"say --silence {self._highest:.10g}; as a range it is taken for a wall all around"
        )

    def _add_step(self, last: Firing, firing: Firing) -> None:
        dt = firing.robot_s - last.robot_s
        dx, dy = firing.pose.x - last.pose.x, firing.pose.y - last.pose.y
        moved, turned = math.hypot(dx, dy), abs(firing.pose.theta - last.pose.theta)
        if dt <= 0.0:
            return
        if moved > MOVED_MIN_M:
            direction, theta = math.atan2(dy, dx), last.pose.theta
            in_degrees = abs(math.cos(direction - math.radians(theta)))
            self._moves.append((moved / dt, abs(math.cos(direction - theta)), in_degrees))
        if turned > 1e-6:
            self._turns.append(turned / dt)

    def _period(self) -> float:
        return 0.0 if self._last is None else (self._last.robot_s - self._first_t) / (self.count - 1)


def plausible_firings(
    firings: Iterable[Firing], path: Path, robot: RobotConfig, warn: Callable[[str], None] = lambda _: None
) -> Iterator[Firing]:
    """Yield the firings of a log, once enough of them have been found plausible.

    Parameters
    ----------
    firings : iterable of Firing
        In order of time.
    path : Path
        Of the log, for messages.
    robot : RobotConfig
        The robot that the log is said to be of.
    warn : callable
        Gets what is suspicious, at the end.

    Raises
    ------
    RingLogError
        The log cannot be in metres, radians and seconds.
    """
    units, held = RingLogUnits(robot), deque[Firing]()
    due = FIRST
    for firing in firings:
        units.add(firing)
        held.append(firing)
        if units.count == due:
            _refuse(units, path)
            due *= 2
        if units.count >= FIRST:
            while held:
                yield held.popleft()
    _refuse(units, path)
    yield from held
    warning = units.warning()
    if warning is not None:
        warn(f"{path}: {warning}")


def _refuse(units: RingLogUnits, path: Path) -> None:
    problem = units.problem()
    if problem is not None:
        raise RingLogError(f"{path}: {problem}; or name the robot file of the robot that recorded the log")


def _remedy(highest: float, most_m: float) -> str:
    """Return the remedy for a greatest range that would be within the ring's in another unit."""
    unit = next((unit for unit in ("ft", "in", "cm", "mm") if LENGTHS[unit] * highest <= 1.2 * most_m), None)
    return "" if unit is None else f"; say --range-unit {unit} if they are in {unit}"


def _of_thousandths(value: float, option: str) -> str:
    """Return the remedy for a number that is a thousand times too large."""
    return f"; say {option} if they are in thousandths" if value > 100.0 else ""
