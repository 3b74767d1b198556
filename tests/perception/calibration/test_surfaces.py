"""Surfaces by votes, and their distances."""

from __future__ import annotations

import math

import numpy as np

from perception.calibration.surfaces import Beams, Surfaces, find_surfaces

HALF_ANGLE = 0.25


def test_distance_and_bearing_of_walls_and_round_objects() -> None:
    surfaces = Surfaces(np.array([[0.5 * math.pi, 2.0]]), np.array([[3.0, 4.0, 1.0]]))
    distance, bearing = surfaces.distances(np.array([0.0, 7.0]), np.array([0.0, 0.5]))
    np.testing.assert_allclose(distance, [[2.0, 1.5], [4.0, math.hypot(4.0, 3.5) - 1.0]])
    np.testing.assert_allclose(bearing, [[0.5 * math.pi] * 2, [math.atan2(4.0, 3.0), math.atan2(3.5, -4.0)]])


def test_a_wall_and_a_drum_are_found_among_stray_readings() -> None:
    rng = np.random.default_rng(2)
    count = 4000
    beams = Beams(rng.uniform(0.0, 4.0, count), rng.uniform(-0.3, 0.3, count), rng.uniform(-math.pi, math.pi, count))
    true = Surfaces(np.array([[1.4, 1.5]]), np.array([[2.0, -1.5, 0.3]]))
    distance, bearing = true.distances(beams.x, beams.y)
    turned = np.remainder(bearing - beams.axis + math.pi, 2.0 * math.pi) - math.pi
    ranges = np.where(np.abs(turned) < HALF_ANGLE, distance, np.inf).min(axis=0)
    ranges = np.where(np.isfinite(ranges), ranges, rng.uniform(0.2, 5.0, count))
    found = find_surfaces(beams, ranges, HALF_ANGLE, 4, [0.3])
    assert len(found.walls) == len(found.drums) == 1, "stray readings are no wall"
    np.testing.assert_allclose(found.walls, true.walls, atol=0.06)
    np.testing.assert_allclose(found.drums, true.drums, atol=0.1)


def test_too_few_readings_are_no_surface() -> None:
    few = Beams(np.zeros(5), np.zeros(5), np.zeros(5))
    found = find_surfaces(few, np.full(5, 1.0), HALF_ANGLE, 2, [0.3])
    assert not len(found.walls)
    assert not len(found.drums)
