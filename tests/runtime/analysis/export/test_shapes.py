"""Tests of what exports share: quaternions, even rings, and scans that put echoes where they were."""

from __future__ import annotations

import math

import pytest

from config.load import load_robot
from runtime.analysis.export.shapes import even_radius, firing_scans, whole_ring, yaw_quaternion
from runtime.analysis.timeline import Timeline

RING = load_robot("denning").ring


def test_a_turn_as_a_quaternion() -> None:
    assert yaw_quaternion(0.0) == (0.0, 0.0, 0.0, 1.0)
    assert yaw_quaternion(math.pi / 2) == pytest.approx((0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)))


def test_a_ring_is_even_if_all_sensors_point_outwards_at_equal_angles() -> None:
    assert even_radius(RING.mounts) == pytest.approx(0.381)
    for place in ((0.381, 0.0, 0.1), (0.4, 0.0, 0.0)):
        assert even_radius((place, *RING.mounts[1:])) is None


def test_a_scan_puts_echoes_where_they_were(timeline: Timeline) -> None:
    count = 0
    for part in firing_scans(timeline):
        ranges = whole_ring(24, 0.381, part)
        assert sum(not math.isnan(r) for r in ranges) == len(part.rows)
        for row in part.rows:
            reach = ranges[int(row["sensor"])]
            if math.isfinite(reach):
                angle = part.yaw + math.radians(15.0 * row["sensor"])
                there = (part.x + reach * math.cos(angle), part.y + reach * math.sin(angle))
                bearing, range_m = row["bearing"], row["range_m"]
                assert there == pytest.approx(
                    (row["x"] + range_m * math.cos(bearing), row["y"] + range_m * math.sin(bearing)), abs=1e-9
                )
                count += 1
    assert count > 300
