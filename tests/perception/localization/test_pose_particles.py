"""Particles of headings with Gaussian places, against Monte Carlo and a Kalman filter written out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Pose
from perception.localization.pose_particles import HEADINGS, PoseParticles
from perception.localization.range_likelihood import RangeModel
from runtime.simulation.random_rooms import ACOUSTICS
from tests.perception.localization.rooms import CROOKED, HALF_ANGLE, RING, panorama_of, stand, world_of

ALL = np.arange(1)


def particles_at(*poses: tuple[float, float, float], half: float = math.radians(4.0)) -> PoseParticles:
    """Hypotheses at these poses."""
    return PoseParticles(np.array(poses), 0.1, half)


def test_a_move_carries_place_and_scale_as_monte_carlo_does() -> None:
    found = particles_at((1.0, 2.0, 0.5), half=0.0)
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(found.mean[0, 0], found.covariance[0, 0], 200_000)
    for forward, left in ((1.0, 0.2), (0.4, -0.3)):
        heading = found.heading[0, 0]
        found.move(forward, left, 0.0, np.random.default_rng(1))
        along = heading + 0.5 * (found.heading[0, 0] - heading)
        c, s = math.cos(along), math.sin(along)
        draws[:, :2] += draws[:, 2:] * (c * forward - s * left, s * forward + c * left)
    assert found.mean[0, 0] == pytest.approx(draws.mean(axis=0), abs=1e-3)
    assert found.covariance[0, 0] == pytest.approx(np.cov(draws.T), abs=2e-3)
    assert found.covariance[0, 0] == pytest.approx(found.covariance[0, 0].T)


def test_a_turn_turns_the_headings_within_its_error() -> None:
    found = particles_at((0.0, 0.0, 0.0), half=0.0)
    found.move(0.0, 0.0, 1.0, np.random.default_rng(0))
    assert found.heading.mean() == pytest.approx(1.0, abs=0.03)
    assert 0.01 < found.heading.std() < 0.06
    assert found.poses()[0, :2] == pytest.approx([0.0, 0.0])


def test_an_update_finds_the_place_and_the_heading_and_prefers_the_right_hypothesis() -> None:
    truth = Pose(1.5, 2.2, 0.5)
    room, firing = stand(world_of(CROOKED, ACOUSTICS), truth)
    found = particles_at((truth.x + 0.1, truth.y - 0.08, truth.theta + 0.02), (truth.x, truth.y + 1.0, 2.0))
    fit = found.update(np.arange(2), room, panorama_of(firing), HALF_ANGLE, RangeModel.of_ring(RING), 0.5)
    assert fit.log_ratio[0] > fit.log_ratio[1] + 20.0
    assert fit.specular[0] > 0.5
    pose, covariance = found.estimate(0)
    assert (pose.x, pose.y) == pytest.approx((truth.x, truth.y), abs=0.03)
    assert pose.theta == pytest.approx(truth.theta, abs=math.radians(2.0))
    assert (np.linalg.eigvalsh(covariance) > 0.0).all()
    assert math.sqrt(covariance[0, 0]) < 0.02
    found.prune(12.0, 5)
    assert len(found) == 1


def test_resampling_keeps_the_weight_and_the_likely_headings() -> None:
    found = particles_at((0.0, 0.0, 0.0), (5.0, 0.0, 0.0))
    found.log_weight[0] -= 50.0
    found.log_weight[0, 3] += 50.0
    before, heading = found.log_evidence(), found.heading[0, 3]
    found.resample()
    assert found.log_evidence() == pytest.approx(before)
    assert found.heading[0] == pytest.approx(np.full(HEADINGS, heading))
    assert np.ptp(found.heading[1]) > 0.0  # its weight lies on all


def test_pruning_keeps_the_better_of_two_that_are_one() -> None:
    found = particles_at((0.0, 0.0, 0.0), (0.1, 0.0, 0.05), (3.0, 0.0, 0.0), (9.0, 0.0, 0.0))
    found.log_weight += np.array([[0.0], [1.0], [0.5], [-30.0]])
    found.prune(12.0, 5)
    assert found.poses()[:, 0] == pytest.approx([0.1, 3.0])
    found.prune(12.0, 1)
    assert found.poses()[:, 0] == pytest.approx([0.1])
