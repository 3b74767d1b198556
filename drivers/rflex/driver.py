"""The driver for robots with an rFLEX controller: commands and supervision; without I/O and without a clock.

The controller acknowledges nothing. What a command did is seen in its reports: the counts of both axes, the brake in
its status, ranges that come. It loses commands sent too rapidly, so that each gets a gap of its own, and all that
matters is repeated until it is seen.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from config.robot import RingConfig, RobotConfig
from drivers import line_diagnostics
from drivers.driver import DriverError, LineState
from drivers.line_budget import refuse_slow_line
from drivers.messages import Flags, Identity, LinkCounts, Odometry, Twist
from drivers.rflex import diagnostics
from drivers.rflex.codec import (
    BRAKE_SET,
    SET_DEFAULTS,
    AxisReport,
    Decoder,
    Frame,
    Input,
    SonarReport,
    Status,
    encode,
    frame_of,
    input_request,
    report_of,
    report_request,
    sonar_run,
)
from drivers.rflex.measurements import REPORT_PERIOD_S, Measurements
from drivers.rflex.supervision import Brake, Mode, StallMonitor
from drivers.rflex.wire_units import drive_commands, pattern_of, sonar_ids, stop_commands
from drivers.robot_clock import Jump
from drivers.session import Session

_GAP_S: Final = 0.0099
"""Least time between two commands, s: 10 ms, less the rounding of times."""
_BOTH_AXES: Final = 3
_INPUT_PERIOD_US: Final = 100_000
_INPUT_REQUEST_S: Final = 2.0
"""Time from one request for the bumpers' reports to the next, s: a lost one would go unnoticed."""
_CALLING_S: Final = 1.0
"""Time for which the robot is called before the line counts as down, s."""
_OTHERS_S: Final = 0.2
"""Longest time for which nothing but velocities is sent, s. Without them a status is asked for twice as often."""
_SILENT_ECHO_S: Final = 0.5
"""Time without a range after which the sonars are started again, s, besides two steps of their pattern."""
_DRIVEN_S: Final = 0.5
"""A base that gets no velocity for so long is stopped, s: the time of its own fail-safe is not documented."""
_HALTING_MAX_S: Final = 2.5
"""Longest time that a halted base may take until its brake is on, s."""
_VOLTS_OFFSET: Final = 1.2
"""The controller measures its voltage behind a diode, V."""


class RflexDriver(Session[Measurements]):
    """A `drivers.driver.RobotDriver` for robots with an rFLEX controller.

    Raises
    ------
    drivers.firing_pattern.FiringError
        The ring or the controller cannot carry out the firing pattern.
    DriverError
        The sonar banks do not fit the ring, or its ranges are finer than the controller's.
    """

    def __init__(self, config: RobotConfig) -> None:
        self._config = config
        finer = line_diagnostics.finer_than_line(config.ring.resolution_m, 1.0 / config.rflex.range_factor)
        if finer is not None:
            raise DriverError(finer)
        self._pattern = pattern_of(config, config.ring)
        axes = 2 * len(encode(frame_of(AxisReport(0, 0, 0, 0)))) / REPORT_PERIOD_S
        ranges = SonarReport(0, tuple((0, 0) for _ in config.rflex.banks))
        refuse_slow_line(config.link, axes, len(encode(frame_of(ranges))), 1e-6 * self._pattern.step_us)
        super().__init__(Measurements(config, sonar_ids(config)), config.link.silence_max_s)
        self.stamper.set_pattern(self._pattern)
        self._decoder = Decoder()
        self._boots = 0
        # Readings of the run's clock, s:
        self._sent_s = 0.0
        """Last command of any kind."""
        self._called_s = 0.0
        """Begin of the present attempt to reach the robot."""
        self._setup_s = 0.0
        """Last time that the commands of `_set_up` were queued."""
        self._report_s = 0.0
        """Last frame of any kind."""
        self._sample_s = 0.0
        """Last sample of the odometry."""
        self._echo_s = 0.0
        """Last ranges, or the last attempt to start the sonars."""
        self._answer_s = 0.0
        """Last status: the only report that comes on request alone."""
        self._driven_s = 0.0
        """Last velocity; `_DRIVEN_S` after it the base is stopped."""
        self._input_s = 0.0
        """Last request for the bumpers' reports."""
        self._others_s = 0.0
        """Last time that a command other than a velocity could be sent."""
        self._bad_at_sample = 0
        """Corrupt frames of this line before that sample."""
        self._brake, self._stall = Brake(config), StallMonitor(config)
        self._queue: deque[Frame] = deque()
        """Commands that can wait, in the order in which they are sent."""
        self._axes = drive_commands(Twist(0.0, 0.0), config)
        """The newest velocity, as a command for each axis."""
        self._axes_left = 0
        """How many of these are still to be sent."""
        self._axis_turn = 0
        """The one that is sent next."""
        self._is_ending = False
        """Whether the next `outgoing` ends the session."""
        self._is_moving = False
        """Whether the last velocity was not zero."""
        self._pressed: dict[int, int] = {}
        """Contacts that are closed, by the address of their panel."""
        self._volts = math.inf
        """The battery's voltage; inf before the first status."""

    @property
    def problem(self) -> str | None:
        """What is wrong, in one line; None if nothing is."""
        halting_s = self._brake.halting_s(self._run_s)
        if self.state is LineState.READY and halting_s > _HALTING_MAX_S:
            return diagnostics.not_stopping(halting_s)
        return super().problem

    @property
    def battery_v(self) -> float | None:
        """The battery's voltage by the last status, V; None before the first."""
        return self._volts if math.isfinite(self._volts) else None

    @property
    def _line_counts(self) -> LinkCounts:
        # Not all numbers are used, so lost frames are not known.
        return LinkCounts(self._decoder.frames, self._decoder.bad, 0)

    def line_opened(self, run_s: float) -> None:
        """Stop the base and request reports, on a line that has just been opened."""
        super().line_opened(run_s)
        self._begin(LineState.HANDSHAKE, None)

    def line_closed(self) -> None:
        """Forget commands in progress; only a halt is kept for the next line until the brake is reported."""
        self._earlier_counts, self._decoder = self.counts, Decoder()
        self._state, self._is_ending = LineState.CLOSED, False
        self._abandon()

    def receive(self, data: bytes, run_s: float) -> None:
        """Take bytes from the line, split anywhere."""
        self._run_s = run_s
        if self._state is LineState.CLOSED:
            return
        self.heard.received(data)
        for frame in self._decoder.feed(data):
            self._take(frame)

    def tick(self, run_s: float) -> None:
        """Let time pass: call the robot again, stop a base that gets no velocity, go DOWN if the robot is silent."""
        self._run_s = run_s
        if self._state is LineState.READY:
            self._supervise()
        elif self._state is not LineState.CLOSED:
            if run_s - self._setup_s >= self._config.link.reply_timeout_s and not self._queue:
                self._set_up()
            if run_s - self._called_s > _CALLING_S and self._state is LineState.HANDSHAKE:
                self._state = LineState.DOWN
                self._problem = lambda: diagnostics.no_answer(self._newest_frames(), self.heard)

    def _newest_frames(self) -> int:
        """Return how many frames were received, 0 if that was long ago."""
        return self._decoder.frames if self._run_s - self._report_s < line_diagnostics.RECENT_S else 0

    def halt(self) -> None:
        """Stop the base at once, repeat that until it stands, then set its brake."""
        self._drive, self._axes_left = None, 0
        self._is_moving = False
        self._stall.stop()
        self._brake.halt()

    def release(self) -> None:
        """Release the brake; without effect unless READY, so that the base is never released unnoticed."""
        if self._state is LineState.READY:
            self._brake.release()

    def set_firing(self, ring: RingConfig) -> None:
        """Change the firing pattern to that of `ring`; does nothing if it is the current one.

        Raises
        ------
        drivers.firing_pattern.FiringError
            The ring or the controller cannot carry out the pattern; the current one stays.
        """
        pattern = pattern_of(self._config, ring)
        if pattern != self._pattern:
            self._pattern = pattern
            self.stamper.set_pattern(pattern)
            if self._state is not LineState.CLOSED:
                self._queue.append(pattern.command)

    def end_session(self) -> None:
        """Stop the base, set its brake, and end all reports."""
        self._is_ending = self._state is not LineState.CLOSED

    def outgoing(self, *, writable: bool) -> bytes:
        """Return the command to send now, and consider it sent; only that of a halt if the line is not `writable`."""
        if self._state is LineState.CLOSED:
            self._drive = None
            return b""
        if self._is_ending:
            self._is_ending, self._state = False, LineState.CLOSED
            stop = (*stop_commands(self._config, 0), BRAKE_SET)
            ends = (sonar_run(0, 0, on=False), input_request(0), report_request(0, 0))
            return b"".join(map(encode, (*stop, *ends)))
        is_halting = self._brake.mode is Mode.HALTING
        has_gap = self._run_s - self._sent_s >= _GAP_S
        # A velocity does not wait for a gap: if it is lost, the next one comes within a cycle.
        is_driven = writable and self._drive is not None and self._brake.may_drive
        is_urgent = is_driven or (is_halting and self._brake.halting_s(self._run_s) == 0.0)
        if not is_urgent and not (has_gap and (writable or is_halting)):
            return b""
        frame = self._brake.due(self._run_s) if is_halting else None
        if frame is None and writable:
            frame = self._take_next_command(has_gap=has_gap)
        if frame is None:
            return b""
        self._sent_s = self._run_s
        data = encode(frame)
        if self._state is not LineState.READY:
            self.heard.sent(data)
        return data

    def _take_next_command(self, *, has_gap: bool) -> Frame | None:
        """Remove and return the next command that is due; None if there is none. The line must be writable.

        A requested velocity replaces what is left of the last one and goes to the stall monitor; it is dropped unless
        READY with the brake off. It is two commands, one for each axis; the axis that comes first alternates. While
        some are left, another command gets its turn every `_OTHERS_S`, but none without a gap.
        """
        drive, self._drive = self._drive, None
        if drive is not None and self._state is LineState.READY and self._brake.may_drive:
            self._axes, self._axes_left = drive_commands(drive, self._config), 2
            self._stall.command(drive, self._run_s)
            self._driven_s, self._is_moving = self._run_s, drive != Twist(0.0, 0.0)
        if self._axes_left and (not has_gap or self._run_s - self._others_s < _OTHERS_S):
            return self._take_axis_command()
        if not has_gap:
            return None
        self._others_s = self._run_s
        frame = self._queue.popleft() if self._queue else self._brake.due(self._run_s)
        return self._take_axis_command() if frame is None and self._axes_left else frame

    def _take_axis_command(self) -> Frame:
        """Return the newest velocity's command for the axis whose turn it is; at least one must be left."""
        frame = self._axes[self._axis_turn]
        self._axis_turn, self._axes_left = 1 - self._axis_turn, self._axes_left - 1
        return frame

    def _begin(self, state: LineState, problem: str | None) -> None:
        """Give up what there was, stop the base, whether it hears that or not, and call the robot again."""
        self._state, self._problem = state, problem
        self._abandon()
        self.halt()
        self._called_s = self._run_s
        self._set_up()

    def _set_up(self) -> None:
        """Queue what makes the robot report and fire, in place of all that was queued."""
        self._setup_s = self._run_s
        self._queue.clear()
        self._queue += (
            report_request(round(1e6 * REPORT_PERIOD_S), _BOTH_AXES),
            input_request(_INPUT_PERIOD_US),
            SET_DEFAULTS,
            self._pattern.command,
        )

    def _abandon(self) -> None:
        """Drop all commands but a halt, and all that does not outlast an interruption."""
        self._queue.clear()
        self._drive, self._axes_left = None, 0
        self._is_moving = False
        self._brake.forget()
        self._stall.stop()
        self._pressed.clear()
        self.stamper.break_off()
        self._bad_at_sample = self._decoder.bad
        self._sent_s = self._report_s = self._sample_s = -math.inf

    def _supervise(self) -> None:
        """Detect a robot that is silent or does not receive, sonars that are, and a brake that stays on."""
        link, now_s = self._config.link, self._run_s
        silent_s, unanswered_s = now_s - self._sample_s, now_s - self._answer_s
        if silent_s > link.silence_max_s:
            others = self._report_s - self._sample_s > 0.5 * link.silence_max_s
            bad = self._decoder.bad - self._bad_at_sample
            self._begin(LineState.DOWN, line_diagnostics.silence(silent_s, others=others, bad=bad, heard=self.heard))
        elif unanswered_s > 2.0 * link.silence_max_s:
            self._begin(LineState.DOWN, diagnostics.not_receiving(unanswered_s))
        elif self._brake.mode is Mode.RELEASING and self._brake.tries > link.tries:
            self.halt()
            self._problem = diagnostics.BRAKE_STAYS_ON
        elif self._is_moving and now_s - self._driven_s > _DRIVEN_S:
            self._is_moving, self._drive = False, Twist(0.0, 0.0)
            self.stamper.note(diagnostics.NOT_DRIVEN)
        if self._config.rflex.bumpers and now_s - self._input_s > _INPUT_REQUEST_S:
            self._input_s = now_s
            self._queue.append(input_request(_INPUT_PERIOD_US))
        if now_s - self._echo_s > _SILENT_ECHO_S + 2e-6 * self._pattern.step_us:
            self._echo_s = now_s
            self._queue.append(self._pattern.command)
            self._note_once(diagnostics.NO_SONAR)

    def _take(self, frame: Frame) -> None:
        """Take in a frame; ranges that come before READY are dropped."""
        self._report_s, self.heard.has_frames = self._run_s, True
        match report_of(frame):
            case AxisReport() as axis:
                self._take_axis(axis)
            case SonarReport() as sonar:
                self._echo_s = self._run_s
                if self._state is LineState.READY:
                    self.stamper.sonar(sonar)
                    self._firings += self.stamper.firings(self._run_s)
            case Status() as status:
                self._answer_s = self._run_s
                self._volts = 0.01 * status.voltage + _VOLTS_OFFSET
                self._brake.observe_status(self._run_s, on=status.brake != 0)
                if self._brake.may_drive and self._problem == diagnostics.BRAKE_STAYS_ON:
                    self._problem = None
            case Input() as bits if bits.address in self._config.rflex.bumpers:
                self._pressed[bits.address] = bits.bits & self._config.rflex.bumper_mask
            case _:
                pass

    def _take_axis(self, report: AxisReport) -> None:
        """Take an axis; with a status and a byte of eight bits, the first sample makes the line READY."""
        flags = self._status()
        sample = self.stamper.axis(report, self._run_s, flags)
        if sample is Jump.BACK:
            self._restarted()
        if not isinstance(sample, Odometry):
            return
        self._sample_s, self._bad_at_sample = self._run_s, self._decoder.bad
        self.heard.clear()
        self._brake.observe_speed(sample.twist)
        self._stall.observe(sample.twist, self._run_s)
        if self._state is not LineState.READY:
            if self._brake.is_on is None or not (self._decoder.has_eighth_bit or self._decoder.lacks_eighth_bits):
                return
            self._meet()
        if self._state is LineState.READY:
            self._odometry, self._flags = sample, self._flags | flags
            self._firings += self.stamper.firings(self._run_s)

    def _meet(self) -> None:
        """Make the line READY, with the identity of the robot file; DOWN if its fail-safe is beyond the limits."""
        config = self._config
        wrong = line_diagnostics.deadman_refused(config.rflex.name, config.rflex.fail_safe_s, config.link)
        if wrong is not None or self._decoder.lacks_eighth_bits:
            self._state, self._problem = LineState.DOWN, wrong or diagnostics.SEVEN_BITS
            self.is_other_robot = wrong is not None
            return
        radius_m = max(math.hypot(mount.x_m, mount.y_m) for mount in config.ring.mounts)
        name, count, deadman_s = config.rflex.name, len(config.ring.mounts), config.rflex.fail_safe_s
        self._identity = Identity(name, count, radius_m, deadman_s, REPORT_PERIOD_S, self._boots)
        self._note_once(diagnostics.fail_safe(config.rflex.fail_safe_s))
        if config.body.synchro:
            self._note_once(diagnostics.SYNCHRO)
        self._state, self._problem, self._echo_s = LineState.READY, None, self._run_s

    def _restarted(self) -> None:
        """Begin anew with a robot whose clock went back; what it sent before is dropped."""
        self._boots += 1
        self._forget_received()
        self.stamper.note(diagnostics.RESTARTED)
        self._begin(LineState.HANDSHAKE, None)

    def _status(self) -> Flags:
        """Return the base's status; its brake is its latch."""
        status = {
            Flags.LATCHED: bool(self._brake.is_on),
            Flags.BUMPER: any(self._pressed.values()),
            Flags.MOTOR_FAULT: self._stall.is_stalled,
            Flags.BATTERY_LOW: self._volts < self._config.rflex.battery_low_v,
        }
        return Flags(sum(flag for flag, is_set in status.items() if is_set))
