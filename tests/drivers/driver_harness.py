"""A Denning's driver in virtual time, against a device whose every frame the test sends."""

from __future__ import annotations

from dataclasses import replace

from config.robot import BodyConfig, LinkConfig, RobotConfig
from drivers.denning.codec import Decoder, encode
from drivers.denning.driver import DenningDriver
from drivers.denning.frames import (
    Ack,
    Frame,
    Halt,
    Hello,
    Ident,
    Listen,
    Odom,
    Pattern,
    Release,
    RobotFrame,
)
from drivers.driver import LineState
from tests.drivers.ring import RING

CONFIG = RobotConfig(
    ring=RING,
    body=BodyConfig(radius_m=0.4, speed_max_m_s=0.6, turn_max_rad_s=1.0, synchro=True),
    link=LinkConfig(port="/dev/robot"),
)

IDENT = Ident(0, 1, 24, 381, 500, 20, 0xB001, "denning")

ODOM = Odom(0, 0, 0, 0, 0, 0, 0, 0, 0, 0)

PERIOD_US = 20_000


class DriverHarness:
    """A driver, and a device whose every frame the test sends."""

    def __init__(self, config: RobotConfig = CONFIG) -> None:
        self.robot = DenningDriver(config)
        self.now = 100.0
        self.ident = IDENT
        self.last_drive = 0
        self._decoder = Decoder("host")
        self._seq = 0

    def open(self) -> None:
        self._decoder = Decoder("host")
        self.robot.line_opened(self.now)

    def state(self) -> LineState:
        return self.robot.state

    def received(self, *, writable: bool = True) -> list[Frame]:
        """Return the frames that the driver sends now."""
        return self._decoder.feed(self.robot.outgoing(writable=writable))

    @property
    def device_lost(self) -> int:
        return self._decoder.lost + self._decoder.bad

    def send(self, *frames: RobotFrame) -> None:
        for frame in frames:
            self.robot.receive(encode(replace(frame, seq=self._seq)), self.now)
            self._seq = (self._seq + 1) % 256

    def pass_time(self, seconds: float) -> None:
        self.now += seconds
        self.robot.tick(self.now)

    def answer(self) -> list[Frame]:
        """Answer like a healthy device; return the frames that the driver sent."""
        frames = self.received()
        for frame in frames:
            match frame:
                case Hello():
                    self.send(self.ident)
                case Pattern() | Listen() | Halt() | Release():
                    self.send(Ack(0, frame.seq))
                case _:
                    pass
        return frames

    def handshake(self) -> None:
        for _ in range(2):
            self.answer()
        assert self.state() is LineState.READY

    def odom(self, t_us: int, **fields: int) -> None:
        self.send(replace(ODOM, t_us=t_us % 2**32, **fields))

    def run(self, seconds: float, *, t_us: int) -> int:
        """Run a healthy device that sends odometry; return its clock."""
        for _ in range(round(seconds / 0.02)):
            t_us += PERIOD_US
            self.now += 0.02
            self.odom(t_us)
            self.robot.tick(self.now)
            self.answer()
        return t_us


def only(frames: list[Frame], kind: type[Frame]) -> list[Frame]:
    return [frame for frame in frames if isinstance(frame, kind)]
