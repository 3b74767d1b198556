"""The host's end of the Chirp: fulfils `drivers.driver.RobotDriver`."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from config.robot import RingConfig, RobotConfig
from drivers import line_diagnostics
from drivers.driver import LineState, Received
from drivers.firing_pattern import FiringPattern, firing_pattern, sensors
from drivers.messages import Firing, Flags, Identity, LinkCounts, Odometry, Pose, Twist
from drivers.odometry_history import OdometryHistory
from drivers.odometry_jumps import OdometryJumps
from tests.drivers.contract.example.lines import LineReader, line

PERIOD_S, DEAF_S = 0.05, 0.3
KEPT_MAX = 1024


class ChirpDriver:
    """A line is READY once the robot has answered HELLO and FIRE; each command is repeated until it is answered."""

    line_baud: int | None = None
    battery_v: float | None = None  # the Chirp reports none

    def __init__(self, config: RobotConfig) -> None:
        self._config = config
        self._pattern = firing_pattern(config.ring)
        self._state = LineState.CLOSED
        self._problem: str | None = None
        self._identity: Identity | None = None
        self._lines, self._earlier = LineReader(), LinkCounts()
        self._run_s = self._heard_s = 0.0
        self._unanswered: dict[str, tuple[float, int]] = {}  # when to send it again, and how often it was sent
        self._twist: Twist | None = None
        self._go, self._go_seen_s = 0, 0.0
        self._history, self._jumps = OdometryHistory(64), OdometryJumps(config.body)
        self._waiting: deque[tuple[float, int, list[int]]] = deque(maxlen=KEPT_MAX)
        self._firings: deque[Firing] = deque(maxlen=KEPT_MAX)
        self._notes: deque[str] = deque(maxlen=16)
        self._odometry: Odometry | None = None
        self._flags, self._rebooted = Flags.NONE, False
        self._fired_s = -math.inf

    # What the runtime looks at.

    @property
    def state(self) -> LineState:
        return self._state

    @property
    def problem(self) -> str | None:
        return self._problem

    @property
    def identity(self) -> Identity | None:
        return self._identity

    @property
    def counts(self) -> LinkCounts:
        return LinkCounts(self._earlier.frames + self._lines.good, self._earlier.bad + self._lines.bad, 0)

    @property
    def odometry_origin(self) -> Pose:
        return self._jumps.origin

    @property
    def firings_waiting(self) -> int:
        return len(self._firings)

    def take_received(self) -> Received:
        received = Received(tuple(self._firings), self._odometry, self._rebooted, tuple(self._notes), self._flags)
        self._firings.clear()
        self._notes.clear()
        self._odometry, self._rebooted, self._flags = None, False, Flags.NONE
        return received

    # The line.

    def line_opened(self, run_s: float) -> None:
        self.line_closed()
        self._run_s = self._heard_s = run_s
        self._greet(LineState.HANDSHAKE, None)

    def line_closed(self) -> None:
        self._earlier, self._lines = self.counts, LineReader()
        self._state, self._twist = LineState.CLOSED, None
        self._unanswered = {word: (0.0, 0) for word in self._unanswered if word == "HALT"}

    def receive(self, data: bytes, run_s: float) -> None:
        self._run_s = run_s
        if self._state is LineState.CLOSED:
            return
        for words in self._lines.feed(data):
            try:
                self._take(words[0], words[1:])
            except (ValueError, IndexError, OverflowError):  # a right checksum and no sense: another version
                self._problem = f"the robot sends {words[:1]} in a form that is not known; update one of the two"

    def tick(self, run_s: float) -> None:
        self._run_s = run_s
        silent_s = run_s - self._heard_s
        if self._state is LineState.READY and silent_s > self._config.link.silence_max_s:
            self._greet(LineState.DOWN, line_diagnostics.silence(silent_s, others=False, bad=0))
        elif self._state is LineState.READY and self._go and run_s - self._go_seen_s > DEAF_S:
            self._greet(LineState.DOWN, "the robot sends and does not obey: it does not read; check its cable")
        tries = max((tries for _, tries in self._unanswered.values()), default=0)
        if self._state not in {LineState.CLOSED, LineState.DOWN} and tries > self._config.link.tries:
            self._greet(LineState.DOWN, "no answer from the robot; check its power, its cable and link.port")

    def _greet(self, state: LineState, problem: str | None) -> None:
        """Begin the handshake; only a HALT stays in progress."""
        self._state, self._problem, self._go = state, problem, 0
        self._unanswered = {"HELLO": (0.0, 0)} | {word: (0.0, 0) for word in self._unanswered if word == "HALT"}

    # Commands.

    def drive(self, twist: Twist) -> None:
        if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
            raise ValueError(f"cannot drive at {twist}: a velocity must be finite")
        if self._state is LineState.READY:
            self._twist = twist

    def halt(self) -> None:
        self._twist = None
        self._unanswered.pop("FREE", None)
        self._unanswered.setdefault("HALT", (0.0, 0))

    def release(self) -> None:
        if self._state is LineState.READY:
            self._unanswered.pop("HALT", None)
            self._unanswered.setdefault("FREE", (0.0, 0))

    def set_firing(self, ring: RingConfig) -> None:
        pattern = firing_pattern(ring)
        if pattern != self._pattern:
            self._pattern = pattern
            if "HELLO" not in self._unanswered:
                self._unanswered["FIRE"] = (0.0, 0)

    def end_session(self) -> None:
        """There is no session: the base's deadman watches over what comes."""

    def outgoing(self, *, writable: bool) -> bytes:
        if self._state is LineState.CLOSED:
            return b""
        words = ("HALT", "HELLO", "FIRE", "FREE") if writable else ("HALT",)
        data = b"".join(self._command(word) for word in words if self._is_due(word))
        if writable and self._twist is not None and not self._unanswered.keys() & {"HALT", "FREE"}:
            data += self._velocity(self._twist)
        if writable or "HALT" in self._unanswered:
            self._twist = None
        return data

    def _is_due(self, word: str) -> bool:
        return word in self._unanswered and self._unanswered[word][0] <= self._run_s

    def _command(self, word: str) -> bytes:
        wait_s = self._config.link.reply_timeout_s
        self._unanswered[word] = (self._run_s + wait_s, self._unanswered[word][1] + 1)
        return line(word, *_pattern_words(self._pattern)) if word == "FIRE" else line(word)

    def _velocity(self, twist: Twist) -> bytes:
        limits = self._config.body
        v = min(limits.speed_max_m_s, max(-limits.speed_max_m_s, twist.v))
        w = min(limits.turn_max_rad_s, max(-limits.turn_max_rad_s, twist.w))
        if self._go == 0:
            self._go_seen_s = self._run_s
        self._go += 1
        return line("GO", self._go, round(1e3 * v), round(1e3 * w))

    # The robot's lines.

    def _take(self, word: str, fields: list[str]) -> None:
        if word == "ROBOT" and "HELLO" in self._unanswered:
            self._meet(fields[0][:32], *map(int, fields[1:]))
        elif word == "DONE" and self._unanswered.pop(fields[0], None) is not None:
            if fields[0] == "FIRE" and self._state is not LineState.READY:
                self._state, self._problem, self._heard_s = LineState.READY, None, self._run_s
        elif word == "AT" and self._state is LineState.READY:
            self._moved(*map(int, fields))
        elif word == "HEARD" and self._state is LineState.READY:
            self._waiting.append((1e-3 * int(fields[0]), int(fields[1], 16), [int(text) for text in fields[2:]]))

    def _meet(self, name: str, count: int, boot_id: int, deadman_ms: int) -> None:
        radius_m = max(math.hypot(mount.x_m, mount.y_m) for mount in self._config.ring.mounts)
        known, identity = self._identity, Identity(name, count, radius_m, 1e-3 * deadman_ms, PERIOD_S, boot_id)
        wrong = line_diagnostics.deadman_refused(name, identity.deadman_s, self._config.link)
        if count != len(self._config.ring.mounts):
            wrong = f"the robot has {count} sensors, and the robot file another number; choose its own file"
        if wrong is not None:
            self._state, self._problem = LineState.DOWN, wrong
            return
        del self._unanswered["HELLO"]
        self._unanswered["FIRE"] = (0.0, 0)
        self._identity, self._state = identity, LineState.HANDSHAKE
        if known is not None and known.boot_id != boot_id:
            self._history.clear()
            self._jumps.restart()
            self._firings.clear()
            self._odometry, self._flags, self._rebooted = None, Flags.NONE, True
            self._fired_s = -math.inf
        self._waiting.clear()

    def _moved(self, t_ms: int, x: int, y: int, th: int, v: int, w: int, flags: int, go: int) -> None:
        newest = self._history.newest
        if newest is not None and 1e-3 * t_ms < newest.robot_s:
            self._greet(LineState.HANDSHAKE, self._problem)  # its clock began again: a restart, ask who it is
            return
        pose = Pose(1e-3 * x, 1e-3 * y, 1e-3 * th)
        sample = Odometry(1e-3 * t_ms, pose, pose.theta, Twist(1e-3 * v, 1e-3 * w), Flags(flags & 31), go)
        self._odometry, note = self._jumps.remove(sample)
        self._notes += [] if note is None else [note]
        self._flags |= sample.flags
        self._history.add(self._odometry)
        self._heard_s = self._run_s
        if go == self._go or sample.flags & Flags.LATCHED:
            self._go_seen_s = self._run_s
        while self._waiting and self._waiting[0][0] <= sample.robot_s:
            self._fired(*self._waiting.popleft())

    def _fired(self, robot_s: float, mask: int, ranges_mm: list[int]) -> None:
        """Give a firing its pose: between two samples of the odometry, which the robot sends before and after it."""
        where, count = self._history.at(robot_s, 4.0 * PERIOD_S), len(self._config.ring.mounts)
        if where is None or robot_s <= self._fired_s or mask >> count or mask.bit_count() != len(ranges_mm):
            return
        ranges = np.full(count, math.nan)
        ranges[list(sensors(mask))] = [1e-3 * mm if mm else math.inf for mm in ranges_mm]
        self._firings.append(Firing(robot_s, *where, ranges))
        self._fired_s = robot_s


def _pattern_words(pattern: FiringPattern) -> list[object]:
    return [round(1e3 * pattern.step_period_s), round(1e3 * pattern.window_m), *(f"{m:x}" for m in pattern.masks)]
