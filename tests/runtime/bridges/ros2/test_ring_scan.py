"""The ring as a laser scan: each echo where it was, though the robot moved since."""

from __future__ import annotations

import math
from typing import Any

import pytest

from drivers.messages import Pose
from runtime.bridges.ros2.ring_scan import BEAMS, RingScan

MOUNTS = [[0.2 * math.cos(a), 0.2 * math.sin(a), a] for a in (0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi)]
RING: dict[str, Any] = {"mounts": MOUNTS, "turning": [], "range_min": 0.1, "range_max": 5.0}
WALL_M = 3.0


def state(robot_s: float, x: float, fired_s: list[float], ranges: list[float]) -> dict[str, Any]:
    ages = [robot_s - time_s for time_s in fired_s]
    return {"robot_s": robot_s, "pose": [x, 0.0, 0.0], "ring_yaw": 0.0, "age": ages, "ranges": ranges}


def beam(angle: float) -> int:
    return round((angle + math.pi) * BEAMS / (2.0 * math.pi)) % BEAMS


def test_a_scan_is_complete_when_each_sensor_has_fired_and_lies_at_its_stamp() -> None:
    """The robot drives at 1 m/s towards a wall at x = 3 m; its sensors fire one after another, 50 ms apart."""
    scan, scans = RingScan("base_link"), []
    scan.begin(RING)
    fired_s, ranges = [-9.0] * 4, [-1.0] * 4
    for k in range(40):
        robot_s = 0.05 * k
        fired_s[k % 4], ranges[k % 4] = robot_s, WALL_M - robot_s - 0.2 if k % 4 == 0 else -1.0
        if (made := scan.take(state(robot_s, robot_s, fired_s, list(ranges)), round(1e9 * robot_s))) is not None:
            scans.append((robot_s, made.fields))
    assert len(scans) == 10
    for robot_s, fields in scans[1:]:
        assert fields["ranges"][beam(0.0)] == pytest.approx(WALL_M - robot_s), "moved to the time of the scan"
        assert fields["ranges"].count(math.inf) == 3
        assert sum(not math.isnan(r) for r in fields["ranges"]) == 4
        assert len(fields["ranges"]) == BEAMS
        ends = fields["angle_min"] + (BEAMS - 1) * fields["angle_increment"]
        assert ends == pytest.approx(fields["angle_max"])
        assert fields["header"]["frame_id"] == "base_link"


def test_a_sensor_that_never_fires_does_not_hold_up_the_others() -> None:
    scan = RingScan("base_link")
    scan.begin(RING)
    first = state(1.0, 0.0, [1.0] * 4, [1.0] * 4)
    first["age"][3], first["ranges"][3] = None, None
    made = scan.take(first, 0)
    assert made is not None
    assert sum(not math.isnan(r) for r in made.fields["ranges"]) == 3
    assert scan.take(first, 0) is None


def test_a_ring_that_does_not_turn_with_the_base_lies_where_it_looked() -> None:
    scan = RingScan("base_link")
    scan.begin(RING)
    turned = {**state(1.0, 0.0, [1.0] * 4, [1.0, -1.0, -1.0, -1.0]), "pose": [0.0, 0.0, 0.5], "ring_yaw": 0.0}
    made = scan.take(turned, 0)
    assert made is not None
    assert made.fields["ranges"][beam(-0.5)] == pytest.approx(1.2)
    assert Pose(0.0, 0.0, 0.5).inverse().theta == -0.5
