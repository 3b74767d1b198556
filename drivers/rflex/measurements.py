"""Odometry and firings from the controller's reports: counts become poses, and each firing gets its own.

The controller reports each axis in a frame of its own, both with one time. A sonar report comes when its sonars have
listened; its time is that of the report, so that they fired one step before.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

from config.robot import RobotConfig
from drivers import se2
from drivers.messages import Firing, Flags, Floats, Odometry, Pose, Twist
from drivers.odometry_history import OdometryHistory
from drivers.rflex import diagnostics
from drivers.rflex.codec import NO_ECHO, ROTATION, TRANSLATION, AxisReport, SonarReport
from drivers.rflex.wire_units import SonarPattern
from drivers.robot_clock import Jump, RobotClock
from drivers.stamper import Stamper

REPORT_PERIOD_S: Final = 0.05
"""Period of the reports that the driver asks for, s."""
_PAIR_US: Final = 5_000
"""Reports of two axes whose times differ by no more than this belong together."""
_HISTORY: Final = 64
_GAP_S: Final = 4.5 * REPORT_PERIOD_S
"""Longest gap between two samples to interpolate over, s: three lost ones."""
_HELD_MAX: Final = 64
"""Firings that may wait for their odometry."""
_BACK_MAX: Final = 2
"""So many samples in a row from before the last one mean a restart; a single one may be a corrupt frame."""
_AHEAD_MAX: Final = 3
"""After so many samples in a row that are far ahead of the last one, the next is believed."""
_SLACK_M, _SLACK_RAD = 0.2, 0.3
"""A sample farther from the last one than this, and twice the way at full speed, needs a second that agrees: the
checksum lets one of some hundred corrupt frames pass."""
_ZERO_M, _ZERO_RAD = 0.02, 0.03
"""The counts may be so far from zero just after a restart."""


def _difference(now: int, before: int) -> int:
    """Return the shortest way from one reading of a 32-bit counter to another."""
    return (now - before + 0x80000000) % 0x100000000 - 0x80000000


class Measurements(Stamper):
    """Gives samples of the odometry their poses, and firings theirs.

    `ids` has the robot's number of each sensor of the ring.
    """

    # Set by a restart; see `_reset` and `break_off`.
    _last: tuple[int, int, float] | None
    """The last reading: counts of both axes, and time by the robot, s."""
    _pose: Pose
    _fired_s: float
    """Time of the last firing passed on."""
    _axes: dict[int, AxisReport]
    """Reports that wait for the other axis."""
    _suspect: tuple[int, int, float] | None
    """A reading that was impossible after the last one."""
    _backs: int
    """Readings in a row whose clock jumped back."""
    _aheads: int
    """Readings in a row whose clock jumped ahead."""
    _is_new: bool
    """Whether this is the first reading of a line."""

    def __init__(self, config: RobotConfig, ids: tuple[int, ...]) -> None:
        super().__init__(config.body)
        self._config = config
        self._sensors = {one: sensor for sensor, one in enumerate(ids)}
        self._clock = RobotClock()
        self._history = OdometryHistory(_HISTORY)
        self._held: deque[tuple[float, Floats]] = deque(maxlen=_HELD_MAX)
        """Firings whose pose is not known yet: time by the robot, s, and ranges."""
        self._step_s, self._window_m = 0.0, math.inf
        self._is_clock_noted = False
        self._reset()

    def set_pattern(self, pattern: SonarPattern) -> None:
        """Set the firing pattern that the robot carries out."""
        self._step_s, self._window_m = 1e-6 * pattern.step_us, pattern.window_m
        self._limit_firings(self._step_s)

    def break_off(self) -> None:
        """Discard what waits: later reports do not continue the earlier ones."""
        self._axes = {}
        self._suspect = None
        self._backs = self._aheads = 0
        self._is_new = True
        self._held.clear()
        self._history.clear()
        self._clock.break_off()
        self._clock.trust_next()

    def axis(self, report: AxisReport, run_s: float, flags: Flags) -> Odometry | Jump | None:
        """Return the sample that a report completes, or None; `Jump.BACK` if the robot has restarted."""
        self._axes[report.axis] = report
        v, w = self._axes.get(TRANSLATION), self._axes.get(ROTATION)
        if v is None or w is None or abs(_difference(v.t_us, w.t_us)) > _PAIR_US:
            return None
        self._axes = {}
        body, rflex = self._config.body, self._config.rflex
        twist = Twist(v.velocity / rflex.distance_factor, w.velocity / rflex.angle_factor)
        if abs(twist.v) > 2.0 * body.speed_max_m_s + 0.5 or abs(twist.w) > 2.0 * body.turn_max_rad_s + 1.0:
            return None
        t_us = self._read_clock(report.t_us, run_s)
        if not isinstance(t_us, int):
            return t_us
        return self._sample(v.position, w.position, 1e-6 * t_us, twist, flags)

    def _read_clock(self, t_us: int, run_s: float) -> int | Jump | None:
        """Return the unwrapped time of a report, µs; None if it is to be dropped, `Jump.BACK` after a restart.

        A jump ahead is accepted after `_AHEAD_MAX` in a row; one back is a restart after `_BACK_MAX`.
        """
        read = self._clock.read(t_us, run_s)
        self._backs = self._backs + 1 if read is Jump.BACK else 0
        self._aheads = self._aheads + 1 if read is Jump.AHEAD else 0
        if self._aheads >= _AHEAD_MAX:
            self._clock.trust_next()
        if isinstance(read, Jump):
            return self._restarted() if self._backs >= _BACK_MAX else None
        if (error := self._clock.rate_error) is not None and not self._is_clock_noted:
            self._is_clock_noted = True
            self.note(diagnostics.wrong_clock_rate(error))
        return read

    def _sample(self, way: int, turn: int, robot_s: float, twist: Twist, flags: Flags) -> Odometry | Jump | None:
        """Return the sample of two counts at a time, s; None if it is impossible, `Jump.BACK` after a restart.

        A reading is possible if the base can have moved so since the last one, or since one dropped just before.
        """
        here, last = (way, turn, robot_s), self._last
        if last is None:
            last = here
        elif self._is_new and self._is_zero(here) and not self._is_zero(last):
            return self._restarted()
        elif robot_s < last[2]:
            return None
        elif not self._is_possible(last, here):
            suspect, self._suspect = self._suspect, here
            if suspect is None or not self._is_possible(suspect, here):
                return None
        self._is_new, self._last, self._suspect = False, here, None
        moved_m, turned = self._way(last, here)
        self._pose = self._pose.compose(se2.exp(moved_m, 0.0, turned))
        ring_yaw = 0.0 if self._config.body.synchro else self._pose.theta
        sample = self._without_jump(Odometry(robot_s, self._pose, ring_yaw, twist, flags, 0))
        self._history.add(sample)
        return sample

    def sonar(self, report: SonarReport) -> None:
        """Take a report; `firings` returns it as soon as its pose is known."""
        ranges = np.full(len(self._sensors), math.nan)
        for one, raw in report.readings:
            sensor = self._sensors.get(one)
            if sensor is not None and raw > 0:
                range_m = raw / self._config.rflex.range_factor
                ranges[sensor] = range_m if raw < NO_ECHO and range_m <= self._window_m else math.inf
        t_us = self._clock.near_last(report.t_us)
        if t_us is not None and not np.isnan(ranges).all():
            self._held.append((1e-6 * t_us - self._step_s, ranges))

    def firings(self, run_s: float) -> list[Firing]:
        """Return the waiting firings whose pose is known, in the order of their times; remove them."""
        newest, ready = self._history.newest, list[Firing]()
        while self._held and newest is not None:
            fired_s, ranges = self._held[0]
            if newest.robot_s < fired_s < newest.robot_s + 1.0:
                break
            self._held.popleft()
            place = self._history.at(fired_s, _GAP_S)
            if place is None or fired_s <= self._fired_s:
                self.late_echoes.add()
            elif not self._is_excess(run_s):
                self._fired_s = fired_s
                ready.append(Firing(fired_s, *place, ranges))
        return ready

    def _reset(self) -> None:
        """Forget the pose and all readings."""
        self._last = None
        self._pose = Pose(0.0, 0.0, 0.0)
        self._fired_s = -math.inf
        self.break_off()

    def _restarted(self) -> Jump:
        """Begin anew with a robot that has restarted."""
        self._clock.restart()
        self._jumps.restart()
        self._reset()
        return Jump.BACK

    def _way(self, a: tuple[int, int, float], b: tuple[int, int, float]) -> tuple[float, float]:
        """Return way and turn from one reading of the counts to another, m and rad."""
        rflex = self._config.rflex
        return _difference(b[0], a[0]) / rflex.distance_factor, _difference(b[1], a[1]) / rflex.angle_factor

    def _is_possible(self, a: tuple[int, int, float], b: tuple[int, int, float]) -> bool:
        """Return whether the base can have moved from one reading of the counts to another."""
        way_m, turn = self._way(a, b)
        body, dt_s = self._config.body, max(0.0, b[2] - a[2])
        near = abs(way_m) <= _SLACK_M + 2.0 * body.speed_max_m_s * dt_s
        return near and abs(turn) <= _SLACK_RAD + 2.0 * body.turn_max_rad_s * dt_s

    def _is_zero(self, reading: tuple[int, int, float]) -> bool:
        """Return whether the counts are nearly those after a restart."""
        way_m, turn = self._way((0, 0, 0.0), reading)
        return abs(way_m) <= _ZERO_M and abs(turn) <= _ZERO_RAD
