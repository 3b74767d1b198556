"""Sensors on servos on the ring-and-base line: SCAN, ECHO3, and what a ring without servos makes of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_robot
from config.robot import RobotConfig
from drivers.contract.family import ROOM
from drivers.denning.device import DenningDevice
from drivers.denning.frames import Ack, Echo2, Echo3, Hello, Ident, Nak, Pattern, Scan, Sweep
from drivers.denning.wire_units import sweep_bearing, wire_pattern, wire_scan
from drivers.driver import LineState
from tests.drivers.cable import ROBOT, Cable
from tests.drivers.contract.families import SERVO1
from tests.drivers.device_host import WORLD, Host

SERVO1_FILE = load_robot("servo1")
SWEEP = Sweep(sensor=0, first=-31416, step=1047, bearings=60, endless=1)


def connected(robot: RobotConfig = SERVO1_FILE, version: int = 2) -> Host:
    h = Host(DenningDevice(robot, WORLD, 1))
    h.send(Hello, version)
    h.run(0.1)
    return h


def test_the_scan_of_a_robot_file_is_what_its_servo_is_asked_for() -> None:
    assert wire_scan(SERVO1_FILE.ring) == (SWEEP,)
    assert wire_pattern(SERVO1_FILE.ring).masks == (1,)
    angles = np.exp([1e-4j * sweep_bearing(SWEEP, k) for k in range(60)])
    assert np.abs(angles - np.exp([1j * mount.angle_rad for mount in SERVO1_FILE.ring.mounts])).max() < 0.005
    back = SWEEP._replace(first=0, bearings=3, endless=0)
    assert [sweep_bearing(back, k) for k in range(6)] == [0, 1047, 2094, 1047, 0, 1047]


def test_each_echo_of_a_scan_has_its_bearing_and_a_new_pattern_ends_the_scan() -> None:
    h = connected()
    assert h.last(Ident).sensors == 1
    assert h.last(Ident).capabilities == 2
    h.send(Pattern, 10, 55, (1,))
    h.run(0.2)
    assert {echo.counts for echo in h.of(Echo2)}
    assert not h.of(Echo3)
    asked = h.send(Scan, (SWEEP,))
    h.run(0.7)
    assert h.last(Ack).of == asked
    found = [echo.bearings[0] for echo in h.of(Echo3)]
    assert found[:60] == [sweep_bearing(SWEEP, k) for k in range(60)]
    assert len({echo.counts for echo in h.of(Echo3)}) > 5, "it looks elsewhere"
    h.send(Pattern, 10, 55, (1,))
    h.run(0.05)
    before = len(h.of(Echo3))
    h.run(0.2)
    assert len(h.of(Echo3)) == before


@pytest.mark.parametrize(
    ("sweep", "code"),
    [
        (SWEEP._replace(sensor=1), 3),
        (SWEEP._replace(bearings=1), 3),
        (SWEEP, 0),
    ],
)
def test_a_scan_that_the_ring_cannot_do_is_refused(sweep: Sweep, code: int) -> None:
    h = connected()
    asked = h.send(Scan, (sweep,))
    h.run(0.1)
    assert (h.last(Nak).code if code else h.last(Ack).of) == (code or asked)


@pytest.mark.parametrize(("robot", "version"), [(SERVO1_FILE, 1), (ROBOT, 1)])
def test_a_robot_that_knows_no_servos_does_not_know_the_command(robot: RobotConfig, version: int) -> None:
    h = connected(robot, version)
    h.send(Scan, (SWEEP,))
    h.run(0.1)
    assert h.last(Nak).code == 1


def test_a_ring_without_servos_is_refused_with_what_to_do() -> None:
    listed = [{"x_m": 0.02, "y_m": 0.0, "angle_deg": 0.0}]
    ring = SERVO1_FILE.ring.model_dump() | {"sensors": listed}
    fixed = RobotConfig.model_validate(SERVO1_FILE.model_dump() | {"ring": ring})
    cable = Cable((), SERVO1_FILE, world=ROOM, twist=None)
    cable.robot = DenningDevice(fixed, ROOM, 1)
    cable.plug()
    cable.run(1.0)
    assert cable.driver.state is not LineState.READY
    assert "knows no servos; flash the firmware" in str(cable.driver.problem)


def test_a_reading_goes_to_the_mount_of_its_bearing() -> None:
    cable = SERVO1.connected()
    cable.run(2.0)
    for firing in cable.firings:
        mounts = np.flatnonzero(~np.isnan(firing.ranges_m))
        assert len(mounts) == 1
    ahead = [firing.ranges_m[30] for firing in cable.firings if not math.isnan(firing.ranges_m[30])]
    assert ahead[0] == pytest.approx(2.48, abs=0.01), "the wall ahead, from the end of the arm"
