"""Firings from echoes and odometry: each firing gets the pose at which it was fired, not that of its arrival.

An echo arrives when its window has closed. Usually the odometry after its firing has arrived by then; if not, the
echo waits for it.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from config.robot import BodyConfig, RingConfig
from drivers.denning import diagnostics
from drivers.denning.frames import TENTH_FT_M, WINDOW_MAX, Echo, Echo2, Echo3, Odom
from drivers.denning.wire_units import cross_paths_of, odometry_of, ranges_of
from drivers.dropped_count import RANGES_BEYOND, DroppedCount, MaximumBeyond
from drivers.messages import CrossPaths, Firing, Floats, Odometry
from drivers.odometry_history import OdometryHistory
from drivers.robot_clock import Jump, RobotClock
from drivers.servo_views import ServoViews
from drivers.stamper import Stamper

_HISTORY_S = 2.5
"""Odometry kept, s: several times the longest window and its way over a busy line."""
_HISTORY_MIN, _HISTORY_MAX = 64, 4096
"""Fewest and most samples kept, whatever period the robot reports."""
_HELD_MAX = 64
"""Echoes that may wait for their odometry; the oldest are dropped."""
_GAP_PERIODS = 4.5
"""Longest gap between two samples to interpolate over, in odometry periods: three lost samples. With more missing,
the arc between two samples is a guess."""
_GAP_MIN_S = 0.01
"""The same limit, at least, s."""
_FUTURE_MAX_US = 1_000_000
"""How far after the newest odometry an echo may have been fired to wait for more, µs; beyond, its time is corrupt."""


class PoseStamper(Stamper):
    """Gives each firing its pose, from the history of the odometry."""

    def __init__(self, ring: RingConfig, body: BodyConfig) -> None:
        super().__init__(body)
        self.out_of_window = DroppedCount(RANGES_BEYOND, self.note)
        """Ranges and cross paths dropped because they lie beyond the window of their firing."""
        self._maximum = MaximumBeyond(self.note)
        self._axes = tuple(mount.angle_rad for mount in ring.mounts)
        self._views = ServoViews(ring)
        self._clock = RobotClock()
        self._history = OdometryHistory(_HISTORY_MIN)
        self._gap_max_s = _GAP_MIN_S
        """Longest gap between samples in which the pose of a firing counts as known."""
        self._held: deque[tuple[int, Floats, CrossPaths | None]] = deque()
        """Firings whose pose is not known yet: time by the robot, µs, ranges, cross paths."""
        self._last_firing_us: int | None = None
        """Time of the last one that was passed on; None before."""
        self._window = WINDOW_MAX
        self._step_period_ms: int | None = None

    def set_pattern(self, window: int, step_period_ms: int) -> None:
        """Set what the firing pattern allows: the longest range (tenths of a foot) and the time between firings.

        More is dropped.
        """
        self._window = window
        if step_period_ms != self._step_period_ms:
            self._step_period_ms = step_period_ms
            self._limit_firings(1e-3 * step_period_ms)

    @property
    def jumps(self) -> int:
        """Number of jumps of the odometry that were removed."""
        return self._jumps.count

    @property
    def clock_error(self) -> float | None:
        """Relative error of the robot's clock, as found by the last odometry; None if nothing was found."""
        return self._clock.rate_error

    def set_period(self, period_s: float) -> None:
        """Size the history for a robot that sends odometry every `period_s`."""
        capacity = math.ceil(_HISTORY_S / max(period_s, 1e-3)) + 1
        self._history = OdometryHistory(min(max(capacity, _HISTORY_MIN), _HISTORY_MAX))
        self._gap_max_s = max(_GAP_PERIODS * period_s, _GAP_MIN_S)

    def restart(self) -> None:
        """Discard all state: the robot's clock and odometry restarted at zero."""
        self._clock.restart()
        self._last_firing_us = None
        self._jumps.restart()
        self.break_off()

    def break_off(self) -> None:
        """Discard poses and waiting echoes, but not the clock: later odometry does not continue the earlier one."""
        self._history.clear()
        self._clock.trust_next()
        self.drop_held()

    def drop_held(self) -> None:
        """Drop the echoes that wait for odometry: the line or the robot's clock may be another from now on."""
        self._clock.break_off()
        self.late_echoes.add(len(self._held))
        self._held.clear()

    def odometry(self, odom: Odom, run_s: float) -> Odometry | Jump:
        """Return the sample of an odometry frame received at `run_s`; or a `Jump`, and then the frame is not used.

        A clock that is too slow is noted for the operator.
        """
        t_us = self._clock.read(odom.t_us, run_s)
        if isinstance(t_us, Jump):
            return t_us
        if self._clock.rate_error is not None and self._clock.rate_error < 0.0:
            # No reason to stop: objects seem nearer than they are, and an emulator on a busy machine is slow as well.
            self.note(diagnostics.wrong_clock_rate(self._clock.rate_error))
        reported = odometry_of(odom, t_us)
        if len(self._history) and self._jumps.is_reset(reported):
            return Jump.AHEAD
        sample = self._without_jump(reported)
        self._history.add(sample)
        return sample

    def echo(self, echo: Echo | Echo2 | Echo3, unit_m: float = TENTH_FT_M) -> None:
        """Take an echo frame, whose counts are of `unit_m`; `firings` returns it as soon as its pose is known.

        A range beyond the window belongs to an earlier firing or is noise, and is treated like a sensor's fault,
        unless sensors report it in place of silence.
        """
        ranges, heard = ranges_of(echo, self._views, unit_m), cross_paths_of(echo, self._axes, unit_m)
        slack_m = 0.0 if isinstance(echo, Echo) else unit_m  # a range at the window's end is rounded to a count
        window_m = self._window * TENTH_FT_M + slack_m
        beyond = [sensor for sensor, range_m in enumerate(ranges.tolist()) if window_m < range_m < math.inf]
        for sensor in beyond:
            if self._maximum.is_silence(sensor, float(ranges[sensor]), unit_m):
                ranges[sensor] = math.inf
            else:
                self.out_of_window.add()
                ranges[sensor] = math.nan
        if heard is not None:
            heard = self._within(heard, window_m)
        if len(self._held) >= _HELD_MAX:
            self._held.popleft()
            self.late_echoes.add()
        self._held.append((echo.t_us, ranges, heard))

    def firings(self, run_s: float) -> list[Firing]:
        """Return the waiting echoes whose pose is known at `run_s`, in the order of their firing; remove them."""
        ready: list[Firing] = []
        if not self._held:
            return ready
        newest = self._history.newest
        while self._held and newest is not None:
            t_us = self._clock.near_last(self._held[0][0])
            if t_us is None:
                break
            ahead_us = t_us - round(newest.robot_s * 1e6)
            if 0 < ahead_us <= _FUTURE_MAX_US:
                break
            _, ranges, heard = self._held.popleft()
            # Times passed on only grow: this drops firings older than the last one, and copies of it.
            if self._last_firing_us is not None and t_us <= self._last_firing_us:
                self.late_echoes.add()
                continue
            if self._is_excess(run_s):
                continue
            place = self._history.at(t_us * 1e-6, self._gap_max_s)
            if place is None:
                self.late_echoes.add()
                continue
            self._last_firing_us = t_us
            pose, ring_yaw = place
            ready.append(Firing(t_us * 1e-6, pose, ring_yaw, ranges, heard))
        return ready

    def _within(self, heard: CrossPaths, window_m: float) -> CrossPaths | None:
        """Return the cross paths without those beyond the window; None if none is left."""
        beyond = np.isfinite(heard.half_paths_m) & (heard.half_paths_m > window_m)
        if not beyond.any():
            return heard
        self.out_of_window.add(int(np.count_nonzero(beyond)))
        if beyond.all():
            return None
        kept = ~beyond
        return CrossPaths(heard.transmitters[kept], heard.listeners[kept], heard.half_paths_m[kept])
