"""The start of a session: find the robot's line speed, SYNC0 to SYNC2, OPEN, its configuration, a faster line.

A robot that an earlier client left open may be moving, or its watchdog may have stopped it and the next command of
any kind sets it in motion again. Such a robot sends SIPs unasked. So the line is listened to first: a robot that
sends SIPs is stopped and its session closed; where bytes come at a wrong speed, each SYNC0 follows a STOP and an
ESTOP. On a silent line the first SYNC0 comes alone, because some simulators take the first packet of a session,
whatever it is, for a SYNC and count on. A robot that has not answered that one may be open and mute: STOP and ESTOP
come before the next.
"""

from __future__ import annotations

from enum import Enum
from typing import Final

from config.robot import LinkConfig
from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.frames import BAUDS, ConfigPacket, Packet, RobotName, Sip, SyncEcho

STOP: Final = (Command(CommandNumber.STOP), Command(CommandNumber.ESTOP))
"""Stops the base by set-point and with its greatest deceleration; firmware may lack the second."""
CLOSE: Final = (Command(CommandNumber.CLOSE, 1),)
"""Ends a session; the argument distinguishes it from SYNC2."""

_LIKELY_BAUDS: Final = (9600, 38400, 115200, 19200, 57600)
"""Speeds at which a robot may listen, the likely ones first."""
_LISTEN_S: Final = 0.25
"""Time to listen before the first SYNC0, s: two and a half times the usual period of SIPs."""
_SOCKET_REPLY_S: Final = 1.0
"""Least time for the answer to a SYNC over a network, s, as other clients wait: nothing is lost there, simulators
take up to 0.2 s on an idle computer, and one that counts packets never answers after a repeated SYNC."""
_CLOSING_S: Final = 0.2
"""Time after CLOSE until the robot waits for SYNC0, s."""
_CONFIG_S: Final = 0.21
"""Time for the answer to CONFIG, s."""
_CONFIG_TRIES: Final = 5
"""How often that is requested."""
_SWITCH_S: Final = 0.05
"""Time until HOSTBAUD has left and the robot has changed its speed, s."""
_FOLLOW_S: Final = 0.9
"""Longest time until the robot is heard at the new speed, s."""
_AUTO_BAUD: Final = 2
"""The value of the CONFIGpac's field if the host may change the speed."""


class Stage(Enum):
    """What is sent next, or answered next."""

    LISTENING = "listening"
    CLOSING = "CLOSE"
    SYNC0 = "SYNC0"
    SYNC1 = "SYNC1"
    SYNC2 = "SYNC2"
    CONFIG = "CONFIG"
    HOSTBAUD = "HOSTBAUD"
    FOLLOWING = "following"
    DONE = "done"


class Handshake:
    """One attempt after the other to start a session; a sans-I/O object like the driver.

    Parameters
    ----------
    link
        Gives the speed that the line should have, and the robot's time to answer.
    has_speed
        Whether the line has a speed that can be changed, as a socket has not.

    Attributes
    ----------
    stage
        Of the present attempt.
    bauds
        The speeds that are tried, the likeliest first; none on a line without one.
    baud
        The line's present speed.
    sweeps
        How often no speed led to an answer.
    name, config
        What the robot said of itself in this session; None if it did not.
    was_open
        Whether the robot was in a session when it was called.
    keeps_baud
        Whether the robot did not follow to the speed of `link`.
    failures
        How often a robot that answers left a later stage unanswered, since `restart`.
    unanswered
        The last such stage.
    """

    def __init__(self, link: LinkConfig, *, has_speed: bool) -> None:
        self.bauds = tuple(dict.fromkeys((_LIKELY_BAUDS[0], link.baud, *_LIKELY_BAUDS))) if has_speed else ()
        self.baud = link.baud
        self.stage = Stage.LISTENING
        self.sweeps = self.failures = 0
        self.unanswered = Stage.SYNC1
        self.name: RobotName | None = None
        self.config: ConfigPacket | None = None
        self.was_open = self.keeps_baud = False
        self._link = link
        self._run_s = self._since_s = 0.0
        """Now, and when the stage was entered or its last command sent."""
        self._tries = 0
        """How often it was sent in this stage."""
        self._is_due = False
        """Whether it is to be sent."""
        self._is_wary = False
        """Whether the base may move, so that a stop goes before the first SYNC."""
        self._reply_s = link.reply_timeout_s if has_speed else max(link.reply_timeout_s, _SOCKET_REPLY_S)
        """Time after which a SYNC counts as unanswered."""
        self._slow_baud = link.baud
        """The speed before HOSTBAUD, to return to."""
        self._is_sending = False
        """Whether the robot sends already, so that it needs no OPEN."""
        self._order = self.bauds
        """The speeds in the order of this attempt."""

    @property
    def is_syncing(self) -> bool:
        """Whether another command could break the sequence of SYNCs; it stops a base that may move itself."""
        return self.stage in {Stage.LISTENING, Stage.CLOSING, Stage.SYNC0, Stage.SYNC1, Stage.SYNC2}

    def start(self, run_s: float) -> None:
        """Begin on a line that was just opened, at the likeliest speed."""
        if self.bauds:
            self.baud = self.bauds[0]
        self.resume(run_s)

    def resume(self, run_s: float) -> None:
        """Begin on a line that was opened again, at the speed that its robot had."""
        self.restart(run_s)
        self._is_wary = False
        self._listen()

    def restart(self, run_s: float) -> None:
        """Begin again on the same line, at the present speed first: stop the base at once, as it may still move."""
        self._run_s, self.sweeps, self.failures, self._is_wary = run_s, 0, 0, True
        self._order = tuple(dict.fromkeys((self.baud, *self.bauds))) if self.bauds else ()
        self.name = self.config = None
        self.was_open = self.keeps_baud = self._is_sending = False
        self._enter(Stage.SYNC0)

    def give_up(self, run_s: float) -> None:
        """Begin again, as the session that was opened brings nothing."""
        failures = self.failures
        self.restart(run_s)
        self.failures = failures
        self._fail(Stage.DONE)

    def commands(self) -> tuple[Command, ...]:
        """Return the commands to send now, and consider them sent; those of one call belong into one write."""
        if not self._is_due:
            return ()
        self._is_due, self._since_s = False, self._run_s
        self._tries += 1
        match self.stage:
            case Stage.CLOSING:
                return *STOP, *CLOSE
            case Stage.SYNC0:
                return *(STOP if self._is_wary or self._tries > 1 else ()), Command(CommandNumber.PULSE)
            case Stage.SYNC1:
                return (Command(CommandNumber.OPEN),)
            case Stage.SYNC2:
                return (Command(CommandNumber.CLOSE),)
            case Stage.CONFIG:
                opening = () if self._is_sending else (Command(CommandNumber.OPEN, 1),)
                return *opening, Command(CommandNumber.CONFIG, 1)
            case Stage.HOSTBAUD:
                return (Command(CommandNumber.HOSTBAUD, BAUDS.index(self._link.baud)),)
            case Stage.FOLLOWING:
                return (Command(CommandNumber.PULSE),)
            case _:
                return ()

    def tick(self, run_s: float) -> None:
        """Let time pass: repeat what is unanswered, try other speeds, give up what the robot lacks."""
        self._run_s = run_s
        waited_s = run_s - self._since_s
        if self._is_due or self.stage is Stage.DONE:
            return
        match self.stage:
            case Stage.LISTENING:
                if waited_s >= _LISTEN_S:
                    self._enter(Stage.SYNC0)
            case Stage.CLOSING:
                if waited_s >= _CLOSING_S:
                    self._is_wary = False
                    self._listen()
            case Stage.CONFIG:
                if waited_s >= _CONFIG_S:
                    self._repeat_config()
            case Stage.HOSTBAUD:
                if waited_s >= _SWITCH_S:
                    self._slow_baud, self.baud = self.baud, self._link.baud
                    self._enter(Stage.FOLLOWING)
            case Stage.FOLLOWING:
                if waited_s >= _FOLLOW_S:
                    self.baud, self.keeps_baud = self._slow_baud, True
                    self._enter(Stage.DONE)
            case _:
                if waited_s >= self._reply_s:
                    self._repeat_sync()

    def hear_noise(self) -> None:
        """Take bytes that are no packet: a robot in a session, at another speed of the line."""
        if self.stage is Stage.LISTENING and self.bauds:
            self._is_wary = True
            self._enter(Stage.SYNC0)

    def take(self, packet: Packet) -> None:
        """Take a packet from the robot."""
        stage = self.stage
        match packet:
            case SyncEcho(0) if stage is Stage.SYNC0:
                self._enter(Stage.SYNC1)
            case SyncEcho(1) if stage is Stage.SYNC1:
                self._enter(Stage.SYNC2)
            case RobotName() if stage is Stage.SYNC2:
                self.name = packet
                self._enter(Stage.CONFIG)
            case Sip() if stage in {Stage.LISTENING, Stage.SYNC0, Stage.SYNC1, Stage.SYNC2}:
                if self.was_open:
                    self._fail(Stage.CLOSING)
                self.was_open = True
                self._enter(Stage.CLOSING)
            case Sip() if stage is Stage.CONFIG:
                self._is_sending = True
            case ConfigPacket() if stage is Stage.CONFIG:
                self.config = packet
                self._is_sending = True
                self._enter(Stage.HOSTBAUD if self._may_switch(packet) else Stage.DONE)
        if stage is Stage.FOLLOWING:
            self._enter(Stage.DONE)

    def _may_switch(self, config: ConfigPacket) -> bool:
        baud = self._link.baud
        return config.auto_baud == _AUTO_BAUD and baud in BAUDS and bool(self.bauds) and baud > self.baud

    def _enter(self, stage: Stage) -> None:
        self.stage, self._is_due, self._tries = stage, True, 0

    def _listen(self) -> None:
        self._enter(Stage.LISTENING)
        self._is_due, self._since_s = False, self._run_s

    def _fail(self, stage: Stage) -> None:
        self.failures, self.unanswered, self._is_wary = self.failures + 1, stage, True

    def _repeat_sync(self) -> None:
        """Repeat a SYNC; after the last try of SYNC0 at another speed, and of the others from the beginning."""
        self._is_due = True
        if self._tries < self._link.tries:
            return
        self._tries = 0
        if self.stage is not Stage.SYNC0:
            self._fail(self.stage)
            self.stage = Stage.SYNC0
        elif self._order:
            following = (self._order.index(self.baud) + 1) % len(self._order)
            self.baud = self._order[following]
            self.sweeps += following == 0
        else:
            self.sweeps += 1

    def _repeat_config(self) -> None:
        """Request the configuration again; go on without it, or from the beginning if nothing comes at all."""
        if self._tries < _CONFIG_TRIES:
            self._is_due = True
        elif self._is_sending:
            self._enter(Stage.DONE)
        else:
            self._fail(Stage.CONFIG)
            self._enter(Stage.SYNC0)
