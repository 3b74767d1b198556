"""What is remembered follows its maps: what is near stays, what lies behind comes into its place."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Pose
from perception.kernel import Floats
from perception.localization.submaps.held_maps import HELD_MOVED_M, HELD_REACH_M, HeldMaps

WAY: Floats = 3.0 * np.arange(12.0)


def held() -> tuple[HeldMaps, Floats]:
    """Return twelve maps along a straight way by odometry, and their poses."""
    maps, poses = HeldMaps(), np.column_stack([WAY, np.zeros(12), np.zeros(12)])
    for pose in poses:
        maps.append(pose)
    return maps, poses


def test_what_has_not_moved_to_itself_stays() -> None:
    maps, poses = held()
    assert maps.move_to(poses, WAY) is None
    c, s = math.cos(0.4), math.sin(0.4)
    turned = poses @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + (5.0, 1.0, 0.4)
    assert maps.move_to(turned, WAY) is None, "all maps together move nothing"
    poses[3, 1] += 0.9 * HELD_MOVED_M
    assert maps.move_to(poses, WAY) is None
    assert not maps.is_moved
    assert maps.in_filter(np.array([1.0, 2.0, 3.0])).tolist() == [1.0, 2.0, 3.0]


def test_what_lies_behind_moves_and_what_is_near_does_not() -> None:
    maps, before = held()
    known = before.copy()
    known[:3] += (0.6, -0.3, 0.1)
    moves = maps.move_to(known, WAY)
    assert moves is not None
    assert moves.is_first
    assert maps.is_moved
    near, behind = (np.abs(maps.archived_rows - before)[which] for which in (slice(-3, None), slice(3)))
    assert near.max() < 0.15 < 0.2 < behind[:, :2].max()
    for k in (0, 2, 11):  # the same as to enter anew what was heard there
        seen = Pose(*before[k].tolist()).compose(Pose(1.0, 0.5, 0.0))
        x, y, _ = moves.moved(np.array([k]), np.array([seen.x]), np.array([seen.y]))
        anew = Pose(*maps.in_filter(known[k]).tolist()).compose(Pose(1.0, 0.5, 0.0))
        assert (x[0], y[0]) == pytest.approx((anew.x, anew.y))
    assert maps.move_to(known, WAY) is None, "it is done"
    maps.append(known[-1])
    assert maps.archived_rows[-1].tolist() == pytest.approx(maps.archived_rows[-2].tolist())
    assert moves.middles.tolist() == before[:, :2].tolist()
    known[0] += 0.5
    again = maps.move_to(np.vstack([known, known[-1:]]), np.append(WAY, 36.0))
    assert again is not None
    assert not again.is_first


def test_a_turn_counts_by_what_it_moves() -> None:
    maps, poses = held()
    poses[0, 2] = 1.2 * HELD_MOVED_M / HELD_REACH_M
    assert maps.move_to(poses, WAY) is not None


def test_a_reset_begins_in_odometrys_frame() -> None:
    maps, poses = held()
    poses[:3] += 0.5
    assert maps.move_to(poses, WAY) is not None
    maps.reset()
    assert not maps.is_moved
    assert len(maps.archived_rows) == 0
    assert maps.in_filter(poses[0]).tolist() == poses[0].tolist()
