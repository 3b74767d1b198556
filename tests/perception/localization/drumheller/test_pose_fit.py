"""The fit of poses to raw ranges."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.trials.random_rooms import random_room
from config.world import AcousticsConfig
from drivers.messages import Pose
from perception.localization.drumheller.panorama import all_readings
from perception.localization.drumheller.pose_fit import PRIOR_SIGMA_M, Stand, fit_poses
from perception.localization.room.expected_ranges import Reflection
from perception.localization.room.range_likelihood import RangeModel
from perception.localization.room.room import make_room
from tests.perception.localization.rooms import EXACT, HALF_ANGLE, RING, panorama_of, pose_row, stand


def stand_of(seed: int, reflection: Reflection) -> tuple[Stand, Pose]:
    """Exact readings in a random room, and the true pose."""
    world, truth = random_room(seed, AcousticsConfig(model=reflection))
    room, firing = stand(world, truth, ring=EXACT)
    return Stand(room, all_readings([panorama_of(firing)]), HALF_ANGLE, reflection, RangeModel.of_ring(RING)), truth


@pytest.mark.parametrize("reflection", ["cone", "specular"])
def test_a_fit_from_near_the_true_pose_ends_there(reflection: Reflection) -> None:
    for seed in range(8):
        problem, truth = stand_of(seed, reflection)
        fit = fit_poses(problem, pose_row(truth) + np.array([0.04, -0.03, 0.0]), np.zeros(1), 8)
        assert math.hypot(fit.x[0, 0] - truth.x, fit.y[0, 0] - truth.y) < 0.003
        at_truth = fit_poses(problem, pose_row(truth), np.zeros(1), 0)
        assert fit.log_ratio[0, 0] == pytest.approx(at_truth.log_ratio[0, 0], abs=0.1)


def test_turned_poses_fit_worse() -> None:
    problem, truth = stand_of(1, "cone")
    fit = fit_poses(problem, pose_row(truth), np.radians([-20.0, 0.0, 20.0]), 4)
    assert fit.theta[0] == pytest.approx(truth.theta + np.radians([-20.0, 0.0, 20.0]))
    assert fit.log_ratio.shape == (1, 3)
    assert fit.log_ratio[0].argmax() == 1


def test_a_wall_alone_fixes_the_place_across_it_only() -> None:
    """Along the wall the place stays where it started, with the prior's variance."""
    room = make_room(np.array([(2.0, -50.0, 2.0, 50.0)]))
    problem, _ = stand_of(1, "specular")
    readings = problem.readings
    ranges = np.where(np.abs(np.cos(readings.axis) - 1.0) < 1e-9, 2.0 - 0.381, math.inf)
    problem = problem._replace(room=room, readings=type(readings)(readings.x, readings.y, readings.axis, ranges))
    fit = fit_poses(problem, np.array([[0.05, 0.3, 0.0]]), np.zeros(1), 8)
    sigma = float(problem.model.sigma(np.array(2.0 - 0.381)))
    assert fit.x[0, 0] == pytest.approx(0.0, abs=2e-3)
    assert fit.y[0, 0] == pytest.approx(0.3, abs=1e-9)
    assert fit.log_area[0, 0] == pytest.approx(math.log(2 * math.pi * sigma * PRIOR_SIGMA_M), abs=0.02)
