"""Keyframes: where their readings lie, when they end, and what a search takes of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from perception.kernel import Floats
from perception.localization.known_room.keyframes import KEYFRAMES_MAX, Keyframes
from perception.shared_numbers import READING_M

MOUNTS = np.array([[0.2 * math.cos(a), 0.2 * math.sin(a), a] for a in np.linspace(0.0, 6.0, 8).tolist()])


def firing(x: float, y: float, theta: float, sensors: range, range_m: float = 1.0) -> Firing:
    """A firing of some sensors, each with a range of its own."""
    ranges = np.full(len(MOUNTS), np.nan)
    ranges[sensors] = [range_m + 0.01 * k for k in sensors]
    return Firing(0.0, Pose(x, y, 0.5), theta, ranges)


def places(at: Pose, sensors: range) -> Floats:
    """Where sensors are at a pose: x, y, cosine and sine of the axis."""
    found = [at.compose(Pose(*MOUNTS[k])) for k in sensors]
    return np.array([(one.x, one.y, math.cos(one.theta), math.sin(one.theta)) for one in found])


def test_readings_lie_where_their_sensors_were() -> None:
    keyframes = Keyframes(MOUNTS)
    poses = [Pose(3.0, -1.0, 0.4), Pose(3.04, -0.97, 0.45), Pose(3.08, -0.91, 0.47)]
    for at, sensors in zip(poses, (range(4), range(2, 6), range(6, 7)), strict=True):
        ended = keyframes.observe(firing(at.x, at.y, at.theta, sensors, 1.0 + at.theta))
    assert ended
    last = poses[-1].inverse()
    expected = np.concatenate(
        [
            places(last.compose(at), sensors)
            for at, sensors in zip(poses, (range(2), range(2, 6), range(6, 7)), strict=True)
        ]
    )
    found = keyframes.readings[0, : keyframes.counts[0]]
    assert found[:, :4] == pytest.approx(expected)
    assert found[:, 4] == pytest.approx([1.4, 1.41, 1.47, 1.48, 1.49, 1.5, 1.53])
    assert (keyframes.pose(0).x, keyframes.pose(0).theta) == (poses[-1].x, poses[-1].theta)


def test_a_turn_ends_a_keyframe_and_a_stand_makes_one() -> None:
    keyframes = Keyframes(MOUNTS)
    ended = [keyframes.observe(firing(0.0, 0.0, 0.0, range(k % 8, k % 8 + 1))) for k in range(30)]
    assert np.flatnonzero(ended).tolist() == [7]
    assert keyframes.counts[0] == 8
    assert keyframes.observe(firing(0.0, 0.0, 0.2, range(1)))
    assert not keyframes.observe(firing(READING_M - 0.01, 0.0, 0.2, range(1)))
    assert keyframes.observe(firing(READING_M, 0.0, 0.2, range(1)))
    assert keyframes.driven_m == pytest.approx(READING_M)
    assert keyframes.way_since(1) == pytest.approx(READING_M)


def test_the_keyframes_of_a_window_are_compounded() -> None:
    keyframes = Keyframes(MOUNTS)
    for k in range(KEYFRAMES_MAX + 20):
        assert keyframes.observe(firing(0.11 * k, 0.0, 0.02 * k, range(8))) == (k > 0)
    first = keyframes.count - 3
    found = keyframes.compounded(first, 100)
    here = keyframes.pose(first).inverse()
    poses = [keyframes.pose(number) for number in range(first, keyframes.count)]
    assert found[:, :4] == pytest.approx(np.concatenate([places(here.compose(at), range(8)) for at in poses]))
    few = keyframes.compounded(first, 7)
    assert len(few) == 7
    assert np.array_equal(few[[0, -1]], found[[0, -1]])
