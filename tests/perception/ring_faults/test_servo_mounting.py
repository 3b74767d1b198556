"""How a sensor on a servo is mounted: what the motion of a robot that winds excludes, and what it finds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from config.robot import SensorConfig
from config.world import AcousticsConfig, DrumConfig, WallConfig, WorldConfig
from drivers.messages import Firing, Pose
from perception.kernel import Floats
from perception.records import records, zeros
from perception.ring_faults.memory import EVIDENCE_NAT, NO_ECHO_M, QUARTERS, EchoTrace, RingTrace
from perception.ring_faults.monitor import REASONS, SERVO_REASONS, RingMonitor
from perception.ring_faults.motion_tests import TURNED
from perception.ring_faults.mounting import EXCLUDED_NAT
from perception.ring_faults.servo_mounting import (
    LOOK_DIRECTIONS,
    SILENCES_MAX,
    DirectionTrace,
    forget_directions,
    weigh_direction,
)
from perception.sensor_mounts import mounts_array
from tests.perception.ring_faults.test_monitor import LieContext, Path, firings

RING = load_settings("room", robot="servo1").ring
NOISY = {"noise_relative": 0.01, "dropout": 0.05}
STEP_M = 0.003
"""Way from one firing to the next, m: .3 m/s at 10 ms."""
MOUNTS = mounts_array(RING.mounts)


def winding(way_m: float) -> Path:
    """Return a way that turns by ±40°, so that no bearing looks twice in one direction."""
    x = y = 0.0
    path = list[tuple[float, float, float]]()
    for k in range(round(way_m / STEP_M)):
        yaw = 0.7 * math.sin(k / 60.0)
        x, y = x + STEP_M * math.cos(yaw), y + STEP_M * math.sin(yaw)
        path.append((x, y, yaw))
    return path


def world(reflection: str) -> WorldConfig:
    walls = tuple(WallConfig(x1_m=-9.0, y1_m=y, x2_m=9.0, y2_m=y) for y in (-1.1, 1.3))
    ends = tuple(WallConfig(x1_m=x, y1_m=-1.1, x2_m=x, y2_m=1.3) for x in (-1.2, 3.4))
    acoustics = AcousticsConfig.model_validate({"model": reflection, **NOISY})
    return WorldConfig(wall=walls + ends, drum=(DrumConfig(x_m=1.6, y_m=0.9, radius_m=0.2),), acoustics=acoustics)


def turned(quarter: int) -> list[int]:
    """Return which bearing answers in the place of each one of an arm that is put on turned by quarters."""
    return np.roll(np.arange(60), -15 * quarter).tolist()


def driven(reflection: str, quarter: int, seed: int, way_m: float) -> tuple[RingMonitor, float, str | None]:
    """Return the monitor after a way, the way until it was found, or else all of it, and the reason."""
    monitor, wired, way = RingMonitor(RING), turned(quarter), 0.0

    def lie(ranges: Floats, _: LieContext) -> Floats:
        (fired,) = np.flatnonzero(~np.isnan(ranges)).tolist()
        swapped = np.full(60, math.nan)
        swapped[wired.index(fired)] = ranges[fired]
        return swapped

    for way, firing in firings(RING, world(reflection), winding(way_m), lie, 0.0, seed):
        monitor.observe(firing)
        if (reason := monitor.take_problem()) is not None:
            return monitor, way, reason
    return monitor, way, None


@pytest.mark.parametrize("reflection", ["specular", "cone"])
def test_a_servo_as_the_file_says_is_soon_sure(reflection: str) -> None:
    monitor, _, reason = driven(reflection, 0, 1, 0.9)
    assert reason is None
    assert (monitor._ring["excluded_nat"] >= EXCLUDED_NAT).all()
    assert len(monitor.possible_obstacles()) == 0
    assert float(monitor._ring["turned_nat"].max()) < 0.0


def test_before_that_the_robot_expects_what_it_hears_on_all_sides() -> None:
    monitor, _, _ = driven("cone", 0, 1, 0.05)
    assert len(monitor.possible_obstacles()) > 0
    monitor.reset()
    assert len(monitor.possible_obstacles()) == 0
    assert (monitor._directions["heard"]["range_m"] == NO_ECHO_M).all()


@pytest.mark.parametrize("quarter", [1, *(pytest.param(quarter, marks=pytest.mark.covered) for quarter in (2, 3))])
@pytest.mark.parametrize("reflection", ["specular", pytest.param("cone", marks=pytest.mark.covered)])
def test_an_arm_that_is_put_on_turned_is_doubted(reflection: str, quarter: int) -> None:
    monitor, _, reason = driven(reflection, quarter, 2, 0.6)
    assert reason is not None or monitor.is_doubted
    assert monitor._ring["excluded_nat"][0, quarter - 1] < 0.0


@pytest.mark.covered
@pytest.mark.parametrize("quarter", [1, 2, 3])
def test_an_arm_that_is_put_on_turned_is_named(quarter: int) -> None:
    _, way, reason = driven("cone", quarter, 2, 2.5)
    assert way < 2.2
    assert reason == SERVO_REASONS[TURNED + quarter - 1]
    assert "how its arm sits on the servo" in reason
    assert "arm" not in REASONS[TURNED + quarter - 1].replace("re-arm", "")


SERVO = SensorConfig(x_m=0.0, y_m=0.0, angle_deg=0.0, servo=True, bearings=13, sweep_deg=180.0)
GUIDE = RING.model_copy(update={"sensors": (SERVO,)})
"""The servo of the page on building a ring."""


@pytest.mark.parametrize("half_m", [0.8, 1.0])
@pytest.mark.parametrize("lean_deg", [0.0, 2.0])
@pytest.mark.parametrize("name", ["servo1", "guide"])
def test_the_walls_of_a_corridor_are_no_turned_arm(name: str, lean_deg: float, half_m: float) -> None:
    ring = RING if name == "servo1" else GUIDE
    walls = tuple(WallConfig(x1_m=-9.0, y1_m=y, x2_m=9.0, y2_m=y) for y in (-half_m, half_m))
    acoustics = AcousticsConfig.model_validate({"model": "cone", **NOISY})
    monitor, lean = RingMonitor(ring), math.radians(lean_deg)
    step = STEP_M if name == "servo1" else 6.0 * STEP_M
    path = [(k * step * math.cos(lean), k * step * math.sin(lean), lean) for k in range(round(4.0 / step))]
    for _, firing in firings(ring, WorldConfig(wall=walls, acoustics=acoustics), path, None, 0.0, 3):
        monitor.observe(firing)
        assert monitor.take_problem() is None
        assert not monitor.is_doubted


def test_other_rings_with_servos_exclude_nothing() -> None:
    (servo,) = RING.sensors or ()
    fixed = SensorConfig(x_m=0.1, y_m=0.0, angle_deg=0.0)
    for sensors in ((servo.model_copy(update={"sweep_deg": 90.0, "bearings": 16}),), (servo, fixed)):
        monitor = RingMonitor(RING.model_copy(update={"sensors": sensors}))
        assert len(monitor._directions) == 0
        assert len(monitor.possible_obstacles()) == 0


def test_an_arm_is_turned_about_the_axis_of_its_servo() -> None:
    (servo,) = RING.sensors or ()
    ring = RING.model_copy(update={"sensors": (servo.model_copy(update={"x_m": 0.15, "arm_m": 0.02}),)})
    monitor = RingMonitor(ring)
    ranges = np.full(len(ring.mounts), math.nan)
    ahead = int(np.abs([mount.angle_rad for mount in ring.mounts]).argmin())
    ranges[ahead] = 0.5
    monitor.observe(Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, ranges))
    found = monitor.possible_obstacles()
    assert found[:, 0].min() == pytest.approx(0.15 - 0.52, abs=0.01)
    assert np.hypot(found[:, 0] - 0.15, found[:, 1]) == pytest.approx([0.52] * QUARTERS, abs=0.01)


def weighed(*looks: tuple[float, float, float]) -> tuple[Floats, Floats]:
    """Return the evidence of looks ahead from places x of the path: range, x, axis; and the echoes kept."""
    directions, ring = zeros(DirectionTrace, LOOK_DIRECTIONS), zeros(RingTrace, 1)
    of, echoes = records(DirectionTrace, directions), records(EchoTrace, zeros(EchoTrace, len(MOUNTS)))
    forget_directions(of)
    all_of = records(RingTrace, ring)
    for r, x, axis in looks:
        all_of[0].path_m = x
        weigh_direction(0, (r, x, 0.0, axis), 0.0, MOUNTS, (math.radians(15.0), 0.005, 1.7), echoes, of, all_of[0])
    return ring["turned_nat"][0], directions["heard"]["range_m"]


def test_what_comes_nearer_ahead_speaks_for_the_file() -> None:
    assert (weighed((1.0, 0.0, 0.01), (0.9, 0.1, 0.02))[0] < 0.0).all()
    nats = weighed((1.0, 0.0, 0.01), (1.1, 0.1, 0.02))[0]
    assert int(nats.argmax()) == 1
    assert nats[1] > 0.0


@pytest.mark.parametrize(
    "second",
    [
        pytest.param((1.0, 0.1, 0.01), id="equal to the bit, as of a frozen sensor"),
        pytest.param((0.99, 0.01, 0.01), id="the robot has hardly moved"),
        pytest.param((0.4, 0.6, 0.01), id="the echo is too old"),
        pytest.param((0.9, 0.1, 0.2), id="another direction"),
    ],
)
def test_nothing_is_concluded_where_nothing_is_compared(second: tuple[float, float, float]) -> None:
    assert weighed((1.0, 0.0, 0.01), second)[0].tolist() == [0.0] * QUARTERS


def test_an_echo_is_dropped_after_two_silences_in_its_direction() -> None:
    silence = (NO_ECHO_M, 0.02, 0.01)
    assert weighed((1.0, 0.0, 0.01), silence)[1].max() == pytest.approx(1.0)
    assert weighed((1.0, 0.0, 0.01), *[silence] * SILENCES_MAX)[1].max() == NO_ECHO_M


def test_evidence_is_limited_to_both_sides() -> None:
    nats, _ = weighed(*((1.7 - x, x, 0.01) for x in np.arange(0.0, 1.6, 0.04).tolist()))
    assert (nats >= -EVIDENCE_NAT).all()
