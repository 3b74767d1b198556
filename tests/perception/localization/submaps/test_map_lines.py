"""Walls are found where they stand, and what ranges pass through is none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.kernel import Floats
from perception.localization.submaps.map_lines import (
    AT_EDGE,
    DISTANCE_STEP_M,
    DISTANCES,
    GRAZING_RAD,
    NORMALS,
    find_lines,
    vote,
)
from tests.perception.localization.submaps.test_local_grid import BEAM


def corridor_readings(*, rough: bool = True) -> Floats:
    """Return what a ring hears that drives 2 m along a corridor, walls at y = 1 and -0.8 m, if it is rough."""
    rows = []
    for x in np.arange(-1.0, 1.01, 0.1).tolist():
        for axis in np.deg2rad(np.arange(-90.0, 91.0, 15.0)).tolist():
            rays = axis + BEAM * np.linspace(-1.0, 1.0, 49)
            up = np.where(np.sin(rays) > 0.05, 1.0 / np.maximum(np.sin(rays), 0.05), np.inf)
            down = np.where(np.sin(rays) < -0.05, 0.8 / np.maximum(-np.sin(rays), 0.05), np.inf)
            nearest = float(np.minimum(up, down).min())
            is_square = abs(abs(axis) - 0.5 * math.pi) <= BEAM
            rows.append((x, 0.0, axis, nearest if rough or is_square else math.inf))
    return np.array(rows)


@pytest.mark.compiled
@pytest.mark.parametrize("rough", [True, False])
def test_both_walls_of_a_corridor_are_found(rough: bool) -> None:
    *_, lines = find_lines(corridor_readings(rough=rough), BEAM)
    up, down = sorted(lines.tolist(), key=lambda line: -line[0])
    assert len(lines) == 2
    np.testing.assert_allclose(up[:2], (0.5 * math.pi, 1.0), atol=0.01)
    np.testing.assert_allclose(down[:2], (-0.5 * math.pi, 0.8), atol=0.01)
    assert up[2] <= -0.9
    assert up[3] >= 0.9


@pytest.mark.compiled
def test_what_ranges_pass_through_is_no_line() -> None:
    """A third of the readings come from a wall; the others look there, and hear what is behind it."""
    readings = corridor_readings(rough=False)
    readings = readings[np.abs(readings[:, 2] - 0.5 * math.pi) < 0.01]
    behind = readings.copy()
    behind[:, 0], behind[:, 3] = behind[:, 0] + 0.05, 2.0
    *_, kept = find_lines(readings, BEAM)
    *_, lines = find_lines(np.concatenate([readings, behind, behind]), BEAM)
    assert kept[:, 1] == pytest.approx([1.0], abs=0.01)
    assert lines[:, 1] == pytest.approx([2.0], abs=0.01)


def test_votes_are_those_of_each_direction_and_distance() -> None:
    """The oracle asks each line for its distance from the nearest point of the beam's arc."""
    readings = corridor_readings()[[0, 40, 100]]
    taken, votes = np.array([0.0, 1.0, 0.0]), np.zeros((NORMALS, DISTANCES))
    vote(readings, 0, 3, BEAM, taken, votes)
    expected = np.zeros((NORMALS, DISTANCES))
    for x, y, axis, range_m in readings[[0, 2]].tolist():
        for i in range(NORMALS):
            normal = 2.0 * math.pi * i / NORMALS
            angle = math.remainder(normal - axis, math.tau)
            arc = axis + np.clip(angle, -BEAM, BEAM)
            far = math.cos(normal) * (x + range_m * math.cos(arc)) + math.sin(normal) * (y + range_m * math.sin(arc))
            j = math.floor(far / DISTANCE_STEP_M) + DISTANCES // 2
            if abs(angle) <= GRAZING_RAD and 0 <= j < DISTANCES:
                expected[i, j] += 1.0 if abs(angle) <= BEAM + 1e-9 else AT_EDGE
    assert votes.sum() > 50.0
    np.testing.assert_array_equal(votes, expected)
