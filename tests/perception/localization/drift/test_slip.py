"""Slips of the robot and drums that moved: one is not taken for the other, and the map stays."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from drivers.messages import Firing, Pose, wrap_angle
from perception.localization.drift.drift_correction import DriftCorrection, SeenObject
from perception.localization.drift.landmark_tracker import POSE
from perception.localization.drift.slip import echoes_of_cycle

RING = load_settings(None).ring
MOUNTS = np.array(RING.mounts)
RADIUS_M = 0.3
PLACES = ((1.5, 1.3), (0.2, -1.4), (2.6, -1.2), (3.9, 1.1), (-1.2, 1.1), (5.2, -1.5), (5.8, 1.2), (-1.3, -1.0))
SEEN = [SeenObject(k + 1, x, y, RADIUS_M) for k, (x, y) in enumerate(PLACES)]
STEP_M = 0.03
AT = 50


def firing(k: int, true: Pose, reported: Pose, places: tuple[tuple[float, float], ...]) -> Firing:
    """Return a firing of one of three sets of sensors, with exact ranges."""
    ranges = np.full(len(MOUNTS), np.nan)
    for i in range(k % 3, len(MOUNTS), 3):
        sensor = true.compose(Pose(*MOUNTS[i]))
        found = [
            math.hypot(x - sensor.x, y - sensor.y) - RADIUS_M
            for x, y in places
            if abs(wrap_angle(math.atan2(y - sensor.y, x - sensor.x) - sensor.theta))
            < math.radians(RING.beam_half_angle_deg)
        ]
        ranges[i] = min(found, default=math.inf)
    return Firing(0.1 * k, reported, reported.theta, ranges)


def drive(slip: Pose, places: tuple[tuple[float, float], ...] = PLACES) -> tuple[DriftCorrection, Pose]:
    """Return the correction and the true pose after a drive in which the robot slips and drums move half-way."""
    drift, true = DriftCorrection(RING), Pose(0.0, 0.0, 0.0)
    for k in range(AT + 40):
        reported = Pose(STEP_M * k, 0.0, 0.0)
        if k == 1:
            drift.learn(SEEN)
        true = (
            reported
            if k < AT
            else Pose(STEP_M * AT, 0.0, 0.0).compose(slip).compose(Pose(STEP_M * (k - AT), 0.0, 0.0))
        )
        drift.observe(firing(k, true, reported, PLACES if k < AT else places))
    return drift, true


@pytest.mark.compiled
@pytest.mark.parametrize("slip", [Pose(0.0, 0.15, 0.0), Pose(-0.3, 0.1, -0.2), Pose(0.1, -0.4, 0.3)])
def test_a_robot_that_slipped_is_found_again_and_the_map_stays(slip: Pose) -> None:
    drift, true = drive(slip)
    here = drift.localized()
    assert here.status == "tracking"
    assert (here.pose.x, here.pose.y) == pytest.approx((true.x, true.y), abs=0.05)
    assert here.pose.theta == pytest.approx(true.theta, abs=math.radians(2.5))
    for seen in SEEN:
        place = drift.places()[seen.number]
        assert (place.x, place.y) == pytest.approx((seen.x, seen.y), abs=0.05)


@pytest.mark.compiled
def test_drums_that_moved_do_not_move_the_robot_and_are_placed_anew() -> None:
    moved = tuple((x + 0.3, y) if k in (0, 2) else (x, y) for k, (x, y) in enumerate(PLACES))
    drift, true = drive(Pose(0.0, 0.0, 0.0), moved)
    here = drift.localized()
    assert (here.pose.x, here.pose.y, here.pose.theta) == pytest.approx((true.x, true.y, 0.0), abs=0.05)
    failing = {number for number, failures in zip(*drift._tracker.landmarks("number", "failures"), strict=True)
               if failures > 2}  # fmt: skip
    assert failing
    assert failing <= {1, 3}
    drift.learn([SeenObject(k + 1, x, y, RADIUS_M) for k, (x, y) in enumerate(moved)])
    for number in failing:
        assert drift.places()[number].x == pytest.approx(moved[number - 1][0], abs=0.06)
    assert drift.places()[2].x == pytest.approx(PLACES[1][0], abs=0.05)


def test_each_sensors_last_echo_of_the_cycle_is_taken_where_the_ring_was() -> None:
    rows = np.full((4, POSE + len(MOUNTS)), -1.0)
    for k, row in enumerate(rows):
        row[:POSE] = 1.0 - 0.1 * k, 0.0, 0.0, 0.0
        row[POSE + k % 3] = 1.0 + 0.1 * k
    rows[2, POSE + 2] = 99.0
    echoes = echoes_of_cycle(rows, MOUNTS, (), 0.15, 7.0, 2.0)
    assert [echo.range_m for echo in echoes] == pytest.approx([0.5, 0.55])
    assert [echo.x for echo in echoes] == pytest.approx([MOUNTS[0, 0], MOUNTS[1, 0] - 0.1])
