"""The host's end of a robot that speaks lines and answers nothing: fulfils `drivers.driver.RobotDriver`.

It is READY with the first sample of the odometry. What such a robot cannot do, the driver does: it keeps the latch of
a halt, and repeats a standstill until the odometry shows it, also on the next line.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from config.robot import RingConfig, RobotConfig
from drivers import line_diagnostics
from drivers.driver import LineState
from drivers.firing_pattern import firing_pattern
from drivers.lines.pose_stamping import LineStamper
from drivers.lines.wire import NOISE, LineReader, Ranges, Sample, Wire
from drivers.messages import Flags, Identity, LinkCounts, Odometry, Twist
from drivers.session import Session

STILL: Final = Twist(0.0, 0.0)


class LineDriver(Session[LineStamper]):
    """A `drivers.driver.RobotDriver` for robots that speak lines.

    A new driver is latched: a robot that is found stands until `release`.
    """

    def __init__(self, config: RobotConfig, wire: Wire) -> None:
        super().__init__(LineStamper(config, wire.period_s), config.link.silence_max_s)
        self._config, self._wire = config, wire
        self._pattern = firing_pattern(config.ring)
        self.stamper.set_pattern(self._pattern)
        self._reader = LineReader()
        self._is_first_line = True
        """The next line is the first: it may be the rest of a cut one, which is not counted as bad."""
        self._counts = LinkCounts()
        """Of this line."""
        self._heard_s = 0.0
        """When the last sample of the odometry came, or the line was opened."""
        self._bad_at_sample = 0
        """Bad lines before that sample."""
        self._is_latched = True
        self._asks_still = False
        """Whether a standstill is sent, again and again until the odometry shows it."""
        self._still_s = -math.inf
        """When it was last sent."""
        self._asks_pattern = False
        """Whether the firing pattern is still to be sent."""
        self._boots = 0

    @property
    def _line_counts(self) -> LinkCounts:
        return self._counts

    def line_opened(self, run_s: float) -> None:
        """Set the pattern, and let a base that is latched stand, at once."""
        super().line_opened(run_s)
        self._heard_s = run_s
        self._state, self._problem = LineState.HANDSHAKE, None
        self._asks_still, self._asks_pattern = self._is_latched, True

    def line_closed(self) -> None:
        """Forget what was asked; a latch stays."""
        self._earlier_counts, self._counts, self._bad_at_sample = self.counts, LinkCounts(), 0
        self._state, self._drive = LineState.CLOSED, None
        self._reader, self._is_first_line, self._still_s = LineReader(), True, -math.inf
        self.stamper.break_off()

    def receive(self, data: bytes, run_s: float) -> None:
        """Take bytes from the line, split anywhere."""
        self._run_s = run_s
        if self._state is LineState.CLOSED:
            return
        for line in self._reader.feed(data):
            try:
                said = self._wire.read(line)
                self._take(said)
            except NOISE:  # the rest of a line, or noise
                self._counts = replace(self._counts, bad=self._counts.bad + (not self._is_first_line))
            else:
                self._counts = replace(self._counts, frames=self._counts.frames + 1)
            self._is_first_line = False

    def tick(self, run_s: float) -> None:
        """Go DOWN if the robot is silent for too long."""
        self._run_s, link = run_s, self._config.link
        silent_s = run_s - self._heard_s
        if self._state is LineState.READY and silent_s > link.silence_max_s:
            bad = self._counts.bad - self._bad_at_sample
            self._state, self._problem = LineState.DOWN, line_diagnostics.silence(silent_s, others=False, bad=bad)
        elif self._state is LineState.HANDSHAKE and silent_s > link.answer_max_s:
            text = "no line of the robot can be read; check its power, its cable, link.port and link.baud"
            self._state, self._problem = LineState.DOWN, text

    def halt(self) -> None:
        """Stop the robot at once, and drop velocities until `release`."""
        self._drive, self._is_latched, self._asks_still, self._still_s = None, True, True, -math.inf

    def release(self) -> None:
        """Let velocities be obeyed again."""
        if self._state is LineState.READY:
            self._is_latched = self._asks_still = False

    def set_firing(self, ring: RingConfig) -> None:
        """Change the firing pattern, if it is another one.

        Raises
        ------
        drivers.firing_pattern.FiringError
            The ring cannot fire that way.
        """
        pattern = firing_pattern(ring)
        if pattern != self._pattern:
            self._pattern, self._asks_pattern = pattern, True
            self.stamper.set_pattern(pattern)

    def end_session(self) -> None:
        """Do nothing: this protocol has no end of a session."""

    def outgoing(self, *, writable: bool) -> bytes:
        """Return the bytes to send now, and consider them sent: a standstill first; on a full line, nothing else."""
        if self._state is LineState.CLOSED:
            self._drive = None
            return b""
        data = b""
        if self._asks_still and self._run_s - self._still_s >= self._config.link.reply_timeout_s:
            data, self._still_s = self._wire.velocity(STILL), self._run_s
        if not writable:
            return data
        if self._asks_pattern:
            data, self._asks_pattern = data + self._wire.pattern(self._pattern), False
        twist, self._drive = self._drive, None
        if twist is not None and self._state is LineState.READY and not self._is_latched:
            body = self._config.body
            v = max(-body.speed_max_m_s, min(body.speed_max_m_s, twist.v))
            w = max(-body.turn_max_rad_s, min(body.turn_max_rad_s, twist.w))
            data += self._wire.velocity(Twist(v, w))
        return data

    def _take(self, said: Sample | Ranges) -> None:
        """Take in a line; one without the robot's time counts as of now. Raises a `NOISE` error if it is none."""
        robot_s = self._run_s if said.robot_s is None else said.robot_s
        if isinstance(said, Sample):
            self._moved(said, robot_s)
        elif self._state is LineState.READY:
            self.stamper.fired(robot_s, said)

    def _moved(self, said: Sample, robot_s: float) -> None:
        """Take in a sample of the odometry: the first makes the line READY; one with an earlier time is a restart.

        Raises
        ------
        ValueError
            A number is not finite.
        """
        numbers = (robot_s, said.pose.x, said.pose.y, said.pose.theta, said.twist.v, said.twist.w)
        if not all(math.isfinite(number) for number in numbers):
            raise ValueError("no finite number")
        if robot_s < self.stamper.newest_s:
            self._boots += 1
            self._state = LineState.HANDSHAKE
            self.stamper.restart()
            self._forget_received()
        elif robot_s == self.stamper.newest_s:
            return
        if self._state is not LineState.READY:
            self._meet()
        flags = said.flags | (Flags.LATCHED if self._is_latched else Flags.NONE)
        sample = Odometry(robot_s, said.pose, said.pose.theta, said.twist, flags, 0)
        self._odometry, firings = self.stamper.moved(sample, self._run_s)
        self._firings += firings
        self._flags |= flags
        self._heard_s, self._bad_at_sample = self._run_s, self._counts.bad
        if said.twist == STILL and self._run_s > self._still_s:
            self._asks_still = False

    def _meet(self) -> None:
        """Make the line READY, with the identity of the robot file; DOWN if its deadman is beyond the limits."""
        link, wire, mounts = self._config.link, self._wire, self._config.ring.mounts
        deadman_s = link.deadman_max_s if wire.deadman_s is None else wire.deadman_s
        wrong = line_diagnostics.deadman_refused(wire.name, deadman_s, link)
        if wrong is not None:
            self._state, self._problem = LineState.DOWN, wrong
            return
        radius_m = max(math.hypot(mount.x_m, mount.y_m) for mount in mounts)
        self._identity = Identity(
            wire.name, self._config.ring.sensor_count, radius_m, deadman_s, wire.period_s, self._boots
        )
        self._state, self._problem, self._asks_pattern = LineState.READY, None, True
