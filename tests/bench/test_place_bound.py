"""The exact filter over all poses: what it moves and weighs, and where it is right."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.laser_rooms import RING
from bench.place_bound import CODES, HEADINGS, STEP_RAD, _moved, _ratios, follow_exactly, make_grid
from bench.trials.known_room_trials import KnownDrive
from drivers.messages import Firing, Pose
from perception.localization.known_room.mixed_reflection import WILD_HEARD
from perception.localization.room.expected_ranges import Beams, Reflection, expected_ranges
from perception.localization.room.range_likelihood import HEARD_PRIOR
from perception.localization.room.room import make_room

ROOM = make_room(np.array([
    [0.0, 0.0, 6.0, 0.0], [6.0, 0.0, 6.0, 4.0], [6.0, 4.0, 3.0, 4.0], [3.0, 4.0, 3.0, 5.5], [3.0, 5.5, 0.0, 5.5],
    [0.0, 5.5, 0.0, 0.0],
]))  # fmt: skip
"""A room in the form of an L: no place looks like another."""


def test_a_step_moves_the_probability_and_loses_none_inside() -> None:
    chances = np.zeros((HEADINGS, 20, 30))
    chances[18, 10, 10] = 1.0  # looks along y, the second axis

    moved = _moved(chances, Pose(1.0, 0.0, 0.0))

    assert moved.sum() == pytest.approx(1.0)
    assert int(moved.argmax()) == np.ravel_multi_index((18, 10, 15), moved.shape)


def test_what_leaves_the_grid_is_gone() -> None:
    chances = np.zeros((HEADINGS, 4, 4))
    chances[0, 1, 1] = 1.0

    assert _moved(chances, Pose(3.0, 0.0, 0.0)).sum() == 0.0


@pytest.mark.parametrize("range_m", [1.2, 4.0, math.inf])
def test_readings_of_anything_are_the_least_likelihood(range_m: float) -> None:
    least = 0.2 * (WILD_HEARD / HEARD_PRIOR if math.isfinite(range_m) else (1.0 - WILD_HEARD) / (1.0 - HEARD_PRIOR))

    ratios = _ratios(range_m, RING.window_m, 0.8)

    assert ratios.shape == (CODES + 1, CODES + 1)
    assert ratios.min() >= least * (1.0 - 1e-9)
    cone, mirror = np.unravel_index(int(ratios.argmax()), ratios.shape)
    best = CODES if math.isinf(range_m) else int(range_m * CODES / RING.window_m)
    assert abs(int(mirror) - best) <= 1
    assert abs(int(cone) - best) <= 1


@pytest.mark.parametrize("reflection", [pytest.param(one, marks=pytest.mark.soak) for one in ("cone", "specular")])
def test_an_unknown_place_is_found(reflection: Reflection) -> None:
    truth = np.array([[1.0 + 0.25 * k, 1.2 + 0.1 * k, 0.4] for k in range(12)])
    firings = []
    for k, (x, y, yaw) in enumerate(truth.tolist()):
        axes = yaw + np.array([axis for _, _, axis in RING.mounts])
        beams = Beams(np.full(len(axes), x), np.full(len(axes), y), axes)
        ranges_m = expected_ranges(ROOM, beams, math.radians(RING.beam_half_angle_deg), reflection).range_m
        pose = Pose(5.0 + x, 5.0 + y, yaw)
        firings.append(Firing(float(k), pose, pose.theta, np.where(ranges_m <= RING.window_m, ranges_m, math.inf)))
    drive = KnownDrive(ROOM, firings, truth)

    trace = follow_exactly(make_grid(ROOM, RING), drive, RING, reflection)

    assert trace.probability[-1] > 0.9
    assert trace.error_m[-1] < 0.2
    assert trace.error_rad[-1] < 2.0 * STEP_RAD
