"""Lines of one wall are paired, and bring a pose where they agree."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.kernel import Floats
from perception.localization.submaps.line_pairs import (
    BENDS,
    FALSE_PAIRS,
    PAIR_M,
    PAIR_RAD,
    find_pairs,
    moved_lines,
    pull,
    with_lines,
)

SIDES = np.array([[0.5 * math.pi, 1.0, -2.0, 2.5, 0.01], [-0.5 * math.pi, 0.8, -2.5, 2.0, 0.02]])
"""Lines of a corridor along x."""
INFORMATION = np.diag([100.0, 100.0, 300.0])


def differences_of(line: Floats, other: Floats, pose: Floats) -> tuple[Floats, Floats, Floats]:
    """The oracle: turn and distance of two lines where both are, their covariance, and derivatives by the pose."""

    def difference(at: Floats, along: float | None = None) -> tuple[Floats, float]:
        there = moved_lines(line[None], at)[0]
        middle = 0.5 * (max(other[2], there[2]) + min(other[3], there[3])) if along is None else along
        turn = math.remainder(there[0] - other[0], math.tau)
        return np.array([turn, there[1] - turn * middle - other[1]]), middle

    error, middle = difference(pose)
    spread = np.zeros((2, 2))
    for one, along in ((other, middle), (line, middle - moved_lines(line[None], pose)[0, 2] + line[2])):
        length, lever = one[3] - one[2], along - 0.5 * (one[2] + one[3])
        spread += np.diag([12.0 / length**2, 1.0 + 12.0 * lever**2 / length**2]) * one[4] ** 2 / BENDS
    derivatives = [
        (difference(pose + d, middle)[0] - difference(pose - d, middle)[0]) / 2e-6 for d in 1e-6 * np.eye(3)
    ]
    return error, spread, np.array(derivatives).T


def test_pairs_and_their_pull_are_those_of_matrices() -> None:
    pose, covariance = np.array([0.1, -0.05, 0.03]), np.diag([0.01, 0.02, 0.003])
    covariance[0, 2] = covariance[2, 0] = 0.001
    pairs, difference = np.empty((2, 2)), np.empty(7)
    find_pairs(SIDES, SIDES, pose, covariance, difference, pairs)
    assert pairs[:, 0].tolist() == [0.0, 1.0]
    system = np.column_stack([INFORMATION, np.zeros(3)])
    pull(SIDES, SIDES, pose, pairs, difference, system)
    expected, force = INFORMATION.copy(), np.zeros(3)
    for line, (_, probability) in zip(SIDES, pairs.tolist(), strict=True):
        error, own, jacobian = differences_of(line, line, pose)
        spread = own + jacobian @ covariance @ jacobian.T
        density = (
            0.9
            * math.exp(-0.5 * error @ np.linalg.solve(spread, error))
            / (math.tau * math.sqrt(np.linalg.det(spread)))
        )
        assert probability == pytest.approx(density / (density + FALSE_PAIRS / (4.0 * PAIR_RAD * PAIR_M)), rel=1e-5)
        expected += probability * jacobian.T @ np.linalg.solve(own, jacobian)
        force -= probability * jacobian.T @ np.linalg.solve(own, error)
    np.testing.assert_allclose(system, np.column_stack([expected, force]), rtol=1e-5, atol=1e-3)


def test_walls_give_the_direction_and_the_place_across() -> None:
    true, off = np.array([0.5, 0.0, 0.02]), np.array([0.04, -0.06, 0.05])
    back = -np.array([[math.cos(true[2]), math.sin(true[2])], [-math.sin(true[2]), math.cos(true[2])]]) @ true[:2]
    lines = moved_lines(SIDES, np.array([*back, -true[2]]))
    pose, information = with_lines(SIDES, lines, true + off, INFORMATION)
    np.testing.assert_allclose(pose[1:], true[1:], atol=0.01)
    assert information[2, 2] > 5.0 * INFORMATION[2, 2]
    assert abs(pose[0] - true[0] - off[0]) < 0.01  # along the walls they say nothing


@pytest.mark.parametrize("turn", [0.2, 0.25, 0.3])
def test_a_line_of_another_wall_is_not_paired(turn: float) -> None:
    """The cells' match knows better by 3.5 to 5 standard deviations."""
    other = moved_lines(SIDES, np.array([0.0, 0.0, turn]))
    pose, information = with_lines(SIDES, other, np.zeros(3), np.diag([400.0, 400.0, 300.0]))
    assert pose.tolist() == [0.0, 0.0, 0.0]
    assert information[2, 2] == 300.0
    alone, same = with_lines(SIDES[:0], SIDES, np.zeros(3), INFORMATION)
    assert alone.tolist() == [0.0, 0.0, 0.0]
    assert same.tolist() == INFORMATION.tolist()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_of_two_lines_that_which_fits_is_paired(order: tuple[int, int]) -> None:
    """A cupboard before a wall: the wall has more in common with the cupboard's front, which fits."""
    before = np.array([[0.5 * math.pi, 1.0, -0.5, 1.5, 0.01], [0.5 * math.pi, 1.3, -2.0, 4.0, 0.01]])
    pose, _ = with_lines(before[list(order)], before[:1], np.array([0.0, 0.05, 0.0]), INFORMATION)
    np.testing.assert_allclose(pose, 0.0, atol=0.01)
