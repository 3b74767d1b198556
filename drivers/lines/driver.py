"""The host's end of a robot that speaks lines and answers nothing: fulfils `drivers.driver.RobotDriver`.

It is READY with the first sample of the odometry. What such a robot cannot do, the driver does: it keeps the latch of
a halt, and repeats a standstill until the odometry shows it, also on the next line.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import Final

import numpy as np

from config.robot import RingConfig, RobotConfig
from drivers import line_diagnostics
from drivers.driver import LineState, Received
from drivers.firing_pattern import firing_pattern
from drivers.lines.wire import NOISE, LineReader, Ranges, Sample, Wire
from drivers.messages import Firing, Flags, Identity, LinkCounts, Odometry, Pose, Twist
from drivers.odometry_history import OdometryHistory
from drivers.odometry_jumps import OdometryJumps

KEPT_MAX: Final = 1024
"""Firings kept if they are not taken; the oldest are dropped."""
STILL: Final = Twist(0.0, 0.0)


class LineDriver:
    """The driver.

    Parameters
    ----------
    config
        The robot file.
    wire
        The robot's lines.
    """

    line_baud: int | None = None
    battery_v: float | None = None

    def __init__(self, config: RobotConfig, wire: Wire) -> None:
        self._config, self._wire = config, wire
        self._pattern = firing_pattern(config.ring)
        self.state = LineState.CLOSED
        self.problem: str | None = None
        self.identity: Identity | None = None
        self.counts = LinkCounts()
        self._reader, self._is_first_line = LineReader(), True
        self._run_s = self._opened_s = self._heard_s = 0.0
        self._is_latched, self._asks_still, self._asks_pattern = True, False, False
        self._still_s = -math.inf
        self._twist: Twist | None = None
        self._boots = 0
        self._history, self._jumps = OdometryHistory(64), OdometryJumps(config.body)
        self._waiting: deque[tuple[float, Ranges]] = deque(maxlen=KEPT_MAX)
        self._firings: deque[Firing] = deque(maxlen=KEPT_MAX)
        self._notes: deque[str] = deque(maxlen=16)
        self._odometry: Odometry | None = None
        self._flags, self._rebooted, self._fired_s = Flags.NONE, False, -math.inf

    @property
    def odometry_origin(self) -> Pose:
        """As of `drivers.driver.RobotDriver`, and so on for the others."""
        return self._jumps.origin

    @property
    def firings_waiting(self) -> int:
        """Number of firings that `take_received` would return."""
        return len(self._firings)

    def take_received(self) -> Received:
        """Return what was received since the last call, and remove it."""
        received = Received(tuple(self._firings), self._odometry, self._rebooted, tuple(self._notes), self._flags)
        self._firings.clear()
        self._notes.clear()
        self._odometry, self._rebooted, self._flags = None, False, Flags.NONE
        return received

    def line_opened(self, run_s: float) -> None:
        """Set the pattern, and let a base that is latched stand, at once."""
        self.line_closed()
        self._run_s = self._opened_s = self._heard_s = run_s
        self.state, self.problem = LineState.HANDSHAKE, None
        self._asks_still, self._asks_pattern = self._is_latched, True

    def line_closed(self) -> None:
        """Forget what was asked; a latch stays."""
        self.state, self._twist = LineState.CLOSED, None
        self._reader, self._is_first_line, self._still_s = LineReader(), True, -math.inf
        self._waiting.clear()

    def receive(self, data: bytes, run_s: float) -> None:
        """Take bytes from the line, split anywhere."""
        self._run_s = run_s
        if self.state is LineState.CLOSED:
            return
        for line in self._reader.feed(data):
            try:
                said = self._wire.read(line)
                self._take(said)
            except NOISE:  # the rest of a line, or noise
                bad = self.counts.bad + (not self._is_first_line)
                self.counts = replace(self.counts, bad=bad)
            else:
                self.counts = replace(self.counts, frames=self.counts.frames + 1)
            self._is_first_line = False

    def tick(self, run_s: float) -> None:
        """Go DOWN if the robot is silent for too long."""
        self._run_s, link = run_s, self._config.link
        silent_s = run_s - self._heard_s
        if self.state is LineState.READY and silent_s > link.silence_max_s:
            self.state, self.problem = LineState.DOWN, line_diagnostics.silence(silent_s, others=False, bad=0)
        elif self.state is LineState.HANDSHAKE and silent_s > link.answer_max_s:
            text = "no line of the robot can be read; check its power, its cable, link.port and link.baud"
            self.state, self.problem = LineState.DOWN, text

    def drive(self, twist: Twist) -> None:
        """Request a velocity; dropped unless the robot is READY and not latched."""
        if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
            raise ValueError(f"cannot drive at {twist}: a velocity must be finite")
        if self.state is LineState.READY and not self._is_latched:
            self._twist = twist

    def halt(self) -> None:
        """Stop the robot at once, and drop velocities until `release`."""
        self._twist, self._is_latched, self._asks_still, self._still_s = None, True, True, -math.inf

    def release(self) -> None:
        """Let velocities be obeyed again."""
        if self.state is LineState.READY:
            self._is_latched = self._asks_still = False

    def set_firing(self, ring: RingConfig) -> None:
        """Change the firing pattern."""
        pattern = firing_pattern(ring)
        self._asks_pattern |= pattern != self._pattern
        self._pattern = pattern

    def end_session(self) -> None:
        """There is no session."""

    def outgoing(self, *, writable: bool) -> bytes:
        """Return the bytes to send now: a standstill before all else, and nothing else on a line that is full."""
        if self.state is LineState.CLOSED:
            return b""
        data = b""
        if self._asks_still and self._run_s - self._still_s >= self._config.link.reply_timeout_s:
            data, self._still_s = self._wire.velocity(STILL), self._run_s
        if not writable:
            return data
        if self._asks_pattern:
            data, self._asks_pattern = data + self._wire.pattern(self._pattern), False
        if self._twist is not None:
            body, twist, self._twist = self._config.body, self._twist, None
            v = max(-body.speed_max_m_s, min(body.speed_max_m_s, twist.v))
            w = max(-body.turn_max_rad_s, min(body.turn_max_rad_s, twist.w))
            data += self._wire.velocity(Twist(v, w))
        return data

    def _take(self, said: Sample | Ranges) -> None:
        robot_s = self._run_s if said.robot_s is None else said.robot_s
        if isinstance(said, Sample):
            self._moved(said, robot_s)
        elif self.state is LineState.READY:
            if not all(0 <= sensor < self._config.ring.sensor_count for sensor in said.ranges_m):
                raise ValueError("no such sensor")
            self._waiting.append((robot_s, said))

    def _moved(self, said: Sample, robot_s: float) -> None:
        numbers = (robot_s, said.pose.x, said.pose.y, said.pose.theta, said.twist.v, said.twist.w)
        if not all(math.isfinite(number) for number in numbers):
            raise ValueError("no finite number")
        newest = self._history.newest
        if newest is not None and robot_s < newest.robot_s:
            self._restarted()
        elif newest is not None and robot_s == newest.robot_s:
            return
        if self.state is not LineState.READY:
            self._meet()
        latched = Flags.LATCHED if self._is_latched else Flags.NONE
        flags = said.flags | latched
        sample = Odometry(robot_s, said.pose, said.pose.theta, said.twist, flags, 0)
        self._odometry, note = self._jumps.remove(sample)
        self._notes += [] if note is None else [note]
        self._flags |= flags
        self._history.add(self._odometry)
        self._heard_s = self._run_s
        if said.twist == STILL and self._run_s > self._still_s:
            self._asks_still = False
        while self._waiting and self._waiting[0][0] <= robot_s:
            self._fired(*self._waiting.popleft())

    def _meet(self) -> None:
        """Take the robot as READY; it names itself by its robot file, and has the deadman of its lines."""
        link, wire, mounts = self._config.link, self._wire, self._config.ring.mounts
        deadman_s = link.deadman_max_s if wire.deadman_s is None else wire.deadman_s
        wrong = line_diagnostics.deadman_refused(wire.name, deadman_s, link)
        if wrong is not None:
            self.state, self.problem = LineState.DOWN, wrong
            return
        radius_m = max(math.hypot(mount.x_m, mount.y_m) for mount in mounts)
        self.identity = Identity(
            wire.name, self._config.ring.sensor_count, radius_m, deadman_s, wire.period_s, self._boots
        )
        self.state, self.problem, self._asks_pattern = LineState.READY, None, True

    def _restarted(self) -> None:
        self._boots += 1
        self.state = LineState.HANDSHAKE
        self._history.clear()
        self._jumps.restart()
        self._firings.clear()
        self._waiting.clear()
        self._odometry, self._flags, self._rebooted, self._fired_s = None, Flags.NONE, True, -math.inf

    def _fired(self, robot_s: float, said: Ranges) -> None:
        """Give a firing its pose: between two samples of the odometry, which come before and after it."""
        where = self._history.at(robot_s, 4.0 * self._wire.period_s + self._config.link.silence_max_s)
        if where is None or robot_s <= self._fired_s:
            return
        ranges = np.full(self._config.ring.sensor_count, math.nan)
        for sensor, range_m in said.ranges_m.items():
            ranges[sensor] = range_m
        self._firings.append(Firing(robot_s, *where, ranges))
        self._fired_s = robot_s
