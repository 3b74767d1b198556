"""Poses are composed as matrices would be; motions by odometry are stretched and bent by its scales."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.kernel import Floats
from perception.localization.submaps.pose_graph import Node
from perception.localization.submaps.submap_records import (
    LOST_WAY,
    Rows,
    between,
    compose,
    fresh_sensors,
    match_link,
    node_at,
    odometry_link,
    pose_of,
    scaled,
    spread_about,
    spread_beyond,
    unlost,
)
from perception.records import Structured


def matrix(pose: Floats) -> Floats:
    """Return the homogeneous matrix of a pose: the oracle."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


def test_poses_compose_as_matrices() -> None:
    a, b = np.array([1.0, -2.0, 0.7]), np.array([0.3, 0.9, -2.0])
    np.testing.assert_allclose(matrix(compose(a, b)), matrix(a) @ matrix(b))
    np.testing.assert_allclose(between(a, compose(a, b)), b)


def test_scales_lengthen_a_way_and_bend_its_turn() -> None:
    """The oracle: an even arc, step by step."""
    scales, steps = np.array([0.05, 0.1, 0.0]), 2000
    raw, true = np.zeros(3), np.zeros(3)
    step = np.array([2.0 / steps, 0.0, 0.8 / steps])
    for _ in range(steps):
        raw, true = compose(raw, step), compose(true, step * (1.05, 1.0, 1.1))
    np.testing.assert_allclose(scaled(raw, scales), true, atol=0.02)


def test_derivatives_by_scales_are_those_of_the_motion() -> None:
    moved = np.array([1.5, 0.2, 0.4])
    row = odometry_link(3, moved, np.eye(3))[0]
    for k in range(2):
        scales = np.zeros(3)
        scales[k] = 1e-6
        np.testing.assert_allclose((scaled(moved, scales) - moved) / 1e-6, row["by_scale"][k], atol=1e-5)
    assert (row["of"], row["to"], row["is_match"]) == (3, 4, 0)


def matched(of: int, to: int, pose: Floats, information: Floats, *, is_next: bool) -> Structured:
    """Return a match by cells alone."""
    return match_link(of, to, *unlost(pose, is_next=is_next), information, is_next=is_next)


@pytest.mark.parametrize("is_next", [True, False])
def test_a_match_may_lose_way(is_next: bool) -> None:
    row = matched(1, 4, np.array([1.0, 0.5, 7.0]), np.eye(3), is_next=is_next)[0]
    assert row["pose"][2] == pytest.approx(7.0 - 2.0 * math.pi)
    way = np.array([1.0, 0.5, 0.0]) * (1.0 + LOST_WAY[not is_next])
    assert row["pose"][:2].tolist() == way[:2].tolist()
    assert row["by_scale"][2 if is_next else 3].tolist() == way.tolist()
    assert not row["by_scale"][3 if is_next else 2].any()


def test_a_pose_survives_as_a_record() -> None:
    pose = np.array([1.0, 2.0, 3.0])
    assert pose_of(node_at(pose)[0]).tolist() == pose.tolist()
    rows = Rows(Node)
    rows.append(node_at(pose))
    assert rows.archived_rows["y"].tolist() == [2.0]
    assert rows.archived_rows.dtype == Node.DTYPE


def test_rows_grow_and_go_on_after_they_are_replaced() -> None:
    rows = Rows(Node)
    for k in range(40):
        rows.append(node_at(np.array([float(k), 0.0, 0.0])))
    last = rows.archived_rows
    assert last["x"].tolist() == list(range(40))
    rows.archived_rows = last[:2].copy()
    rows.append(node_at(np.array([9.0, 0.0, 0.0])))
    assert rows.archived_rows["x"].tolist() == [0.0, 1.0, 9.0]
    assert last["x"].tolist() == list(range(40)), "who replaces the rows may keep the old ones"


def test_the_spread_of_a_further_map_is_that_of_the_whole_chain() -> None:
    places = [np.array([0.3 * k, 0.1 * k * k, 0.2 * k]) for k in range(5)]
    links = np.concatenate(
        [
            odometry_link(k, between(places[k], places[k + 1]), np.diag([90.0 + k, 60.0, 400.0]) + 5.0 * k)
            for k in range(4)
        ]
    )
    nodes = np.concatenate([node_at(place) for place in places])
    whole = spread_about(0, links, nodes)
    for k in range(4):
        beyond = spread_beyond(whole[k], links[k : k + 1], places[k], places[k + 1])
        assert beyond.tolist() == whole[k + 1].tolist()


def test_a_reading_is_fresh_once_its_sensor_is_elsewhere() -> None:
    latest = np.array([[math.inf] * 3, [0.0, 0.0, 0.0], [0.95, 0.0, 0.0], [1.0, 0.0, -0.2], [math.inf] * 3])
    ranges = np.array([1.0, 1.0, math.inf, 1.0, math.nan])
    fresh = fresh_sensors(ranges, np.array([1.0, 0.0, 0.0]), latest)
    assert fresh.tolist() == [True, True, False, True, False]
