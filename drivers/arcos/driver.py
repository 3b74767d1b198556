"""The driver for the Pioneer family: session, commands, supervision; without I/O and without a clock.

A Pioneer acknowledges nothing but the SYNCs. What a command did is seen in later SIPs, so that a stop is repeated
until the SIPs report that the base stands with its motors off. The base's own watchdog is slow, 2 s as delivered: so
on every fault that this driver finds, it stops the base itself.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import Final

from config.files import one_line
from config.robot import RingConfig, RobotConfig
from drivers import line_diagnostics
from drivers.arcos import diagnostics
from drivers.arcos.codec import Decoder, decode_packet, encode
from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.frames import EncoderPacket, Packet, ResetNotice, Sip, SipFlags
from drivers.arcos.handshake import CLOSE, STOP, Handshake, Stage
from drivers.arcos.line_load import SIP_BYTES, traffic_of
from drivers.arcos.pose_stamping import SIP_PERIOD_S, PoseStamper
from drivers.arcos.supervision import DiscMonitor, Enabling, Halting, ReceiverMonitor
from drivers.arcos.wire_units import (
    RANGE_UNIT_M,
    discs_of,
    drive_commands,
    flags_of,
    limit_commands,
    limits_of,
    polling_of,
)
from drivers.base_model import stop_s
from drivers.driver import DriverError, LineState
from drivers.line_budget import refuse_slow_line
from drivers.messages import Identity, LinkCounts, Twist
from drivers.session import Session

_PULSE_S: Final = 0.5
"""Longest time without a command, s: a quarter of the watchdog."""
_INCOMPLETE_S, _PAUSE_S = 0.25, 0.03
"""After so long without a packet, and so long without a byte, the rest of an incomplete packet does not come, s."""
_CALLING_S: Final = 2.0
"""Shortest time for which the robot is called before the line counts as down, s."""
_OPENING_S: Final = 1.0
"""Longest time from the end of the handshake until the first SIP, s."""
_REFUSED_S: Final = 2.0
"""Time until a robot that was refused is asked again, s: another one may have been plugged in."""
_SONAR_S: Final = 0.5
"""Time from one attempt to switch the sonar on to the next, s."""
_MOVING_MORE_S: Final = 1.0
"""Time that a halted base may move beyond that in which it brakes as its file says, s: it hears and reports late."""


class ArcosDriver(Session[PoseStamper]):
    """A `drivers.driver.RobotDriver` for the Pioneer family.

    Raises
    ------
    drivers.firing_pattern.FiringError
        The ring or the robot's arrays cannot carry out the firing pattern.
    DriverError
        The numbers of the discs do not fit the ring.
    """

    def __init__(self, config: RobotConfig) -> None:
        self._config = config
        self._discs = discs_of(config)
        self._disc_monitor = DiscMonitor(self._discs)
        finer = line_diagnostics.finer_than_line(config.ring.resolution_m, RANGE_UNIT_M)
        if finer is not None:
            raise DriverError(finer)
        super().__init__(PoseStamper(config, self._discs), config.link.silence_max_s)
        self._polling = polling_of(config, self._discs)
        refuse_slow_line(config.link, SIP_BYTES / SIP_PERIOD_S, *traffic_of(self._polling, self._discs))
        self._handshake = Handshake(config.link, has_speed="://" not in (config.link.port or ""))
        self._limits = limits_of(config.body, None)
        fastest = Twist(config.body.speed_max_m_s, config.body.turn_max_rad_s)
        self._moving_max_s = stop_s(fastest, config.body) + _MOVING_MORE_S
        self._decoder = Decoder(decode_packet)
        self._boots = 0
        # Of the last command sent, and of the last bytes, packet and SIP received:
        self._sent_s = self._data_s = self._packet_s = self._sip_s = 0.0
        self._called_s = self._refused_until_s = self._sonar_on_s = -math.inf
        self._queue: deque[Command] = deque()  # commands that can wait, one a call of `outgoing`
        self._is_set_up = self._is_first_sip = False  # is_first_sip: the next one will be the session's first
        self._has_session = self._was_reset = self._is_ending = False  # was_reset: since the session began
        self._halting, self._enabling, self._receiver = Halting(), Enabling(), ReceiverMonitor()
        self._bad_at_sip = self._battery = self._failures = 0
        self._heard_baud = 0  # the line's speed when bytes came last
        self.stamper.set_polling(self._polling)

    @property
    def problem(self) -> str | None:
        """What is wrong, in one line; None if nothing is."""
        moving_s = self._halting.moving_s(self._run_s)
        if self.state is LineState.READY and moving_s > self._moving_max_s:
            return diagnostics.not_stopping(moving_s)
        if self.state is LineState.READY and self._problem is None and self._disc_monitor.are_others:
            return diagnostics.other_discs(self._discs)
        return super().problem

    @property
    def battery_v(self) -> float | None:
        """The battery's voltage by the last SIP, V; None before the first, or if it has none."""
        return 0.1 * self._battery if self._battery else None

    @property
    def _line_counts(self) -> LinkCounts:
        return LinkCounts(self._decoder.frames, self._decoder.bad, 0)  # frames have no numbers to show lost ones

    @property
    def line_baud(self) -> int | None:
        """The speed that the line must have now; None on a line without one."""
        return self._handshake.baud if self._handshake.bauds else None

    def line_opened(self, run_s: float) -> None:
        """Start the handshake on a line that has just been opened."""
        super().line_opened(run_s)
        self._called_s = self._packet_s = run_s
        self._state, self._problem = LineState.HANDSHAKE, None
        self._is_ending = False
        self._refused_until_s = -math.inf
        if self._has_session:  # the robot has kept the speed
            self._handshake.resume(run_s)
        else:
            self._handshake.start(run_s)

    def line_closed(self) -> None:
        """Forget commands in progress; only a halt is kept for the next line until the base has confirmed it."""
        self._earlier_counts = self.counts
        self._decoder = Decoder(decode_packet)
        self._state = LineState.CLOSED
        self._abandon()

    def receive(self, data: bytes, run_s: float) -> None:
        """Take bytes from the line, split anywhere."""
        self._run_s = self._data_s = run_s
        if self._state is LineState.CLOSED:
            return
        if self._heard_baud != self._handshake.baud:
            self._heard_baud = self._handshake.baud
            self.heard.begin_speed()
        self.heard.received(data)
        for packet in self._decoder.feed(data):
            self._take(packet)

    def tick(self, run_s: float) -> None:
        """Let time pass: go on with the handshake; stop the base and go DOWN if the robot is silent for too long."""
        self._run_s = run_s
        if self._state is LineState.CLOSED:
            return
        if self._decoder.pending and run_s - self._packet_s > _INCOMPLETE_S and run_s - self._data_s > _PAUSE_S:
            for packet in self._decoder.skip():
                self._take(packet)
        if self._state is LineState.READY:
            self._supervise()
        elif run_s >= self._refused_until_s:
            if self.heard.total and not self._decoder.frames:
                self._handshake.hear_noise()
            self._handshake.tick(run_s)
            self._go_on()

    def halt(self) -> None:
        """Stop the base at once, repeat that until it stands, then switch its motors off."""
        self._drive = None
        self._enabling.withdraw()
        self._halting.start()

    def release(self) -> None:
        """Switch the motors on; without effect unless READY, so that the base is never released unnoticed."""
        if self._state is LineState.READY:
            self._halting.cancel()
            self._enabling.release()

    def set_firing(self, ring: RingConfig) -> None:
        """Change the firing pattern to that of `ring`; does nothing if it is the current one.

        Raises
        ------
        drivers.firing_pattern.FiringError
            The ring or the robot's arrays cannot carry out the pattern; the current one stays.
        """
        polling = polling_of(self._config.model_copy(update={"ring": ring}), self._discs)
        if polling == self._polling:
            return
        self._polling = polling
        self.stamper.set_polling(polling)
        if self._is_set_up:
            self._queue += polling.commands

    def end_session(self) -> None:
        """Stop the base and end the session: the robot then waits for its next client."""
        self._is_ending = self._state is not LineState.CLOSED

    def outgoing(self, *, writable: bool) -> bytes:
        """Return the bytes to send now, and consider them sent; only stops while the line is not `writable`."""
        if self._state is LineState.CLOSED:
            self._drive = None
            return b""
        if self._is_ending:
            self._is_ending, self._has_session, self._state = False, False, LineState.CLOSED
            farewell = () if self._handshake.is_syncing else (Command(CommandNumber.ENABLE, 0), *CLOSE)
            return b"".join(map(encode, (*STOP, *farewell)))
        is_syncing = self._handshake.is_syncing
        commands = () if is_syncing and writable else self._halting.commands(self._run_s)
        if writable:
            commands += self._due_commands()
        data = b"".join(map(encode, commands))
        if commands:
            self._sent_s = self._run_s
        if len(commands) > 1:  # a SYNC, which the robot does echo, is sent alone
            self.heard.sent(data)
        return data

    def _due_commands(self) -> tuple[Command, ...]:
        """Remove and return the commands that are due besides a stop; one at a time of those that can wait."""
        commands: tuple[Command, ...] = ()
        drive, self._drive = self._drive, None
        if self._state is not LineState.READY and self._run_s >= self._refused_until_s:
            commands += self._handshake.commands()
        if self._queue:
            commands += (self._queue.popleft(),)
        if self._state is not LineState.READY:
            return commands
        commands += self._enabling.commands(self._run_s)
        if drive is not None and self._enabling.may_drive and not self._halting.is_active:
            commands += drive_commands(drive, self._limits)
        commands += self._receiver.commands(self._run_s)
        if not commands and self._run_s - self._sent_s >= _PULSE_S:
            commands += (Command(CommandNumber.PULSE),)
        return commands

    def _supervise(self) -> None:
        """Detect a robot that is silent, one that does not receive, and motors that do not switch on."""
        silence_max_s = self._config.link.silence_max_s
        silent_s, unanswered_s = self._run_s - self._sip_s, self._receiver.unanswered_s(self._run_s)
        if silent_s > silence_max_s:
            others = self._packet_s - self._sip_s > 0.5 * silence_max_s
            bad = self._decoder.bad - self._bad_at_sip
            self._go_down(line_diagnostics.silence(silent_s, others=others, bad=bad, heard=self.heard))
        elif unanswered_s > 2.0 * silence_max_s:
            self._go_down(diagnostics.not_receiving(unanswered_s))
        elif self._enabling.tries > self._config.link.tries:
            self._enabling.withdraw()
            self._problem = diagnostics.MOTORS_STAY_OFF

    def _abandon(self) -> None:
        """Drop all commands but a halt, and all that does not outlast an interruption."""
        self._queue.clear()
        self._drive, self._is_set_up = None, False
        self._enabling, self._receiver, self._disc_monitor = Enabling(), ReceiverMonitor(), DiscMonitor(self._discs)
        self.stamper.break_off()
        self._bad_at_sip = 0

    def _go_down(self, problem: str) -> None:
        """Give the session up: stop the base, whether it hears that or not, and call the robot again."""
        self._state, self._problem = LineState.DOWN, problem
        self._abandon()
        self.halt()
        self._handshake.restart(self._run_s)

    def _refuse(self, problem: str, *farewell: Command) -> None:
        self._go_down(problem)
        self._queue += farewell
        self._has_session, self.is_other_robot = False, True
        self._refused_until_s = self._run_s + _REFUSED_S

    def _take(self, packet: Packet) -> None:
        """Take in a packet: a reset begins anew, others serve the handshake, odometry and the measure of the line."""
        self._packet_s, self.heard.has_frames = self._run_s, True
        if isinstance(packet, ResetNotice):
            self._was_reset = True
            if self._state is LineState.READY:
                self.stamper.note(diagnostics.RESET)
            self._go_down(diagnostics.RESET)
            self._state = LineState.HANDSHAKE
            return
        if self._state is not LineState.READY and self._run_s >= self._refused_until_s:
            self._handshake.take(packet)
            self._go_on()
        if isinstance(packet, Sip):
            self._halting.observe(packet)
            if self._state is LineState.READY or (self._is_set_up and not self._queue):
                self._take_sip(packet)
        elif isinstance(packet, EncoderPacket):
            self._receiver.answered()

    def _go_on(self) -> None:
        """Follow the handshake: check what the robot says, and set it up at the end."""
        handshake = self._handshake
        self._judge_progress()
        if handshake.stage is Stage.CONFIG and handshake.name is not None:
            wrong = diagnostics.wrong_robot(handshake.name, self._config)
            if wrong is not None:
                self._refuse(wrong)
        elif handshake.stage is Stage.DONE and not self._is_set_up:
            self._set_up()
        elif handshake.stage is Stage.DONE and self._run_s - self._sip_s > _OPENING_S:
            self._abandon()
            handshake.give_up(self._run_s)

    def _judge_progress(self) -> None:
        """Go DOWN if the robot has long been called and leaves a stage unanswered, and up again once it answers."""
        handshake, stages = self._handshake, tuple(Stage)
        is_late = self._run_s - self._called_s >= _CALLING_S
        has_failed = handshake.failures > self._failures
        self._failures = handshake.failures
        is_called_in_vain = handshake.stage is Stage.SYNC0 and handshake.sweeps and self._state is LineState.HANDSHAKE
        if is_late and (has_failed or is_called_in_vain):
            stage, bauds, self._state = handshake.unanswered, handshake.bauds, LineState.DOWN
            if handshake.failures:
                self._problem = lambda: diagnostics.unanswered(stage, self.heard)
            else:
                self._problem = lambda: diagnostics.no_answer(bauds, self._newest_frames(), self.heard)
        elif self._state is LineState.DOWN:
            answered = handshake.unanswered if handshake.failures else Stage.SYNC0
            if stages.index(handshake.stage) > stages.index(answered):
                self._state = LineState.HANDSHAKE

    def _newest_frames(self) -> int:
        """Return how many packets were received, 0 if that was long ago."""
        return self._decoder.frames if self._run_s - self._packet_s < line_diagnostics.RECENT_S else 0

    def _set_up(self) -> None:
        """Check and adopt what the robot reports of itself, and queue the commands that set it up."""
        handshake, config = self._handshake, self._config
        packet, name = handshake.config, handshake.name
        shown = one_line((name and (name.name or name.subclass)) or "Pioneer")
        wrong = diagnostics.wrong_watchdog(shown, packet, config)
        if wrong is not None:
            self._refuse(wrong, *STOP, *CLOSE)
            return
        if packet is None:
            self._note_once(diagnostics.NO_CONFIG)
        if name is not None and name.subclass is None and config.arcos.subclasses:
            self._note_once(diagnostics.NO_MODEL)
        if handshake.keeps_baud:
            self._note_once(diagnostics.BAUD_KEPT.format(config.link.baud, handshake.baud))
        deadman_s = diagnostics.deadman_s(packet)
        self._note_once(diagnostics.watchdog_note(deadman_s))
        period_s = 1e-3 * ((packet and packet.sip_cycle_ms) or 1e3 * SIP_PERIOD_S)
        radius_m = max(math.hypot(mount.x_m, mount.y_m) for mount in config.ring.mounts)
        self._identity = Identity(
            shown, len(self._discs), radius_m, deadman_s, period_s, self._boots, diagnostics.traits(packet, name)
        )
        self.stamper.set_period(period_s)
        self._limits = limits_of(config.body, packet)
        self._queue += (
            Command(CommandNumber.ENABLE, 0),
            *limit_commands(config.body, packet, self._limits),
            Command(CommandNumber.BUMPSTALL, 3),
            Command(CommandNumber.SONAR, 1),
            *self._polling.commands,
        )
        self._is_set_up = self._is_first_sip = True
        self._sip_s = self._sonar_on_s = self._run_s

    def _take_sip(self, sip: Sip) -> None:
        """Take odometry, status and ranges of a SIP; the first one of a session makes the line READY."""
        if self._is_first_sip:
            self._begin_session(sip)
        packet, after_loss = self._handshake.config, self._decoder.bad != self._bad_at_sip
        flags = flags_of(sip, (packet and packet.low_battery) or 0)
        self._odometry, firings = self.stamper.sip(sip, self._run_s, flags, self.line_baud, after_loss=after_loss)
        self._sip_s, self._bad_at_sip = self._run_s, self._decoder.bad
        self.heard.clear()
        self._flags |= flags
        self._battery = sip.battery_10 or sip.battery
        self._firings += firings
        self._disc_monitor.observe(sip, is_set_up=not self._queue)
        if self._disc_monitor.are_others:
            self._note_once(diagnostics.other_discs(self._discs))
        self._follow_status(SipFlags(sip.flags))

    def _begin_session(self, sip: Sip) -> None:
        was_lost = self._has_session and not self._handshake.was_open
        if self.stamper.begin_session(sip, was_reset=self._was_reset, was_lost=was_lost):
            self._boots += 1
            self._forget_received()
            if self._identity is not None:
                self._identity = replace(self._identity, boot_id=self._boots)
        self._has_session, self._is_first_sip, self._was_reset = True, False, False
        self._state, self._problem = LineState.READY, None

    def _follow_status(self, status: SipFlags) -> None:
        """Act on what the robot reports of its motors and its sonar."""
        self._enabling.observe(status, self._run_s)
        if self._enabling.are_on and self._problem == diagnostics.MOTORS_STAY_OFF:
            self._problem = None
        if status & SipFlags.STOP_BUTTON:
            self._problem = diagnostics.STOP_PRESSED
        elif self._problem == diagnostics.STOP_PRESSED:
            self._problem = None
        if self._polling.arrays & ~status and self._run_s - self._sonar_on_s > _SONAR_S:
            self._sonar_on_s = self._run_s
            self._queue.append(Command(CommandNumber.SONAR, 1))
            self._note_once(diagnostics.SONAR_OFF)
