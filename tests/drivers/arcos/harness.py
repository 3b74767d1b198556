"""A Pioneer's driver in virtual time, against a controller that follows the protocol's tables and can misbehave."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from config.load import load_robot
from config.robot import RobotConfig
from drivers.arcos.codec import Decoder, decode_command, encode
from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.driver import ArcosDriver
from drivers.arcos.frames import (
    BAUDS,
    ConfigPacket,
    EncoderPacket,
    Packet,
    ResetNotice,
    RobotName,
    SipFlags,
    SonarReading,
    SyncEcho,
)
from drivers.driver import LineState, Received
from drivers.messages import Flags
from tests.drivers.arcos.vectors import P3DX, TAIL

P3DX_FILE = load_robot("p3dx")
OVER_TCP = P3DX_FILE.model_copy(update={"link": P3DX_FILE.link.model_copy(update={"port": "socket://robot:8101"})})
N = CommandNumber
STEP_S = 0.01
SIP_S = 0.1


class Controller:
    """A controller that answers like the real one: its session, its motors, its SIPs; what moves it is the test.

    Attributes
    ----------
    received
        All commands since they were last taken, in order.
    session
        What it waits for: "wait", "named" after SYNC2, or "open".
    answers_config, answers_encoder, follows_baud
        What this firmware knows.
    deaf, mute
        Whether its receiver or its transmitter is broken.
    sip
        The next SIP but for flags, velocity and sonar list.
    """

    def __init__(self, config: ConfigPacket | None = P3DX) -> None:
        self.received: list[Command] = []
        self.session = "wait"
        self.config = config
        self.name = RobotName("box", "Pioneer", "p3dx")
        self.answers_encoder = True
        self.deaf = self.mute = False
        self.baud = 9600
        self.sip = TAIL
        self.motors = False
        self.sonar = SipFlags.SONAR_1 | SipFlags.SONAR_2 | SipFlags.SONAR_3 | SipFlags.SONAR_4
        self.flags = SipFlags(0)
        self.speed = 0
        self.readings: tuple[SonarReading, ...] = ()
        self.obeys_stop = self.obeys_enable = True
        self._decoder = Decoder(decode_command)

    def reset(self) -> bytes:
        self.session, self.motors, self.speed = "wait", False, 0
        self.sip = replace(self.sip, x=0, y=0, heading=0)
        return encode(ResetNotice(0xFF))

    def next_sip(self) -> bytes:
        """Return the SIP that is due; nothing outside a session."""
        if self.session != "open" or self.mute:
            return b""
        flags = self.flags | self.sonar | (SipFlags.MOTORS_ENABLED if self.motors else 0)
        sip = replace(self.sip, flags=int(flags), left=self.speed, right=self.speed, sonar=self.readings)
        self.readings = ()
        return encode(sip)

    def receive(self, data: bytes) -> bytes:
        answers = b""
        for command in () if self.deaf else self._decoder.feed(data):
            self.received.append(command)
            for packet in self._answers(command):
                answers += encode(packet)
        return b"" if self.mute else answers

    def _answers(self, command: Command) -> tuple[Packet, ...]:
        number, value = command.number, command.value
        if self.session == "wait" and number in (N.PULSE, N.OPEN):
            return (SyncEcho(number),)
        if self.session == "wait" and number == N.CLOSE:
            self.session = "named"
            return (self.name,)
        if self.session == "named" and number == N.OPEN:
            self.session, self.motors = "open", False
        if self.session != "open":
            return ()
        match number:
            case N.CLOSE:
                self.session, self.motors, self.speed = "wait", False, 0
            case N.ENABLE if self.obeys_enable:
                self.motors = value == 1
                self.speed = self.speed if self.motors else 0
            case N.VEL if self.motors:
                self.speed = value
            case N.STOP | N.ESTOP if self.obeys_stop:
                self.speed = 0
            case N.SONAR:
                every = SipFlags.SONAR_1 | SipFlags.SONAR_2 | SipFlags.SONAR_3 | SipFlags.SONAR_4
                self.sonar = every if value & 1 else SipFlags(0)
            case N.HOSTBAUD:
                self.baud = BAUDS[value]
            case N.CONFIG if self.config is not None:
                return (self.config,)
            case N.ENCODER if self.answers_encoder:
                return (EncoderPacket(0, 0),)
        return ()


class Harness:
    """A driver and its controller on a line that has a speed, exchanged in steps of 10 ms."""

    def __init__(self, config: RobotConfig = P3DX_FILE, controller: Controller | None = None) -> None:
        self.driver = ArcosDriver(config)
        self.controller = Controller() if controller is None else controller
        self.now = 100.0
        self.received: list[Received] = []
        self.states: list[LineState] = []
        self.sip_period_s = SIP_S
        self._sip_s = 0.0

    def open(self) -> None:
        self.driver.line_opened(self.now)

    def exchange(self) -> list[Command]:
        """Send what the driver has to send; bytes at another speed than the controller's arrive as noise."""
        before = len(self.controller.received)
        baud = self.driver.line_baud
        data = self.driver.outgoing(writable=True)
        agrees = baud is None or baud == self.controller.baud
        self.to_driver(self.controller.receive(data if agrees else b"\xf3" * len(data)))
        return self.controller.received[before:]

    def to_driver(self, data: bytes) -> None:
        if data:
            baud = self.driver.line_baud
            agrees = baud is None or baud == self.controller.baud
            self.driver.receive(data if agrees else b"\xf3" * len(data), self.now)

    def run(self, seconds: float, each: Callable[[], None] | None = None) -> list[Command]:
        """Let time pass with all that belongs to it; return the commands that the controller received."""
        commands: list[Command] = []
        for _ in range(round(seconds / STEP_S)):
            self.now += STEP_S
            if self.now - self._sip_s >= self.sip_period_s - 1e-9:
                self._sip_s = self.now
                self.to_driver(self.controller.next_sip())
            self.driver.tick(self.now)
            if each is not None:
                each()
            commands += self.exchange()
            if self.states[-1:] != [self.driver.state]:
                self.states.append(self.driver.state)
            self.received.append(self.driver.take_received())
        return commands

    def ready(self) -> None:
        """Open the line and start a session."""
        self.open()
        self.run(3.0)
        assert self.driver.state is LineState.READY, self.driver.problem

    def arm(self) -> None:
        self.driver.release()
        self.run(0.3)
        assert Flags.LATCHED not in self.flags

    def state(self) -> LineState:
        return self.driver.state

    @property
    def flags(self) -> Flags:
        """The flags of the newest odometry."""
        return next(r.odometry.flags for r in reversed(self.received) if r.odometry is not None)

    @property
    def notes(self) -> list[str]:
        return [note for received in self.received for note in received.notes]

    @property
    def rebooted(self) -> bool:
        return any(received.rebooted for received in self.received)

    def sip(self, **fields: int) -> None:
        """Change what the next SIPs report."""
        self.controller.sip = replace(self.controller.sip, **fields)  # type: ignore[arg-type]


def numbers(commands: list[Command]) -> list[int]:
    return [command.number for command in commands]
