"""A driver of a Denning in virtual time, and on the other side a device whose every word the test says."""

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


class Bench:
    """A robot driver and, on the other side, a device whose every word the test says."""

    def __init__(self, config: RobotConfig = CONFIG) -> None:
        self.robot = DenningDriver(config)
        self.now = 100.0
        self.ident = IDENT
        self.last_drive = 0
        self._ears = Decoder("host")
        self._seq = 0

    def open(self) -> None:
        self._ears = Decoder("host")
        self.robot.line_opened(self.now)

    def state(self) -> LineState:
        return self.robot.state

    def heard(self, *, writable: bool = True) -> list[Frame]:
        """What the device hears now."""
        return self._ears.feed(self.robot.outgoing(writable=writable))

    @property
    def device_lost(self) -> int:
        return self._ears.lost + self._ears.bad

    def say(self, *frames: RobotFrame) -> None:
        for frame in frames:
            self.robot.receive(encode(replace(frame, seq=self._seq)), self.now)
            self._seq = (self._seq + 1) % 256

    def pass_time(self, seconds: float) -> None:
        self.now += seconds
        self.robot.tick(self.now)

    def answer(self) -> list[Frame]:
        """Answer as a good device does; return what it heard."""
        heard = self.heard()
        for frame in heard:
            match frame:
                case Hello():
                    self.say(self.ident)
                case Pattern() | Halt() | Release():
                    self.say(Ack(0, frame.seq))
                case _:
                    pass
        return heard

    def greet(self) -> None:
        for _ in range(2):
            self.answer()
        assert self.state() is LineState.READY

    def odom(self, t_us: int, **fields: int) -> None:
        self.say(replace(ODOM, t_us=t_us % 2**32, **fields))

    def run(self, seconds: float, *, t_us: int) -> int:
        """Let a good device drive on, odometry and all; return its clock."""
        for _ in range(round(seconds / 0.02)):
            t_us += PERIOD_US
            self.now += 0.02
            self.odom(t_us)
            self.robot.tick(self.now)
            self.answer()
        return t_us


def only(frames: list[Frame], kind: type[Frame]) -> list[Frame]:
    return [frame for frame in frames if isinstance(frame, kind)]
