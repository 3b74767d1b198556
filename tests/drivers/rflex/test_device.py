"""The emulated controller: it reports when asked, moves with its brake off only, and stops by itself."""

from __future__ import annotations

import pytest

from config.load import load_robot
from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.contract.family import ROOM
from drivers.messages import Flags, Twist
from drivers.rflex.codec import (
    BRAKE_RELEASE,
    BRAKE_SET,
    STATUS_REQUEST,
    AxisReport,
    Decoder,
    Frame,
    Report,
    SonarReport,
    Status,
    encode,
    report_of,
    report_request,
    set_direction,
    sonar_run,
)
from drivers.rflex.device import RflexDevice

B21R = load_robot("b21r")


class Host:
    """Speaks to a device."""

    def __init__(self, robot: RobotConfig = B21R, world: WorldConfig = ROOM, clock_start_us: int = 0) -> None:
        self.robot = RflexDevice(robot, world, 1, clock_start_us=clock_start_us)
        self.decoder, self.now_s = Decoder(), 0.0

    def says(self, *frames: Frame) -> None:
        self.robot.receive(b"".join(map(encode, frames)))

    def hears(self, seconds: float) -> list[Report]:
        self.now_s += seconds
        return [report_of(frame) for frame in self.decoder.feed(self.robot.advance(self.now_s))]


def test_it_says_nothing_until_it_is_asked() -> None:
    host = Host()
    assert host.hears(1.0) == []
    host.says(STATUS_REQUEST)
    assert host.hears(0.1) == [Status(1_000_000, 2400, 1)]


def test_axes_are_reported_at_their_period_and_by_mask() -> None:
    host = Host()
    host.says(report_request(100_000, 3))
    reports = host.hears(1.01)
    assert [(report.axis, report.t_us) for report in reports if isinstance(report, AxisReport)] == [
        (axis, 100_000 * k) for k in range(1, 11) for axis in (0, 1)
    ]
    host.says(report_request(0, 0))
    assert host.hears(1.0) == []


def test_banks_fire_by_themselves_after_their_echo_delay() -> None:
    host = Host()
    host.says(sonar_run(30_000, 0))
    reports = [report for report in host.hears(0.125) if isinstance(report, SonarReport)]
    assert [report.t_us for report in reports] == [30_000, 60_000, 90_000, 120_000]
    assert [one for one, _ in reports[1].readings] == [1, 17, 33, 49, 65, 81]
    host.says(sonar_run(0, 0, on=False))
    assert host.hears(0.5) == []


def test_it_moves_with_its_brake_off_only_and_stops_by_itself() -> None:
    host = Host()
    drive = set_direction(0, 30369, 50615, 30000)
    host.says(drive)
    host.hears(0.5)
    assert host.robot.truth.twist == Twist(0.0, 0.0)
    host.says(BRAKE_RELEASE, drive)
    host.hears(0.9)
    assert host.robot.truth.twist.v == pytest.approx(0.3)
    host.hears(0.4)
    assert host.robot.truth.twist.v == 0.0
    assert host.robot.truth.flags & Flags.DEADMAN
    host.says(drive)
    host.hears(0.9)
    host.says(BRAKE_SET)
    host.hears(0.1)
    assert host.robot.truth.twist.v == 0.0


def test_set_pos_sets_the_counts() -> None:
    host = Host()
    host.says(report_request(100_000, 3), Frame(2, 8, bytes.fromhex("00 00000000 00000000 00000000 FFFFFF00")))
    first = host.hears(0.11)[0]
    assert isinstance(first, AxisReport)
    assert (first.axis, first.position) == (0, -256)


def test_packet_numbers_skip_the_escape() -> None:
    host = Host()
    numbers = []
    for _ in range(300):
        host.says(STATUS_REQUEST)
        host.now_s += 0.01
        numbers += [frame.number for frame in host.decoder.feed(host.robot.advance(host.now_s))]
    assert len(numbers) >= 298
    assert 0x1B not in numbers
