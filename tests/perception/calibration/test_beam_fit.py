"""Directions and width of beams, from looks made by either model of reflection."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.calibration.beam_fit import Looks, fit_beams

TURNS_DEG = np.array([2.0, -1.3, 0.0])
HALF_ANGLE_DEG = 11.0


def looks(count: int, *, everything: bool) -> Looks:
    rng = np.random.default_rng(5)
    sensor = rng.integers(0, 3, count)
    bearing = rng.uniform(-0.6, 0.6, count)
    distance = rng.uniform(0.5, 2.0, count)
    beside = np.maximum(0.0, np.abs(bearing - np.radians(TURNS_DEG)[sensor]) - math.radians(HALF_ANGLE_DEG))
    read = distance / np.cos(beside) if everything else np.where(beside > 0.0, np.inf, distance)
    read = read + rng.normal(0.0, 0.003, count)
    return Looks(sensor, bearing, distance, np.full(count, np.inf), read, np.full(count, 0.003))


@pytest.mark.covered
@pytest.mark.parametrize("everything", [False, True])
def test_directions_and_width_are_found(everything: bool) -> None:
    found = fit_beams(looks(1500, everything=everything), 3)
    assert found.everything_echoes == everything
    assert math.degrees(found.half_angle) == pytest.approx(HALF_ANGLE_DEG, abs=0.3)
    np.testing.assert_allclose(np.degrees(found.turns), TURNS_DEG, atol=0.3)
    assert (np.degrees(found.sigmas) < 0.3).all()


@pytest.mark.covered
def test_a_sensor_that_heard_nothing_keeps_its_direction() -> None:
    found = fit_beams(looks(1500, everything=False), 4)
    assert found.turns[3] == 0.0
    assert math.isinf(found.sigmas[3])
    assert np.isfinite(found.sigmas[:3]).all()
