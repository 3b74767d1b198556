"""The conversation with a robot that speaks the ring-and-base protocol: greet, set the pattern, drive, and notice.

No line, no clock: bytes and times come in, bytes and messages go out. What a command waits for is in `commands`,
where a firing took place in `stamping`, what problem is called in `diagnostics`.
"""

from __future__ import annotations

import math
from collections import deque

from config.robot import RingConfig, RobotConfig
from drivers.denning import diagnostics
from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import Ack, Drive, Echo, Frame, Halt, Hello, Ident, Nak, NakCode, Odom, Pattern, Release
from drivers.denning.pending_command import Command
from drivers.denning.pose_stamping import PoseStamper
from drivers.denning.robot_clock import Jump
from drivers.denning.timeouts import CommandAckMonitor, EchoTimeout
from drivers.denning.wire_units import identity_of, to_wire, wire_pattern
from drivers.driver import LineState, Received
from drivers.messages import Firing, Flags, Identity, LinkCounts, Odometry, Pose, Twist

_GREET_AGAIN_S = 0.5
"""Pace of greeting a robot that does not answer or is the wrong one."""
_UNTAKEN_SHARE = 0.75
"""DRIVEs untaken for this share of the longest silence mean that nobody hears them; they come only once a cycle."""
_STEPS_MISSED = 2
"""A ring may be silent for this many firings more than the line may be for odometry."""
_STEPS_SETTLING = 3
"""So many steps after a new pattern was taken the last echo of the one before has come."""
_FIRINGS_MAX = 1024
"""Firings kept for one who does not take them; the oldest leave."""
_ORDER = ("HALT", "HELLO", "PATTERN", "RELEASE")
"""What goes on the line first."""


class DenningDriver:
    """A `drivers.driver.RobotDriver` for the ring-and-base protocol.

    Parameters
    ----------
    config
        The robot file: the ring the robot must have, and the patience with its answers.

    Raises
    ------
    drivers.firing_pattern.FiringError
        The firing pattern is one that the ring cannot carry out or the protocol cannot say.
    """

    def __init__(self, config: RobotConfig) -> None:
        self._config = config
        self._pattern = wire_pattern(config.ring)
        self._stamper = PoseStamper(len(config.ring.mounts), config.body)
        self._stamper.set_window(self._pattern.window)
        self._state = LineState.CLOSED
        self._problem: str | None = None
        self._identity: Identity | None = None
        self._jump: Jump | None = None
        self._decoder = Decoder("robot", midway=True)
        self._earlier = LinkCounts()
        self._run_s = 0.0
        self._odometry_s = 0.0
        self._frame_s = 0.0
        self._bad_then = 0
        self._seq = 0
        self._flush_first = False
        self._commands: dict[str, Command] = {}
        self._drive: Twist | None = None
        self._watch = CommandAckMonitor()
        self._ring = EchoTimeout(config.link.silence_max_s + _STEPS_MISSED * 1e-3 * self._pattern.step_period_ms)
        self._pattern_s = 0.0
        self._settling_s = 0.0
        self._ask_who = False
        self._firings: deque[Firing] = deque(maxlen=_FIRINGS_MAX)
        self._odometry: Odometry | None = None
        self._rebooted = False

    @property
    def state(self) -> LineState:
        """How far the conversation has come."""
        return self._state

    @property
    def problem(self) -> str | None:
        """What is wrong, in one line; None where nothing is."""
        if self._problem is None and self._state is LineState.READY:
            return diagnostics.noise(self._ring.drowned(self._run_s, self._decoder.bad), "its echoes")
        return self._problem

    @property
    def identity(self) -> Identity | None:
        """What the robot said of itself; the last known where it is being greeted again."""
        return self._identity

    @property
    def counts(self) -> LinkCounts:
        """Frames over all lines so far."""
        before, now = self._earlier, self._decoder
        return LinkCounts(before.frames + now.frames, before.bad + now.bad, before.lost + now.lost)

    @property
    def firings_waiting(self) -> int:
        """Firings that `take_received` has ready."""
        return len(self._firings)

    @property
    def late_echoes(self) -> int:
        """Firings dropped: no odometry tells where they took place, or they came twice, or after a newer one."""
        return self._stamper.late_echoes

    @property
    def out_of_window(self) -> int:
        """Ranges dropped that lie beyond the window their firing listened for."""
        return self._stamper.out_of_window

    @property
    def odometry_origin(self) -> Pose:
        """The origin of the poses handed up, in the robot's own odometry: another one since that has leapt."""
        return self._stamper.origin

    def line_opened(self, run_s: float) -> None:
        """Begin (again) on a line just opened: greet the robot and set its firing pattern."""
        self.line_closed()
        self._run_s = self._frame_s = run_s
        self._flush_first = True
        self._watch = CommandAckMonitor()
        self._greet()

    def line_closed(self) -> None:
        """Forget what was under way; only a HALT not yet answered is kept for the next line."""
        self._earlier = self.counts
        self._decoder = Decoder("robot", midway=True)
        self._bad_then = 0
        self._state = LineState.CLOSED
        self._abandon()

    def receive(self, data: bytes, run_s: float) -> None:
        """Take bytes from the line, any chunking."""
        self._run_s = run_s
        if self._state is LineState.CLOSED:
            return
        for frame in self._decoder.feed(data):
            self._frame_s = run_s
            self._take_frame(frame)
        self._firings.extend(self._stamper.firings())

    def tick(self, run_s: float) -> None:
        """Let time pass: commands unanswered are sent again, silence becomes DOWN."""
        self._run_s = run_s
        if self._state is LineState.CLOSED:
            return
        commands = self._commands
        given_up = [name for name in _ORDER if name in commands and commands[name].tick(run_s)] if commands else ()
        if given_up:
            name = given_up[0]
            heard, tries = self._decoder, self._commands[name].tries
            problem = diagnostics.no_answer(
                name, tries, frames=heard.frames, bad=heard.bad, baud=self._config.link.baud
            )
            self._go_down(problem)
        if self._state is LineState.READY:
            self._listen()
            if "PATTERN" not in self._commands and run_s - self._pattern_s > self._settling_s:
                self._stamper.set_window(self._pattern.window)

    def drive(self, twist: Twist) -> None:
        """Ask for a velocity; replaces one that is not yet on the line, and is held to the limits of the body.

        It goes on the line only while the robot is READY and no HALT waits for its answer.

        Raises
        ------
        ValueError
            The velocity is not finite.
        """
        if not (math.isfinite(twist.v) and math.isfinite(twist.w)):
            raise ValueError(f"cannot drive at {twist}: a velocity must be finite; something divided by zero")
        self._drive = twist

    def halt(self) -> None:
        """Stop at once and latch: before everything else, and again and again until the robot has answered."""
        self._drive = None
        self._commands.pop("RELEASE", None)
        if "HALT" not in self._commands:
            self._ask("HALT")

    def release(self) -> None:
        """Clear the latch; without effect while the robot is not READY, so that none is released later unseen."""
        if self._state is LineState.READY:
            self._commands.pop("HALT", None)
            self._ask("RELEASE")

    def set_firing(self, ring: RingConfig) -> None:
        """Fire the pattern of this ring from now on; nothing happens where it is the one under way.

        Until the robot has taken it, the echoes of the one before still count: an echo names its own sensors.

        Raises
        ------
        drivers.firing_pattern.FiringError
            The ring cannot carry it out, or the protocol cannot say it; the pattern stays as it was.
        """
        pattern = wire_pattern(ring)
        if pattern == self._pattern:
            return
        # Until the new one is under way, whose echoes come next cannot be told.
        self._stamper.set_window(max(self._pattern.window, pattern.window))
        self._settling_s = _STEPS_SETTLING * 1e-3 * max(self._pattern.step_period_ms, pattern.step_period_ms)
        self._pattern = pattern
        if self._state is LineState.READY or "PATTERN" in self._commands:
            self._ask("PATTERN")

    def outgoing(self, *, writable: bool) -> bytes:
        """Return what should go on the line now; only HALT while the line is not `writable`."""
        if self._state is LineState.CLOSED:
            self._drive = None
            return b""
        if self._drive is None and not self._commands and not self._ask_who:
            return b""
        out = bytearray()
        for name in _ORDER if writable else _ORDER[:1]:
            command = self._commands.get(name)
            if command is not None and command.due:
                out += encode(command.frame(self._next_seq(), self._run_s))
        if self._state is not LineState.READY or "HALT" in self._commands:
            self._drive = None
        if writable and self._drive is not None:
            seq, body = self._next_seq(), self._config.body
            self._watch.sent(seq, self._run_s)
            v, w = to_wire(self._drive.v, body.speed_max_m_s), to_wire(self._drive.w, body.turn_max_rad_s)
            out += encode(Drive(seq, v, w))
            self._drive = None
        if writable and self._ask_who:
            # Not a command under way: nobody need wait for the answer, and no answer is no news.
            self._ask_who = False
            out += encode(Hello(self._next_seq()))
        if out and self._flush_first:
            # Ends whatever half a frame an earlier user of the line left in the robot's decoder.
            self._flush_first = False
            return b"\0" + bytes(out)
        return bytes(out)

    def take_received(self) -> Received:
        """Return and forget what arrived since the last call."""
        heard = Received(tuple(self._firings), self._odometry, self._rebooted, self._stamper.notes())
        self._firings.clear()
        self._odometry = None
        self._rebooted = False
        return heard

    def _listen(self) -> None:
        """Notice a robot that has fallen silent, one that no longer hears, and a ring that does not fire."""
        silence_max_s = self._config.link.silence_max_s
        silent_s = self._run_s - self._odometry_s
        untaken_s = self._watch.untaken_s(self._odometry_s)  # what came after it, it cannot tell of
        if silent_s > silence_max_s:
            # An echo may well come right after the last odometry of all.
            others = self._frame_s - self._odometry_s > 0.5 * silence_max_s
            bad = self._decoder.bad - self._bad_then
            self._go_down(diagnostics.silence(silent_s, others=others, bad=bad))
        elif untaken_s > _UNTAKEN_SHARE * silence_max_s:
            self._go_down(diagnostics.deafness(untaken_s))
        elif self._ring.should_ask(self._run_s):
            self._ask_who = True

    def _next_seq(self) -> int:
        seq = self._seq
        self._seq = (seq + 1) % 256
        return seq

    def _ask(self, name: str) -> None:
        """Put a command under way; with the usual patience, or without end where nobody answers anyway."""
        link = self._config.link
        patient = self._state in (LineState.DOWN, LineState.CLOSED)
        tries = None if patient else link.tries
        match name:
            case "HALT":
                command = Command(Halt, link.reply_timeout_s, tries)
            case "RELEASE":
                command = Command(Release, link.reply_timeout_s, tries)
            case "HELLO":
                command = Command(Hello, _GREET_AGAIN_S if patient else link.reply_timeout_s, tries)
            case _:
                command = Command(lambda seq: Pattern(seq, *self._pattern), link.reply_timeout_s, tries)
        self._commands[name] = command

    def _greet(self) -> None:
        self._state = LineState.HANDSHAKE
        self._ask("HELLO")

    def _abandon(self) -> None:
        """Drop everything under way but HALT; from now on that is tried without end."""
        halt = self._commands.pop("HALT", None)
        self._commands.clear()
        self._drive = None
        self._ask_who = False
        self._watch.settle()
        self._stamper.drop_held()
        if halt is not None:
            self._ask("HALT")

    def _go_down(self, problem: str) -> None:
        self._state = LineState.DOWN
        self._problem = problem
        self._abandon()
        self._ask("HELLO")
        hello = self._commands["HELLO"]
        hello.due, hello.sent_s = False, self._run_s

    def _take_frame(self, frame: Frame) -> None:
        match frame:
            case Ident():
                self._take_ident(frame)
            case Ack():
                self._take_ack(frame)
            case Nak():
                self._take_nak(frame)
            case Odom():
                self._take_odometry(frame)
            case Echo() if self._state is LineState.READY:
                self._ring.heard(self._run_s, self._decoder.bad)
                self._stamper.echo(frame)
            case _:
                pass  # an echo of a pattern that is not ours yet

    def _take_ident(self, ident: Ident) -> None:
        wrong = diagnostics.wrong_robot(ident, self._config)
        if wrong is not None:
            self._go_down(wrong)
            return
        known, self._identity = self._identity, identity_of(ident)
        restarted = known is not None and (known.boot_id != ident.boot_id or self._jump is Jump.BACK)
        if known is None or known.odometry_period_s != self._identity.odometry_period_s:
            self._stamper.set_period(self._identity.odometry_period_s)
        greeted = self._commands.pop("HELLO", None) is not None
        if restarted:
            self._abandon()
            self._stamper.restart()
            self._firings.clear()
            self._odometry = None
            self._rebooted = True
            self._watch = CommandAckMonitor()
        elif self._jump is not None:
            self._stamper.break_off()
        self._jump = None
        if greeted or restarted:
            self._state = LineState.HANDSHAKE
            self._ask("PATTERN")

    def _take_ack(self, ack: Ack) -> None:
        name = self._answered(ack.of)
        if name is None:
            return
        del self._commands[name]
        if name == "PATTERN":
            self._state = LineState.READY
            self._odometry_s, self._bad_then = self._run_s, self._decoder.bad
            self._ring.heard(self._run_s, self._decoder.bad)
            self._pattern_s = self._run_s
            if "HALT" in self._commands:
                self._ask("HALT")  # a robot that answers all else must answer this, within the usual patience
        if self._state is LineState.READY:
            self._problem = None

    def _take_nak(self, nak: Nak) -> None:
        name = self._answered(nak.of)
        if name is not None:
            problem = diagnostics.refusal(name, nak.code)
            if name == "RELEASE":
                del self._commands[name]
                self._problem = problem
            else:
                self._go_down(problem)
        elif nak.of in self._watch:
            self._watch.settle()
            if nak.code != NakCode.LATCHED:
                self._problem = diagnostics.refusal("DRIVE", nak.code)

    def _answered(self, seq: int) -> str | None:
        """Return the name of the command under way one of whose tries was `seq`."""
        return next((name for name in _ORDER if name in self._commands and seq in self._commands[name].seqs), None)

    def _take_odometry(self, odom: Odom) -> None:
        if "HELLO" in self._commands:
            return  # until it has said who it is, its clock and its odometry may be another life's
        sample = self._stamper.odometry(odom, self._run_s)
        if isinstance(sample, Jump):
            # Perhaps it restarted, and its clock, its odometry and its pattern are gone: ask who is there.
            self._jump = sample
            self._abandon()
            self._greet()
            return
        self._odometry_s, self._bad_then = self._run_s, self._decoder.bad
        self._odometry = sample
        self._watch.named(odom.last_drive_seq)
        if sample.flags & Flags.LATCHED:
            self._watch.settle()  # while latched it takes none, and says so
        self._firings.extend(self._stamper.firings())
