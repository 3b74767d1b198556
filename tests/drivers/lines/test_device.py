"""The emulated robot that speaks lines: its deadman, its faults, and what counts as an echo; see the contract."""

from __future__ import annotations

import pytest

from config.world import WorldConfig
from drivers.contract.family import script
from drivers.emulator.faults import Fault
from drivers.lines.device import LineDevice
from drivers.lines.wire import Sample
from drivers.messages import Flags, Twist
from tests.drivers.lines.json_robot import ROBOT, wire

LINES = wire()
AHEAD = LINES.velocity(Twist(0.3, 0.0))


def device(*faults: Fault, deadman_s: float | None = 0.5) -> LineDevice:
    lines = wire()
    lines.deadman_s = deadman_s
    return LineDevice(ROBOT, WorldConfig(), 1, faults, lines)


@pytest.mark.parametrize(("deadman_s", "stands"), [(0.5, True), (None, False)])
def test_without_a_deadman_of_its_own_it_drives_on(deadman_s: float | None, *, stands: bool) -> None:
    robot = device(deadman_s=deadman_s)
    robot.receive(AHEAD)
    robot.advance(3.0)
    assert (robot.truth.twist.v == 0.0) is stands
    assert robot.truth.pose.x > 0.05


def test_a_contact_stops_it_and_is_reported() -> None:
    robot = device(*script(kind="bumper", at_s=0.5, duration_s=9.0), deadman_s=None)
    robot.receive(AHEAD)
    robot.advance(3.0)
    assert robot.truth.twist.v == 0.0
    assert robot.truth.flags & Flags.BUMPER


def test_echoes_and_velocities_are_counted() -> None:
    robot = device()
    said, counter = robot.advance(0.5), robot.frame_counter()
    samples = sum(isinstance(LINES.read(line), Sample) for line in said.split(b"\n")[:-1])
    assert counter.echoes(said) == said.count(b"\n") - samples > 5
    assert counter.drives(AHEAD + b"noise\n" + AHEAD) == 2
