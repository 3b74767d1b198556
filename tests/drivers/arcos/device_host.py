"""An emulated Pioneer in virtual time, and a client that records its packets; shared by the tests of the device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

from config.robot import BodyConfig, RingConfig, RobotConfig
from config.world import WorldConfig
from drivers.arcos.codec import Decoder, decode_packet, encode
from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.device import ArcosDevice
from drivers.arcos.firmware import Firmware
from drivers.arcos.frames import Packet, Sip
from drivers.emulator.faults import Fault

P = TypeVar("P", bound=Packet)

MOUNTS = (
    (69, 136, 90), (114, 119, 50), (148, 78, 30), (166, 27, 10), (166, -27, -10), (148, -78, -30), (114, -119, -50),
    (69, -136, -90), (-157, -136, -90), (-203, -119, -130), (-237, -78, -150), (-255, -27, -170), (-255, 27, 170),
    (-237, 78, 150), (-203, 119, 130), (-157, 136, 90),
)  # fmt: skip
"""The discs of a p3dx: mm, mm, degrees."""
P3DX = Firmware("p3dx", 0.485, 1.0, 1.0, 0.0056, tuple(range(16)), baud=115200)
RING = RingConfig.model_validate({
    "sensors": [{"x_m": 1e-3 * x, "y_m": 1e-3 * y, "angle_deg": float(angle)} for x, y, angle in MOUNTS],
    "beam_half_angle_deg": 15.0, "resolution_m": 0.001, "range_min_m": 0.1, "range_max_m": 5.0,
    "firing": {"sets": [(k, 8 + k) for k in range(8)], "step_period_s": 0.04},
})  # fmt: skip
ROBOT = RobotConfig(ring=RING, body=BodyConfig(radius_m=0.25, speed_max_m_s=2.2, turn_max_rad_s=8.7))
SYNC = (Command(0), Command(1), Command(2))
SIP_S, WATCHDOG_S = 0.1, 2.0


class Client:
    """A client of the device.

    Attributes
    ----------
    heard
        Every packet with the time of its arrival.
    """

    def __init__(
        self,
        world: WorldConfig | None = None,
        faults: Sequence[Fault] = (),
        *,
        firmware: Firmware = P3DX,
        robot: RobotConfig = ROBOT,
        seed: int = 1,
    ) -> None:
        self.robot = ArcosDevice(robot, world or WorldConfig(), firmware, seed, faults)
        self.now = 0.0
        self.decoder = Decoder(decode_packet)
        self.heard: list[tuple[float, Packet]] = []
        self.raw = bytearray()

    def send(self, number: int, argument: int | bytes | None = None) -> None:
        self.robot.receive(encode(Command(number, argument)))

    def run(self, seconds: float, step: float = 0.005, pulse_s: float | None = None) -> None:
        """Let time pass, with a PULSE now and then."""
        until, pulse_at = self.now + seconds, self.now
        while self.now < until - 1e-9:
            if pulse_s is not None and self.now >= pulse_at:
                self.send(CommandNumber.PULSE)
                pulse_at += pulse_s
            self.now = min(until, self.now + step)
            data = self.robot.advance(self.now)
            self.raw += data
            self.heard += [(self.now, packet) for packet in self.decoder.feed(data)]

    def opened(self, *, motors: bool = False) -> Client:
        """Return this client with a session, and the motors on if so wanted."""
        for command in (*SYNC, Command(CommandNumber.OPEN)):
            self.robot.receive(encode(command))
            self.run(0.02)
        if motors:
            self.send(CommandNumber.ENABLE, 1)
        return self

    def of(self, kind: type[P]) -> list[P]:
        return [packet for _, packet in self.heard if isinstance(packet, kind)]

    def sip(self) -> Sip:
        """Return the last SIP."""
        return self.of(Sip)[-1]

    @property
    def twist(self) -> Any:
        return self.robot.truth.twist
