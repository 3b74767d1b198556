"""The driver for the ring-and-base protocol: handshake, commands, supervision; without I/O and without a clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from config.files import one_line
from config.robot import RingConfig, RobotConfig
from drivers import line_diagnostics
from drivers.denning import diagnostics
from drivers.denning.boot_numbers import BootNumbers
from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import Ack, Drive, Echo, Echo2, Echo3, Frame, Hello, Ident, Nak, NakCode, Odom
from drivers.denning.line_load import refuse_overload
from drivers.denning.pending_command import PendingCommand, pending_command
from drivers.denning.pose_stamping import PoseStamper
from drivers.denning.timeouts import CommandAckMonitor, EchoTimeout, echo_timeout_s
from drivers.denning.wire_units import finest_range_m, identity_of, newest_version, to_wire, wire_pattern, wire_scan
from drivers.driver import DriverError, LineState
from drivers.firing_pattern import FiringError, firing_pattern
from drivers.messages import Flags, LinkCounts
from drivers.robot_clock import Jump
from drivers.session import Session

_UNACKNOWLEDGED_SHARE = 0.75
"""DRIVEs unacknowledged for this share of the longest silence are not received; below 1, as cycles take time."""
_SETTLING_STEPS = 3
"""Steps after a new pattern was accepted until the last echo of the previous one has arrived."""
_SEND_ORDER = ("HALT", "HELLO", "PATTERN", "LISTEN", "SCAN", "RELEASE")
"""Commands in the order in which they are sent."""


class DenningDriver(Session[PoseStamper]):
    """A `drivers.driver.RobotDriver` for the ring-and-base protocol.

    Raises
    ------
    drivers.firing_pattern.FiringError
        The ring cannot carry out the firing pattern, the protocol cannot express it, or the line is too slow for it.
    DriverError
        The robot file names a version of the protocol that does not exist, or ranges finer than it carries.
    """

    def __init__(self, config: RobotConfig) -> None:
        self._config = config
        self._pattern, self._listeners = wire_pattern(config.ring), firing_pattern(config.ring).listeners
        self._sweeps = wire_scan(config.ring)
        super().__init__(PoseStamper(config.ring, config.body), config.link.silence_max_s)
        self.stamper.set_pattern(self._pattern.window, self._pattern.step_period_ms)
        version = newest_version(config)
        finer = line_diagnostics.finer_than_line(config.ring.resolution_m, finest_range_m(config.ring, version))
        if finer is not None:
            raise DriverError(finer)
        refuse_overload(config.link, self._pattern, self._listeners, version, self._sweeps)
        self._newest = self._version = version  # what to ask for first, and what to ask for now
        self._unit_m = 0.0  # of a count in ECHO2
        self._ident: Ident | None = None
        self._boot_numbers = BootNumbers()
        self._jump: Jump | None = None  # of the clock, for which the robot is being identified
        self._decoder = Decoder("robot", midway=True)
        self._odometry_s = self._last_frame_s = 0.0  # when the last one came
        self._bad_at_odometry = 0  # corrupt frames of this line before it
        self._seq = 0
        self._flush_first = False  # whether the next write is the first on this line
        self._commands: dict[str, PendingCommand] = {}  # those without an answer, by name
        self._drive_acks = CommandAckMonitor()
        self._echo_timeout = EchoTimeout(echo_timeout_s(config.link, self._pattern))
        self._pattern_acked_s = 0.0
        self._settling_s = 0.0  # for so long after it echoes may belong to the pattern before
        self._must_identify = False  # whether a HELLO is sent that needs no answer

    @property
    def problem(self) -> str | None:
        """What is wrong, in one line; None if nothing is."""
        if self._problem is None and self.state is LineState.READY:
            corrupt = self._echo_timeout.corrupt_frames(self._run_s, self._decoder.bad)
            return line_diagnostics.noise(corrupt, "its echoes")
        return super().problem

    @property
    def _line_counts(self) -> LinkCounts:
        return LinkCounts(self._decoder.frames, self._decoder.bad, self._decoder.lost)

    def line_opened(self, run_s: float) -> None:
        """Start the handshake on a line that has just been opened: HELLO, then PATTERN."""
        super().line_opened(run_s)
        self._last_frame_s = run_s
        self._flush_first = True
        self._boot_numbers = BootNumbers()
        self._drive_acks = CommandAckMonitor()
        self._start_handshake()

    def line_closed(self) -> None:
        """Forget commands in progress; only a HALT that was not acknowledged is kept for the next line."""
        self._earlier_counts = self.counts
        self._decoder = Decoder("robot", midway=True)
        self._bad_at_odometry = 0
        self._state = LineState.CLOSED
        self._abandon()

    def receive(self, data: bytes, run_s: float) -> None:
        """Take bytes from the line, split anywhere."""
        self._run_s = run_s
        if self._state is LineState.CLOSED:
            return
        self.heard.received(data)
        for frame in self._decoder.feed(data):
            self._last_frame_s, self.heard.has_frames = run_s, True
            self._take_frame(frame)

    def tick(self, run_s: float) -> None:
        """Let time pass: send unanswered commands again; go DOWN if the robot is silent for too long."""
        self._run_s = run_s
        if self._state is LineState.CLOSED:
            return
        commands = self._commands
        given_up = [n for n in _SEND_ORDER if n in commands and commands[n].tick(run_s)] if commands else ()
        if given_up:
            name, command = given_up[0], commands[given_up[0]]
            self._go_down(lambda: self._no_answer(name, command))
        if self._state is LineState.READY:
            self._check_timeouts()
            if "PATTERN" not in self._commands and run_s - self._pattern_acked_s > self._settling_s:
                self.stamper.set_pattern(self._pattern.window, self._pattern.step_period_ms)

    def _no_answer(self, name: str, command: PendingCommand) -> str:
        """Return the message for a command that was given up."""
        since_s = max(command.first_s, self._run_s - line_diagnostics.RECENT_S)
        frames = self._decoder.frames if self._last_frame_s > since_s else 0
        return diagnostics.no_answer(name, command.tries, frames, self.heard)

    def halt(self) -> None:
        """Stop the robot at once and latch it: sent before everything else, and repeated until acknowledged."""
        self._drive = None
        self._commands.pop("RELEASE", None)
        if "HALT" not in self._commands:
            self._queue("HALT")
            if self._state is LineState.READY:
                self.heard.clear()

    def release(self) -> None:
        """Clear the latch; without effect unless READY, so that the robot is never released later and unnoticed."""
        if self._state is LineState.READY:
            self._commands.pop("HALT", None)
            self._queue("RELEASE")

    def set_firing(self, ring: RingConfig) -> None:
        """Change the firing pattern to that of `ring`; does nothing if it is the current one.

        Raises
        ------
        drivers.firing_pattern.FiringError
            The ring cannot carry out the pattern, or the protocol cannot express it; the current one stays.
        """
        pattern, listeners = wire_pattern(ring), firing_pattern(ring).listeners
        if (pattern, listeners) == (self._pattern, self._listeners):
            return
        deaf = None if self._ident is None else diagnostics.cannot_listen(self._ident, listeners)
        if deaf is not None:
            raise FiringError(deaf)
        refuse_overload(self._config.link, pattern, listeners, self._newest, self._sweeps)
        # Until the robot uses the new pattern, echoes may belong to either; an echo names its own sensors.
        step_ms = min(self._pattern.step_period_ms, pattern.step_period_ms)
        self.stamper.set_pattern(max(self._pattern.window, pattern.window), step_ms)
        self._settling_s = _SETTLING_STEPS * 1e-3 * max(self._pattern.step_period_ms, pattern.step_period_ms)
        self._pattern, self._listeners = pattern, listeners
        self._echo_timeout.timeout_s = echo_timeout_s(self._config.link, pattern)
        if self._state is LineState.READY or "PATTERN" in self._commands:
            for of_pattern_before in ("LISTEN", "SCAN"):
                self._commands.pop(of_pattern_before, None)
            self._queue("PATTERN")

    def end_session(self) -> None:
        """End the session: this protocol has none."""

    def outgoing(self, *, writable: bool) -> bytes:
        """Return the bytes to send now, and consider them sent; only HALT while the line is not `writable`."""
        if self._state is LineState.CLOSED:
            self._drive = None
            return b""
        out = bytearray()
        for name in _SEND_ORDER if writable else _SEND_ORDER[:1]:
            command = self._commands.get(name)
            if command is not None and command.due:
                out += encode(command.frame(self._next_seq(), self._run_s))
        if self._state is not LineState.READY or "HALT" in self._commands:
            self._drive = None
        if writable and self._drive is not None:
            seq, body = self._next_seq(), self._config.body
            self._drive_acks.sent(seq, self._run_s)
            v, w = to_wire(self._drive.v, body.speed_max_m_s), to_wire(self._drive.w, body.turn_max_rad_s)
            out += encode(Drive(seq, v, w))
            self._drive = None
        if writable and self._must_identify:
            # Not a pending command: it needs no answer, because other timeouts detect a lost robot.
            self._must_identify = False
            out += encode(Hello(self._next_seq(), self._version))
        self.heard.sent(bytes(out))
        if out and self._flush_first:
            # Ends the incomplete frame that an earlier user of the line may have left in the robot's decoder.
            self._flush_first = False
            return b"\0" + bytes(out)
        return bytes(out)

    def _check_timeouts(self) -> None:
        """Detect a robot that is silent, one that does not receive, and a ring that does not fire."""
        silence_max_s = self._config.link.silence_max_s
        silent_s = self._run_s - self._odometry_s
        unacknowledged_s = self._drive_acks.unacknowledged_s(self._odometry_s)
        if silent_s > silence_max_s:
            # A single echo may follow the last odometry before the robot falls silent.
            others = self._last_frame_s - self._odometry_s > 0.5 * silence_max_s
            bad = self._decoder.bad - self._bad_at_odometry
            self._go_down(line_diagnostics.silence(silent_s, others=others, bad=bad, heard=self.heard))
        elif unacknowledged_s > _UNACKNOWLEDGED_SHARE * silence_max_s:
            self._go_down(diagnostics.not_receiving(unacknowledged_s))
        elif self._echo_timeout.expired(self._run_s):
            self._must_identify = True

    def _next_seq(self) -> int:
        """Return the next sequence number, and consider it used."""
        seq = self._seq
        self._seq = (seq + 1) % 256
        return seq

    def _queue(self, name: str) -> None:
        """Queue a command; with the usual number of tries, or without limit if the robot does not answer anyway."""
        without_limit = self._state in (LineState.DOWN, LineState.CLOSED)
        link = self._config.link
        self._commands[name] = pending_command(
            name,
            self._pattern,
            link,
            self._version,
            without_limit=without_limit,
            listeners=self._listeners,
            sweeps=self._sweeps,
        )

    def _queue_hello(self) -> None:
        """Queue a HELLO that asks for the newest version."""
        self._version = self._newest
        self._queue("HELLO")

    def _start_handshake(self) -> None:
        self._state = LineState.HANDSHAKE
        self._queue_hello()

    def _abandon(self) -> None:
        """Drop all commands but HALT, which is repeated without limit from now on."""
        halt = self._commands.pop("HALT", None)
        self._commands.clear()
        self._drive = None
        self._must_identify = False
        self._drive_acks.forget()
        self.stamper.drop_held()
        if halt is not None:
            self._queue("HALT")

    def _go_down(self, problem: str | Callable[[], str]) -> None:
        """Go DOWN with a problem; HELLO follows after the usual wait for an answer, not at once."""
        self._state = LineState.DOWN
        self._problem = problem
        self._abandon()
        self._queue_hello()
        hello = self._commands["HELLO"]
        hello.due, hello.sent_s = False, self._run_s

    def _take_frame(self, frame: Frame) -> None:
        """Take in a frame; echoes before READY, or of another version than that agreed on, are dropped."""
        match frame:
            case Ident():
                self._take_ident(frame)
            case Ack():
                self._take_ack(frame)
            case Nak():
                self._take_nak(frame)
            case Odom():
                self._take_odometry(frame)
            case Echo() | Echo2() | Echo3() if self._state is LineState.READY and (
                self._version > 1 or isinstance(frame, Echo)
            ):
                self._echo_timeout.restart(self._run_s, self._decoder.bad)
                self.stamper.echo(frame, self._unit_m)
                self._firings.extend(self.stamper.firings(self._run_s))
            case _:
                pass  # an echo of a pattern that this driver has not set, or of another version

    def _take_ident(self, ident: Ident) -> None:
        """Take in what the robot says of itself: go DOWN if it is the wrong one, else queue its pattern if need be.

        It has restarted if its boot number is another one, or if its clock went back.
        """
        ident = replace(ident, name=one_line(ident.name))  # it goes to terminals and logs
        wrong = diagnostics.wrong_robot(ident, self._config)
        if wrong is None:
            wrong = diagnostics.cannot_listen(ident, self._listeners) or diagnostics.cannot_turn(ident, self._sweeps)
        if wrong is not None:
            self.is_other_robot = True
            self._go_down(wrong)
            return
        self._ident = ident
        known, self._identity = self._identity, identity_of(ident)
        if known is not None and self._boot_numbers.are_of_two(known.boot_id, ident.boot_id, self._run_s):
            self._go_down(diagnostics.two_robots(ident))
            return
        self._version, self._unit_m = ident.version, 1e-6 * ident.range_unit_um
        is_known = known is not None and known.traits == self._identity.traits
        if not is_known and (coarse := diagnostics.coarse_ranges(ident, self._config.ring.resolution_m)) is not None:
            self.stamper.note(coarse)
        restarted = known is not None and (known.boot_id != ident.boot_id or self._jump is Jump.BACK)
        if known is None or known.odometry_period_s != self._identity.odometry_period_s:
            self.stamper.set_period(self._identity.odometry_period_s)
        answers_hello = self._commands.pop("HELLO", None) is not None
        if restarted:
            self._abandon()
            self.stamper.restart()
            self._forget_received()
            self._drive_acks = CommandAckMonitor()
        elif self._jump is not None:
            self.stamper.break_off()
        self._jump = None
        if answers_hello or restarted:
            is_first = answers_hello or self._state is not LineState.HANDSHAKE
            self._state = LineState.HANDSHAKE
            self._queue("PATTERN" if is_first else "HELLO")  # a second answer may be another robot's: ask again

    def _take_ack(self, ack: Ack) -> None:
        """Go on after a command that was obeyed: that of the PATTERN makes the line READY."""
        name = self._answered(ack.of)
        if name is None or name == "HELLO":  # the answer to HELLO is IDENT
            return
        del self._commands[name]
        if name == "PATTERN":
            if self._listeners:
                self._queue("LISTEN")
            if self._sweeps:
                self._queue("SCAN")
            self._state = LineState.READY
            self._odometry_s, self._bad_at_odometry = self._run_s, self._decoder.bad
            self._echo_timeout.restart(self._run_s, self._decoder.bad)
            self._pattern_acked_s = self._run_s
            if "HALT" in self._commands:
                # A robot that answers other commands must answer this one within the usual number of tries.
                self._queue("HALT")
                self.heard.clear()
        if self._state is LineState.READY:
            self._problem = None

    def _take_nak(self, nak: Nak) -> None:
        """Go DOWN after a command that was refused, but for a RELEASE, a DRIVE, and a HELLO of a newer version."""
        name = self._answered(nak.of)
        if name == "HELLO" and nak.code == NakCode.VALUE_OUT_OF_RANGE and self._version > 1:
            self._version = 1  # the robot does not know the newer one
            self._queue("HELLO")
        elif name is not None:
            problem = diagnostics.refusal(name, nak.code)
            if name == "RELEASE":
                del self._commands[name]
                self._problem = problem
            else:
                self.is_other_robot = name == "PATTERN"
                self._go_down(problem)
        elif nak.of in self._drive_acks:
            self._drive_acks.forget()
            if nak.code != NakCode.LATCHED:
                self._problem = diagnostics.refusal("DRIVE", nak.code)

    def _answered(self, seq: int) -> str | None:
        """Return the name of the pending command one of whose tries had this sequence number."""
        return next(
            (name for name in _SEND_ORDER if name in self._commands and seq in self._commands[name].seqs), None
        )

    def _take_odometry(self, odom: Odom) -> None:
        """Take in a sample; if its clock jumped, the robot is asked who it is. Dropped until it has answered that."""
        if "HELLO" in self._commands:
            return  # until it has identified itself, its clock and odometry may be those of before a restart
        sample = self.stamper.odometry(odom, self._run_s)
        if isinstance(sample, Jump):
            # It may have restarted and lost its clock, odometry and pattern: identify it again.
            self._jump = sample
            self._abandon()
            self._start_handshake()
            return
        self._odometry_s, self._bad_at_odometry = self._run_s, self._decoder.bad
        self.heard.clear()
        self._odometry = sample
        if (error := self.stamper.clock_error) is not None and error > 0.0:
            self._go_down(diagnostics.wrong_clock_rate(error))
        self._drive_acks.acknowledged(odom.last_drive_seq)
        if sample.flags:
            self._flags |= sample.flags
            if sample.flags & Flags.LATCHED:
                self._drive_acks.forget()  # while latched, the robot refuses every DRIVE with a NAK
        self._firings.extend(self.stamper.firings(self._run_s))
