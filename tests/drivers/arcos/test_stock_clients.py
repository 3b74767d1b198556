"""What the known clients send, in their order and with their pauses: each connects, sees, drives and stops.

Their programs are not run here. That of Soar (PyPI) was, on a pty: a name in answer to its first CLOSE keeps it out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from config.world import WallConfig, WorldConfig
from drivers.arcos.codec import encode
from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.frames import ConfigPacket, IoPacket, RobotName, Sip, SipFlags, SyncEcho
from tests.drivers.arcos.device_host import P3DX, SYNC, Client

N = CommandNumber
WALL = WorldConfig(wall=(WallConfig(x1_m=3.0, y1_m=-3.0, x2_m=3.0, y2_m=3.0),))
NAME = RobotName("echolocate", "Pioneer", "p3dx")
AS_DELIVERED = replace(P3DX, baud=9600)


class Stock(Client):
    """A client of a robot with a wall ahead, on a line of 9600 baud."""

    def __init__(self) -> None:
        super().__init__(WALL, firmware=AS_DELIVERED)

    def says(self, command: Command, pause_s: float) -> list[object]:
        """Send a command and return the packets that come within the pause."""
        self.robot.receive(encode(command))
        before = len(self.heard)
        self.run(pause_s)
        return [packet for _, packet in self.heard[before:]]

    def synchronises(self, pause_s: float) -> None:
        """Each SYNC is answered before the next, and by nothing else."""
        for sync in SYNC:
            (answer,) = self.says(sync, pause_s)
            assert answer == (
                SyncEcho(sync.number) if sync.number < 2 else RobotName("echolocate", "Pioneer", "p3dx")
            )

    def refreshes(self, *commands: Command, seconds: float, period_s: float) -> None:
        for _ in range(round(seconds / period_s)):
            for command in commands:
                self.robot.receive(encode(command))
            self.run(period_s)

    def sees_the_wall(self) -> bool:
        newest = {reading.number: reading.range_raw for sip in self.of(Sip) for reading in sip.sonar}
        return 2000 < newest.get(3, 5000) < 3000


def wire(first: int, second: int) -> int:
    """Return two bytes as the signed number that ARIA and CARMEN make of them."""
    value = (first & 0xFF) << 8 | second & 0xFF
    return value - 0x10000 if value >= 0x8000 else value


def aria(client: Stock) -> None:
    """ARIA on a serial line: a modem is woken, the speed goes up, and the limits are those of the CONFIGpac."""
    client.robot.receive(b"WMS2\r")
    client.run(0.1)
    client.synchronises(0.09)
    client.says(Command(N.OPEN, 1), 0.0)
    (config,) = [p for p in client.says(Command(N.CONFIG, 1), 0.3) if isinstance(p, ConfigPacket)]
    assert config.auto_baud == 2
    client.says(Command(N.HOSTBAUD, 2), 0.01)
    assert client.says(Command(N.PULSE), 0.9), "else it goes back to 9600 baud"
    client.says(Command(N.BATTERYINFO, 1), 0.04)  # it needs no answer
    limits = (
        Command(N.SETV, config.speed_max), Command(N.SETA, 300), Command(N.SETA, -300),
        Command(N.SETRV, config.turn_max), Command(N.SETRA, 100), Command(N.SETRA, -100),
    )  # fmt: skip
    for command in (Command(N.ENABLE, 1), *limits):
        client.says(command, 0.005)
    client.refreshes(Command(N.VEL, 200), Command(N.RVEL, 0), seconds=2.0, period_s=0.5)
    assert client.sees_the_wall()
    assert abs(client.twist.v - 0.2) < 1e-3
    client.says(Command(N.ENABLE, 0), 0.09)
    client.says(Command(N.CLOSE, 1), 0.5)


def rosaria(client: Stock) -> None:
    """The ROS node on top of ARIA switches the sonar off until a topic is read, and sets the calibration."""
    client.synchronises(0.09)
    for command in (Command(N.OPEN, 1), Command(N.CONFIG, 1), Command(N.ENABLE, 1), Command(N.SONAR, 0)):
        client.says(command, 0.1)
    for number, value in ((93, 132), (89, 0), (88, 36300)):
        client.says(Command(number, value), 0.01)
    client.run(0.3)
    assert client.sip().sonar == ()
    client.says(Command(N.SONAR, 1), 0.0)
    client.refreshes(Command(N.VEL, 200), Command(N.RVEL, 0), seconds=2.0, period_s=0.5)
    assert client.sees_the_wall()
    client.says(Command(N.ENABLE, 0), 0.09)
    client.says(Command(N.CLOSE, 1), 0.5)


def p2os(client: Stock) -> None:
    """The p2os drivers read a packet for each command, and drive the wheels: raw bytes, also of negative speeds."""
    client.synchronises(0.2)
    client.says(Command(N.OPEN), 0.2)
    assert any(isinstance(p, Sip) for p in client.says(Command(N.PULSE), 0.2))
    for command in (Command(N.SONAR, 0), Command(N.SONAR, 1), Command(N.ENABLE, 1)):
        client.says(command, 0.1)
    for _ in range(20):
        assert client.says(Command(N.VEL2, 10 << 8 | 10), 0.11), "they wait for a packet after each command"
    assert client.sees_the_wall()
    assert abs(client.twist.v - 0.2) < 1e-3
    client.refreshes(Command(N.VEL2, (-10 & 0xFF) << 8 | 10), seconds=1.5, period_s=0.1)
    assert client.twist.w > 0.5
    client.says(Command(N.STOP), 0.0)
    client.says(Command(N.CLOSE), 0.5)


def p2os_finds_it_open(client: Stock) -> None:
    """Their CLOSE ends the session of one who left; then they begin again."""
    client.opened(motors=True)
    client.send(N.VEL, 300)
    client.run(1.0)
    client.says(SYNC[0], 0.2)  # a PULSE to this session
    client.says(Command(N.CLOSE), 0.4)
    p2os(client)


def carmen(client: Stock) -> None:
    """CARMEN sends what it commands as signed numbers, and a PULSE with each poll."""
    client.synchronises(0.1)
    for command in (
        Command(N.OPEN),
        Command(N.SONAR, 0),
        Command(N.PULSE),
        Command(N.ENABLE, 1),
        Command(N.SONAR, 1),
    ):
        client.says(command, 0.05)
    client.refreshes(Command(N.PULSE), Command(N.VEL2, wire(-5, 10)), seconds=1.5, period_s=0.1)
    assert client.twist.w > 0.3
    client.refreshes(Command(N.PULSE), Command(N.VEL2, wire(10, 10)), seconds=1.5, period_s=0.1)
    assert abs(client.twist.v - 0.2) < 1e-3
    client.says(Command(N.VEL2, 0), 0.5)
    client.says(Command(N.SONAR, 0), 0.0)
    client.says(Command(N.CLOSE), 0.5)


def soar(client: Stock) -> None:
    """Soar ends an earlier session first, takes any packet for an answer, and needs an IOpac and a CONFIGpac."""
    assert client.says(Command(N.CLOSE), 0.05) == [], "there is none to end: a name would be the answer to its SYNC0"
    client.synchronises(0.05)
    client.says(Command(N.OPEN), 0.2)
    client.says(Command(N.SONAR, 1), 1.0)
    assert client.sip().flags & SipFlags.SONAR_1
    client.says(Command(N.POLLING, bytes(range(1, 17))), 0.7)
    client.says(Command(N.ENABLE, 0), 0.0)
    (io, *_) = [p for p in client.says(Command(N.IOREQUEST, 2), 1.0) if isinstance(p, IoPacket)]
    assert len(io.digital_in) == 4, "inputs, front and rear bumpers, infrared"
    assert [p for p in client.says(Command(N.CONFIG), 1.0) if isinstance(p, ConfigPacket)]
    client.says(Command(N.ENABLE, 1), 1.0)
    assert client.sip().flags & SipFlags.MOTORS_ENABLED
    client.says(Command(N.SETO), 0.0)
    client.refreshes(Command(N.PULSE), Command(N.VEL, 200), seconds=2.0, period_s=0.1)
    assert client.sees_the_wall()
    assert abs(client.twist.v - 0.2) < 1e-3
    client.says(Command(N.STOP), 0.0)
    client.says(Command(N.ENABLE, 0), 0.5)
    client.says(Command(N.STOP), 0.0)
    client.says(Command(N.CLOSE), 0.5)


@pytest.mark.parametrize("session", [aria, rosaria, p2os, p2os_finds_it_open, carmen, soar])
def test_each_known_client_connects_sees_drives_and_stops(session: Callable[[Stock], None]) -> None:
    client = Stock()
    session(client)
    assert (client.twist.v, client.twist.w) == (0.0, 0.0)
    before = len(client.heard)
    client.run(1.0)
    assert len(client.heard) == before, "the session is over"
    client.synchronises(0.1)
