"""Odometry and echoes to stamped firings: each firing gets the pose of its own moment, not of its arrival.

An echo arrives when its window has closed, most often after the odometry that follows its firing, now and then
before; then it is held until that odometry is there.
"""

from __future__ import annotations

import math
from collections import deque

from drivers.denning.clock import Jump, RobotClock
from drivers.denning.frames import Echo, Odom
from drivers.denning.wire import odometry_of, ranges_of
from drivers.history import OdometryHistory
from drivers.messages import Firing, Odometry

_HISTORY_S = 2.5
_HISTORY_MIN, _HISTORY_MAX = 64, 4096
_HELD_MAX = 64
_GAP_PERIODS = 4.5
"""Three odometry samples lost in a row can be bridged; with more missing, an arc between two samples is a guess."""
_GAP_MIN_S = 0.01
_FUTURE_MAX_US = 1_000_000
_POSE_JUMP_M = 0.5
_POSE_JUMP_M_S = 20.0
"""A base that moved farther than this allows did not move: its odometry was reset."""


class Stamper:
    """The odometry's history and the echoes that wait for it.

    Attributes
    ----------
    late_echoes
        Firings dropped because no odometry tells where they took place.
    """

    def __init__(self, sensors: int) -> None:
        self.late_echoes = 0
        self._sensors = sensors
        self._clock = RobotClock()
        self._history = OdometryHistory(_HISTORY_MIN)
        self._gap_max_s = _GAP_MIN_S
        self._held: deque[Echo] = deque()
        self._last_firing_us: int | None = None

    def set_period(self, period_s: float) -> None:
        """Make room for the history of a robot whose odometry comes every `period_s`."""
        capacity = math.ceil(_HISTORY_S / max(period_s, 1e-3)) + 1
        self._history = OdometryHistory(min(max(capacity, _HISTORY_MIN), _HISTORY_MAX))
        self._gap_max_s = max(_GAP_PERIODS * period_s, _GAP_MIN_S)

    def restart(self) -> None:
        """Forget everything: the robot's clock and odometry began again at zero."""
        self._clock.restart()
        self._last_firing_us = None
        self.break_off()

    def break_off(self) -> None:
        """Forget poses and held echoes, but not the clock: what follows does not join on to what was before."""
        self._history.clear()
        self._clock.trust_next()
        self.drop_held()

    def drop_held(self) -> None:
        """Give up the echoes that wait."""
        self.late_echoes += len(self._held)
        self._held.clear()

    def odometry(self, odom: Odom, now_s: float) -> Odometry | Jump:
        """Take an odometry frame; a jump is reported, and the frame not used."""
        t_us = self._clock.read(odom.t_us, now_s)
        if isinstance(t_us, Jump):
            return t_us
        sample = odometry_of(odom, t_us)
        newest = self._history.newest
        if newest is not None:
            moved_m = math.hypot(sample.pose.x - newest.pose.x, sample.pose.y - newest.pose.y)
            if moved_m > _POSE_JUMP_M + _POSE_JUMP_M_S * (sample.t_s - newest.t_s):
                return Jump.AHEAD
        self._history.add(sample)
        return sample

    def echo(self, echo: Echo) -> None:
        """Take an echo frame; `firings` has it as soon as its pose is known."""
        if len(self._held) >= _HELD_MAX:
            self._held.popleft()
            self.late_echoes += 1
        self._held.append(echo)

    def firings(self) -> list[Firing]:
        """Return and forget the held echoes whose pose is known now, in the order of their firing."""
        ready: list[Firing] = []
        newest = self._history.newest
        while self._held and newest is not None:
            t_us = self._clock.past(self._held[0].t_us)
            if t_us is None:
                break
            ahead_us = t_us - round(newest.t_s * 1e6)
            if 0 < ahead_us <= _FUTURE_MAX_US:
                break
            echo = self._held.popleft()
            place = self._history.at(t_us * 1e-6, self._gap_max_s)
            # Times never decrease for those above; a firing from before the last one is not news any more.
            if place is None or (self._last_firing_us is not None and t_us < self._last_firing_us):
                self.late_echoes += 1
                continue
            self._last_firing_us = t_us
            pose, ring_yaw = place
            ready.append(Firing(t_us * 1e-6, pose, ring_yaw, ranges_of(echo, self._sensors)))
        return ready
