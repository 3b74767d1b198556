"""Walls are found where they stand, what ranges pass through is none, and lines bring a pose where they agree."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.kernel import Floats
from perception.localization.submaps.map_lines import (
    AT_EDGE,
    BENDS,
    DISTANCE_STEP_M,
    DISTANCES,
    FALSE_PAIRS,
    GRAZING_RAD,
    NORMALS,
    PAIR_M,
    PAIR_RAD,
    find_lines,
    moved_lines,
    pull,
    vote,
    with_lines,
)
from tests.perception.localization.submaps.test_local_grid import BEAM

SIDES = np.array([[0.5 * math.pi, 1.0, -2.0, 2.5, 0.01], [-0.5 * math.pi, 0.8, -2.5, 2.0, 0.02]])
"""Lines of a corridor along x."""
INFORMATION = np.diag([100.0, 100.0, 300.0])


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
    taken, votes = np.array([0.0, 1.0, 0.0]), np.full((NORMALS, DISTANCES), 7.0)
    vote(readings, 3, BEAM, taken, votes)
    expected = np.zeros((NORMALS, DISTANCES))
    for x, y, axis, range_m in readings[[0, 2]].tolist():
        for i in range(NORMALS):
            normal = 2.0 * math.pi * i / NORMALS
            angle = math.remainder(normal - axis, math.tau)
            if abs(angle) > GRAZING_RAD + 0.5 * math.tau / NORMALS:
                continue
            arc = axis + np.clip(angle, -BEAM, BEAM)
            far = math.cos(normal) * (x + range_m * math.cos(arc)) + math.sin(normal) * (y + range_m * math.sin(arc))
            j = math.floor(far / DISTANCE_STEP_M) + DISTANCES // 2
            if 0 <= j < DISTANCES:
                expected[i, j] += 1.0 if abs(angle) <= BEAM else AT_EDGE
    # at the rim of what a wall is heard from, the steps of directions decide
    assert np.abs(votes - expected).sum() <= 4.0
    assert votes.sum() > 50.0


def test_a_line_is_pulled_as_matrices_say() -> None:
    pose, covariance = np.array([0.1, -0.05, 0.03]), np.diag([0.01, 0.02, 0.003])
    covariance[0, 2] = covariance[2, 0] = 0.001
    system, expected, force = np.column_stack([INFORMATION, np.zeros(3)]), INFORMATION.copy(), np.zeros(3)
    weights = pull(SIDES, SIDES, pose, covariance, system)
    total = 0.0
    for line, there in zip(SIDES, moved_lines(SIDES, pose), strict=True):
        low, high = max(line[2], there[2]), min(line[3], there[3])
        at, shift = 0.5 * (low + high), there[2] - line[2]
        error = np.array([there[0] - line[0], there[1] - (there[0] - line[0]) * at - line[1]])
        jacobian = np.array([[0.0, 0.0, 1.0], [math.cos(there[0]), math.sin(there[0]), shift - at]])
        own = np.zeros((2, 2))
        for one, along in ((line, at), (line, at - shift)):
            length, bent = one[3] - one[2], one[4]
            lever = along - 0.5 * (one[2] + one[3])
            own += np.diag([12.0 / length**2, 1.0 + 12.0 * lever**2 / length**2]) * bent**2 / BENDS
        spread = own + jacobian @ covariance @ jacobian.T
        chi = error @ np.linalg.solve(spread, error)
        true = (1.0 - FALSE_PAIRS) * math.exp(-0.5 * chi) / (math.tau * math.sqrt(np.linalg.det(spread)))
        weight = true / (true + FALSE_PAIRS / (4.0 * PAIR_RAD * PAIR_M))
        total += weight
        expected += weight * jacobian.T @ np.linalg.solve(own, jacobian)
        force -= weight * jacobian.T @ np.linalg.solve(own, error)
    assert weights == pytest.approx(total)
    np.testing.assert_allclose(system, np.column_stack([expected, force]), rtol=1e-9)


def test_walls_give_the_direction_and_the_place_across() -> None:
    true, off = np.array([0.5, 0.0, 0.02]), np.array([0.04, -0.06, 0.05])
    back = -np.array([[math.cos(true[2]), math.sin(true[2])], [-math.sin(true[2]), math.cos(true[2])]]) @ true[:2]
    lines = moved_lines(SIDES, np.array([*back, -true[2]]))
    pose, information = with_lines(SIDES, lines, true + off, INFORMATION)
    np.testing.assert_allclose(pose[1:], true[1:], atol=0.01)
    assert information[2, 2] > 5.0 * INFORMATION[2, 2]
    assert abs(pose[0] - true[0] - off[0]) < 0.01  # along the walls they say nothing


def test_a_line_of_another_wall_pulls_little() -> None:
    pose, information = with_lines(
        SIDES, moved_lines(SIDES, np.array([0.0, 0.0, 0.3])), np.zeros(3), INFORMATION * 20
    )
    assert np.abs(pose).max() < 0.05
    assert information[2, 2] < 1.5 * 20 * INFORMATION[2, 2]
    alone, same = with_lines(SIDES[:0], SIDES, np.zeros(3), INFORMATION)
    np.testing.assert_allclose(alone, 0.0)
    np.testing.assert_allclose(same, INFORMATION)
