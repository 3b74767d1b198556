"""Evidence of drift: exact odometry is kept while readings fit it, a wrong landmark is not drift, drift is found."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from drivers.messages import Firing, Pose
from perception.localization.drift.drift_correction import DriftCorrection, SeenObject

RING = load_settings(None).ring
MOUNTS = np.array(RING.mounts)
RADIUS_M = 0.3
PLACES = ((2.0, 1.2), (0.8, -1.3), (3.0, -1.4), (4.2, 1.3))
STEP_M = 0.03
NOISE = 0.005


def ranges_at(x: float, yaw: float, places: tuple[tuple[float, float], ...], rng: np.random.Generator) -> np.ndarray:
    """Return noisy ranges of drums at these places, from (x, 0) with the ring turned by `yaw`."""
    found = np.full(len(MOUNTS), np.inf)
    for i, (mx, my, axis) in enumerate(MOUNTS):
        c, s = math.cos(yaw), math.sin(yaw)
        for px, py in places:
            dx, dy = px - (x + c * mx - s * my), py - (s * mx + c * my)
            off = math.remainder(math.atan2(dy, dx) - yaw - axis, math.tau)
            if abs(off) < math.radians(RING.beam_half_angle_deg):
                found[i] = min(found[i], math.hypot(dx, dy) - RADIUS_M)
    return found * (1.0 + NOISE * rng.standard_normal(len(MOUNTS)))


def driven(
    seed: int,
    veer: float = 0.0,
    wrong: tuple[float, float] = (0.0, 0.0),
    heard: tuple[tuple[float, float], ...] = PLACES,
    steps: int = 150,
) -> DriftCorrection:
    """Return the correction after a straight way: odometry veers (rad/m), the first landmark is seen so far off."""
    rng, drift = np.random.default_rng(seed), DriftCorrection(RING)
    seen = [SeenObject(k + 1, x, y, RADIUS_M) for k, (x, y) in enumerate(PLACES)]
    seen[0] = seen[0]._replace(x=seen[0].x + wrong[0], y=seen[0].y + wrong[1])
    for k in range(steps):
        turn = veer * STEP_M * k
        pose = Pose(STEP_M * k, 0.5 * turn * STEP_M * k, turn)
        drift.observe(Firing(0.1 * k, pose, turn, ranges_at(STEP_M * k, 0.0, heard, rng)))
        drift.learn(seen)
    return drift


@pytest.mark.compiled
@pytest.mark.parametrize("seed", range(5))
def test_good_odometry_is_left_alone_to_the_bit(seed: int) -> None:
    drift = driven(seed)
    firing = Firing(15.0, Pose(4.47, 0.0, 0.0), 0.0, np.full(len(MOUNTS), np.nan))
    assert not drift.is_applied
    assert drift.localized().pose == firing.pose
    assert drift.odometry_from_filter() == drift.map_from_filter() == Pose(0.0, 0.0, 0.0)


@pytest.mark.compiled
@pytest.mark.parametrize("wrong", [(0.1, 0.0), (0.0, 0.12), (-0.1, 0.1)])
def test_one_landmark_at_a_wrong_place_is_not_drift(wrong: tuple[float, float]) -> None:
    assert not driven(0, wrong=wrong).is_applied


@pytest.mark.compiled
def test_a_single_landmark_shows_no_drift_as_it_may_have_moved() -> None:
    drift, rng = DriftCorrection(RING), np.random.default_rng(0)
    for k in range(150):
        ranges = ranges_at(STEP_M * k, 0.0, PLACES[:1], rng)
        drift.observe(Firing(0.1 * k, Pose(1.05 * STEP_M * k, 0.0, 0.0), 0.0, ranges))
        drift.learn([SeenObject(1, *PLACES[0], RADIUS_M)])
    assert not drift.is_applied


@pytest.mark.compiled
@pytest.mark.parametrize("veer", [-0.05, 0.05])
def test_drift_is_found_and_corrected(veer: float) -> None:
    drift = driven(0, veer)
    assert drift.is_applied
    here = drift.localized().pose
    assert (here.x, here.y) == pytest.approx((STEP_M * 149, 0.0), abs=0.1)
    assert drift.e[0].count == len(PLACES)


@pytest.mark.compiled
def test_a_reset_takes_odometry_as_exact_again() -> None:
    drift = driven(0, 0.05)
    drift.reset()
    assert not drift.is_applied
