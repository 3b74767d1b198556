"""Sensors that are exchanged or look backwards, found from what the others heard there as the robot turned."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_robot
from config.robot import RingConfig
from config.world import AcousticsConfig, DrumConfig, WallConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, sensors
from drivers.messages import Firing, Pose
from perception.ring_faults.monitor import RingMonitor, deaf_reason, wiring_reason
from perception.ring_faults.wiring import AGREES, SENSORS_MAX, SILENT_TOO, SILENT_WHERE_HEARD, density

pytestmark = pytest.mark.compiled

CORNERS = ((-1.6, -1.1), (2.4, -1.4), (2.1, 1.9), (-1.9, 1.5))
WALLS = tuple(
    WallConfig(x1_m=a[0], y1_m=a[1], x2_m=b[0], y2_m=b[1])
    for a, b in zip(CORNERS, (*CORNERS[1:], CORNERS[0]), strict=True)
)
ROOM = WorldConfig(wall=WALLS, drum=(DrumConfig(x_m=1.2, y_m=0.5, radius_m=0.2),))
REACH_M = 5.0


def rewired(ring: RingConfig, i: int, j: int) -> RingConfig:
    """Return a ring with two sensors exchanged, or with one that looks backwards where they are the same."""
    sensors = list(ring.sensors or ())
    if i == j:
        sensors[i] = sensors[i].model_copy(update={"angle_deg": sensors[i].angle_deg + 180.0})
    else:
        sensors[i], sensors[j] = sensors[j], sensors[i]
    return ring.model_copy(update={"sensors": tuple(sensors)})


def problem(robot: str, model: str, pair: tuple[int, int] | None, seed: int, turns: float = 2.0) -> str | None:
    """Return what is found of a robot that turns and drives a little, wired as its file says or not."""
    nominal, rng = load_robot(robot).ring, np.random.default_rng(seed)
    true = nominal if pair is None else rewired(nominal, *pair)
    acoustics = AcousticsConfig.model_validate({"model": model, "noise_relative": 0.01, "dropout": 0.05})
    sonar, monitor = Sonar(true, compile_scene(ROOM), acoustics, rng), RingMonitor(nominal)
    count, pose, step = len(nominal.mounts), Pose(0.0, 0.0, float(rng.uniform(-3.0, 3.0))), 0.05
    for k in range(round(turns * math.tau / step)):
        turn = step if k % 90 < 60 else -step  # to and fro, as a robot that looks to both sides
        pose = Pose(pose.x + 0.002 * math.cos(pose.theta), pose.y + 0.002 * math.sin(pose.theta), pose.theta + turn)
        ranges = sonar.fire(pose, pose.theta, [k % count], nominal.window_m)
        monitor.observe(Firing(0.05 * (k + 1), pose, pose.theta, ranges))
        found = monitor.take_problem()
        if found is not None:
            return found
    return None


@pytest.mark.parametrize("model", ["specular", "cone"])
@pytest.mark.parametrize(
    ("robot", "pair"),
    [
        *((r, p) for r in ("hobby3", "amigo", "parking12") for p in ((0, 2), (1, 2))),
        ("amigo", (1, 1)),
        ("parking12", (1, 1)),
    ],
)
def test_what_is_wired_otherwise_than_the_file_says_is_named(robot: str, model: str, pair: tuple[int, int]) -> None:
    assert problem(robot, model, pair, 3, turns=6.0) == wiring_reason(*pair)


@pytest.mark.parametrize("model", ["specular", "cone"])
def test_the_middle_one_of_three_that_looks_backwards_is_found(model: str) -> None:
    """It is the only witness of the other two, so that these may be named in its place."""
    assert problem("hobby3", model, (1, 1), 3, turns=6.0) in {wiring_reason(1, 1), wiring_reason(0, 2)}


@pytest.mark.parametrize("model", ["specular", "cone"])
@pytest.mark.parametrize("robot", ["hobby3", "hobby8", "amigo", "parking12"])
def test_an_honest_ring_is_not_said_to_be_wired_wrongly(robot: str, model: str) -> None:
    assert [problem(robot, model, None, seed, turns=6.0) for seed in range(4)] == [None] * 4


def turned_once(robot: str, model: str, fault: tuple[int, int] | None, seed: int) -> str | None:
    """Return what is found in one turn on the spot; a fault (i, −1) is a deaf sensor."""
    nominal, rng = load_robot(robot).ring, np.random.default_rng(seed)
    true = nominal if fault is None or fault[1] < 0 else rewired(nominal, *fault)
    acoustics = AcousticsConfig.model_validate({"model": model, "noise_relative": 0.01, "dropout": 0.05})
    sonar, monitor = Sonar(true, compile_scene(ROOM), acoustics, rng), RingMonitor(nominal)
    masks, begin, agrees = firing_pattern(nominal).masks, float(rng.uniform(-3.0, 3.0)), True
    step = math.radians(nominal.beam_half_angle_deg) / len(masks)
    for k in range(round(math.tau / step)):
        pose = Pose(0.3, -0.2, begin + k * step)
        ranges = sonar.fire(pose, pose.theta, sensors(masks[k % len(masks)]), nominal.window_m)
        if fault is not None and fault[1] < 0 and not math.isnan(ranges[fault[0]]):
            ranges[fault[0]] = math.inf
        monitor.observe(Firing(0.05 * (k + 1), pose, pose.theta, ranges))
        if (found := monitor.take_problem()) is not None:
            return found
    agrees = monitor.judge_turn()
    found = monitor.take_problem()
    assert agrees is (found is None)
    return found


@pytest.mark.parametrize("model", ["specular", "cone"])
@pytest.mark.parametrize("robot", ["hobby3", "hobby8", "parking12"])
def test_a_turn_on_the_spot_names_each_fault_of_the_wiring(robot: str, model: str) -> None:
    assert [turned_once(robot, model, None, seed) for seed in range(4)] == [None] * 4
    for i in range(3):
        assert turned_once(robot, model, (i, -1), i) == deaf_reason(i)
        assert turned_once(robot, model, (i, i), i) == wiring_reason(i, i)
        first, second = sorted((i, (i + 1) % 3))
        assert turned_once(robot, model, (first, second), i) == wiring_reason(first, second)


def test_where_nothing_echoes_a_turn_names_nothing() -> None:
    monitor = RingMonitor(load_robot("hobby3").ring)
    for k in range(80):
        yaw = 0.08 * k
        ranges = np.full(3, math.nan)
        ranges[k % 3] = math.inf
        monitor.observe(Firing(0.05 * k, Pose(0.0, 0.0, yaw), yaw, ranges))
    assert monitor.judge_turn()
    assert monitor.take_problem() is None


@pytest.mark.parametrize("heard", [2.0, -1.0])
def test_a_density_of_readings_sums_to_one(heard: float) -> None:
    at = (np.arange(5000) + 0.5) * REACH_M / 5000
    total = sum(density(float(r), heard, REACH_M) for r in at) * REACH_M / 5000 + density(-1.0, heard, REACH_M)
    assert total == pytest.approx(1.0, abs=0.01)
    assert AGREES + SILENT_WHERE_HEARD < 1.0
    assert SILENT_TOO < 1.0


def test_large_rings_are_not_tested() -> None:
    ring = load_robot("denning").ring
    assert len(ring.mounts) > SENSORS_MAX
    monitor = RingMonitor(ring)
    assert monitor.judge_turn()
    assert monitor.observe(Firing(0.05, Pose(0.0, 0.0, 1.0), 1.0, np.full(len(ring.mounts), 2.0))) is None
    assert monitor.take_problem() is None
