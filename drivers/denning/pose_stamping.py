"""Odometry and echoes to stamped firings: each firing gets the pose of its own moment, not of its arrival.

An echo arrives when its window has closed, most often after the odometry that follows its firing, now and then
before; then it is held until that odometry is there.

Odometry that leaps farther than the wheels could have turned tells of a counter that was set or slipped, not of a
body that moved. The leap is taken out, here where every sample passes, so that poses go on without a break and
whatever is remembered in their frame stays where it is: see `frame`.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

from config.robot import BodyConfig
from drivers import se2
from drivers.denning import diagnostics
from drivers.denning.frames import FAULT, NO_ECHO, WINDOW_MAX, Echo, Odom
from drivers.denning.robot_clock import Jump, RobotClock
from drivers.denning.wire_units import odometry_of, ranges_of
from drivers.messages import Firing, Odometry, Pose, wrap_angle
from drivers.odometry_history import OdometryHistory

_HISTORY_S = 2.5
_HISTORY_MIN, _HISTORY_MAX = 64, 4096
_HELD_MAX = 64
_GAP_PERIODS = 4.5
"""Three odometry samples lost in a row can be bridged; with more missing, an arc between two samples is a guess."""
_GAP_MIN_S = 0.01
_FUTURE_MAX_US = 1_000_000
_POSE_JUMP_M = 0.5
_POSE_JUMP_M_S = 20.0
"""A base that moved farther than this allows did not move: its odometry was reset, perhaps all of it was."""
_LEAP_M, _LEAP_RAD = 0.1, 0.1
"""What odometry may differ from what its own velocities say, besides what a stop within one sample explains."""
_STEADY = 10
"""Only after so many samples that did not leap is one that does a leap; else it is how this base moves."""
_HERE = Pose(0.0, 0.0, 0.0)
_NOTES_MAX = 16


class PoseStamper:
    """The odometry's history and the echoes that wait for it.

    Parameters
    ----------
    sensors
        Of the ring.
    body
        Its limits say what is a motion and what a leap.

    Attributes
    ----------
    late_echoes
        Firings dropped: no odometry tells where they took place, or they came twice, or after a newer one.
    out_of_window
        Ranges dropped that lie beyond the window their firing listened for.
    jumps
        Leaps of the odometry that were taken out.
    frame
        The origin of the poses given out, in the robot's own odometry; the identity while that has not leapt.
    """

    def __init__(self, sensors: int, body: BodyConfig) -> None:
        self.late_echoes = 0
        self.out_of_window = 0
        self.jumps = 0
        self.origin = _HERE
        self._sensors = sensors
        self._body = body
        self._clock = RobotClock()
        self._history = OdometryHistory(_HISTORY_MIN)
        self._gap_max_s = _GAP_MIN_S
        self._held: deque[Echo] = deque()
        self._last_firing_us: int | None = None
        self._last: Odometry | None = None
        self._steady = 0
        self._ring_offset = 0.0
        self._window = WINDOW_MAX
        self._notes: deque[str] = deque(maxlen=_NOTES_MAX)

    def set_window(self, tenths_ft: int) -> None:
        """Hold echoes from now on to a window."""
        self._window = tenths_ft

    def notes(self) -> tuple[str, ...]:
        """Return and forget what an operator should know of the odometry."""
        notes = tuple(self._notes)
        self._notes.clear()
        return notes

    def set_period(self, period_s: float) -> None:
        """Make room for the history of a robot whose odometry comes every `period_s`."""
        capacity = math.ceil(_HISTORY_S / max(period_s, 1e-3)) + 1
        self._history = OdometryHistory(min(max(capacity, _HISTORY_MIN), _HISTORY_MAX))
        self._gap_max_s = max(_GAP_PERIODS * period_s, _GAP_MIN_S)

    def restart(self) -> None:
        """Forget everything: the robot's clock and odometry began again at zero."""
        self._clock.restart()
        self._last_firing_us = None
        self._last, self._steady = None, 0
        self.origin, self._ring_offset = _HERE, 0.0
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

    def odometry(self, odom: Odom, run_s: float) -> Odometry | Jump:
        """Take an odometry frame; a jump is reported, and the frame not used."""
        t_us = self._clock.read(odom.t_us, run_s)
        if isinstance(t_us, Jump):
            return t_us
        told = odometry_of(odom, t_us)
        sample = self._in_our_frame(told)
        newest = self._history.newest
        if newest is not None:
            moved_m = math.hypot(sample.pose.x - newest.pose.x, sample.pose.y - newest.pose.y)
            if moved_m > _POSE_JUMP_M + _POSE_JUMP_M_S * (sample.robot_s - newest.robot_s):
                return Jump.AHEAD
        sample = self._without_leap(told, sample)
        self._history.add(sample)
        self._last = sample
        return sample

    def _in_our_frame(self, told: Odometry) -> Odometry:
        if self.origin == _HERE and self._ring_offset == 0.0:
            return told
        pose = self.origin.inverse().compose(told.pose)
        return replace(told, pose=pose, ring_yaw=told.ring_yaw + self._ring_offset)

    def _without_leap(self, told: Odometry, sample: Odometry) -> Odometry:
        """Return `sample`, or where the wheels' own speeds would have brought the base if it is nowhere near that."""
        last = self._last
        if last is None:
            return sample
        dt_s = sample.robot_s - last.robot_s
        v, w = 0.5 * (last.twist.v + sample.twist.v), 0.5 * (last.twist.w + sample.twist.w)
        expected = last.pose.compose(se2.exp(v * dt_s, 0.0, w * dt_s))
        ring_yaw = last.ring_yaw if self._body.synchro else last.ring_yaw + w * dt_s
        off_m = math.hypot(sample.pose.x - expected.x, sample.pose.y - expected.y)
        turned = sample.pose.theta - expected.theta
        off_rad = max(abs(turned), abs(sample.ring_yaw - ring_yaw))
        limits = self._body
        if off_m <= _LEAP_M + limits.speed_max_m_s * dt_s and off_rad <= _LEAP_RAD + limits.turn_max_rad_s * dt_s:
            self._steady += 1
            return sample
        steady, self._steady = self._steady, 0
        if steady < _STEADY:
            return sample
        self.jumps += 1
        self._notes.append(
            diagnostics.odometry_jump(off_m, wrap_angle(turned), wrap_angle(sample.ring_yaw - ring_yaw))
        )
        self.origin = told.pose.compose(expected.inverse())
        self._ring_offset = ring_yaw - told.ring_yaw
        return replace(told, pose=expected, ring_yaw=ring_yaw)

    def echo(self, echo: Echo) -> None:
        """Take an echo frame; `firings` has it as soon as its pose is known.

        A range beyond the window is the echo of an earlier firing or of nothing: as good as a fault.
        """
        beyond = sum(self._window < tenths < NO_ECHO for tenths in echo.tenths_ft)
        if beyond:
            self.out_of_window += beyond
            tenths_ft = tuple(FAULT if self._window < tenths < NO_ECHO else tenths for tenths in echo.tenths_ft)
            echo = replace(echo, tenths_ft=tenths_ft)
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
            ahead_us = t_us - round(newest.robot_s * 1e6)
            if 0 < ahead_us <= _FUTURE_MAX_US:
                break
            echo = self._held.popleft()
            place = self._history.at(t_us * 1e-6, self._gap_max_s)
            # Times only grow for those above: a firing from before the last one is no news, one of its time its copy.
            if place is None or (self._last_firing_us is not None and t_us <= self._last_firing_us):
                self.late_echoes += 1
                continue
            self._last_firing_us = t_us
            pose, ring_yaw = place
            ready.append(Firing(t_us * 1e-6, pose, ring_yaw, ranges_of(echo, self._sensors)))
        return ready
