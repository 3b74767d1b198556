"""Tests of the builder of timelines: where echoes began, what a restart discards, how many snapshots are kept."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.messages import CrossPaths, Firing, Flags, Odometry, Pose, Twist
from perception.localization.localized_pose import KnownWay, Moment
from perception.localization.odometry_frame import OdometryFrame
from perception.pipeline import Perception
from runtime.analysis import timeline_builder
from runtime.analysis.timeline import Timeline
from runtime.analysis.timeline_builder import TimelineBuilder
from tests.polylines import BEND, report_bend
from tests.runtime.analysis.synthetic_timeline import SETTINGS

RADIUS_M = 0.381


@pytest.fixture
def timeline() -> Timeline:
    return Timeline(Path("x"), SETTINGS, None)


def perception() -> Perception:
    return Perception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception)


def firing(robot_s: float, pose: Pose, yaw: float = 0.0, **ranges_m: float) -> Firing:
    """Return a firing of the named sensors (`s6=1.0`) only."""
    ranges = np.full(24, np.nan)
    for name, range_m in ranges_m.items():
        ranges[int(name[1:])] = range_m
    return Firing(robot_s, pose, yaw, ranges)


def odometry(x: float) -> Odometry:
    return Odometry(0.0, Pose(x, 0.0, 0.0), 0.0, Twist(0.0, 0.0), Flags.NONE, 0)


def test_echoes_begin_where_their_sensors_were(timeline: Timeline) -> None:
    builder = TimelineBuilder(timeline)
    builder.add_firing(0.5, firing(7.5, Pose(1.0, 2.0, 0.3), math.pi / 2, s0=1.0, s6=math.inf))
    assert builder.pose == Pose(1.0, 2.0, 0.3)
    builder.finish(None)
    rows = timeline.echoes
    assert rows[["t_s", "sensor", "range_m", "robot_s"]].tolist() == [(0.5, 0, 1.0, 7.5), (0.5, 6, math.inf, 7.5)]
    assert rows["x"] == pytest.approx([1.0, 1.0 - RADIUS_M])
    assert rows["y"] == pytest.approx([2.0 + RADIUS_M, 2.0])
    assert rows["bearing"] == pytest.approx([math.pi / 2, math.pi])


def test_cross_paths_have_both_sensors_where_they_were(timeline: Timeline) -> None:
    builder = TimelineBuilder(timeline)
    crosses = CrossPaths(np.array([0, 0]), np.array([6, 12]), np.array([1.5, math.inf]))
    builder.add_firing(0.1, replace(firing(7.0, Pose(9.0, 9.0, 0.0)), cross_paths=crosses))
    builder.restart(0.2)
    builder.add_firing(0.5, firing(7.4, Pose(1.0, 2.0, 0.3), s0=1.0))
    builder.add_firing(0.6, replace(firing(7.5, Pose(1.0, 2.0, 0.3), math.pi / 2), cross_paths=crosses))
    builder.finish(None)
    rows = timeline.cross_paths
    assert rows[["t_s", "transmitter", "listener", "half_path_m", "robot_s"]].tolist() == [
        (0.6, 0, 6, 1.5, 7.5), (0.6, 0, 12, math.inf, 7.5)
    ]  # fmt: skip
    assert rows["x"] == pytest.approx([1.0, 1.0])
    assert rows["listener_x"] == pytest.approx([1.0 - RADIUS_M, 1.0])
    assert rows["listener_y"] == pytest.approx([2.0, 2.0 - RADIUS_M])
    assert rows["listener_bearing"] == pytest.approx([math.pi, 1.5 * math.pi])


def test_odometry_is_kept_ten_times_a_second_at_most(timeline: Timeline) -> None:
    builder = TimelineBuilder(timeline)
    for k in range(40):
        builder.add_odometry(k / 32, odometry(float(k)))
    assert [o.pose.x for _, o in timeline.odometry] == [4.0 * k for k in range(10)]
    assert builder.pose == Pose(39.0, 0.0, 0.0)


def test_a_restart_discards_what_came_before(timeline: Timeline) -> None:
    builder, seen = TimelineBuilder(timeline), perception()
    builder.add_firing(0.0, firing(1.0, Pose(0.0, 0.0, 0.0), s0=1.0))
    builder.add_odometry(0.0, odometry(0.0))
    builder.end_cycle(0.0, seen)
    assert len(timeline.snapshots) == 1
    builder.restart(2.0)
    assert (builder.pose, timeline.snapshots, timeline.odometry) == (None, [], [])
    builder.add_firing(2.5, firing(0.1, Pose(0.0, 0.0, 0.0), s3=2.0))
    builder.finish(seen)
    assert timeline.echoes["sensor"].tolist() == [3]
    assert timeline.notes == ["the robot restarted after 2.0 s; nothing before that is shown"]


def test_a_long_run_has_fewer_snapshots_and_always_its_end(
    timeline: Timeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(timeline_builder, "SNAPSHOTS_MAX", 8)
    builder, seen = TimelineBuilder(timeline), perception()
    for k in range(200):
        builder.add_odometry(0.05 * k, odometry(0.01 * k))
        builder.end_cycle(0.05 * k, seen)
    builder.finish(seen)
    times = [snapshot.t_s for snapshot in timeline.snapshots]
    assert len(times) <= 9
    assert (times[0], times[-1]) == pytest.approx((0.0, 9.95))
    gaps = np.diff(times[:-1])
    assert gaps.min() >= 0.25 * 4 - 0.05, "the interval doubled twice or more"


def test_without_a_pose_there_is_no_snapshot(timeline: Timeline) -> None:
    builder = TimelineBuilder(timeline)
    builder.end_cycle(0.0, perception())
    builder.finish(perception())
    assert timeline.last is None


def test_a_snapshot_has_the_polylines(timeline: Timeline, monkeypatch: pytest.MonkeyPatch) -> None:
    assert timeline.polylines == ()
    report_bend(monkeypatch)
    builder = TimelineBuilder(timeline)
    builder.add_odometry(0.0, odometry(0.0))
    builder.end_cycle(0.0, perception())
    assert timeline.polylines == timeline.snapshots[0].polylines == (BEND,)


class CorrectedFrame(OdometryFrame):
    """A frame that knows at the end that odometry was 0.1 m too far for each map of the way before."""

    corrects_path = True
    submap = 0

    def moment(self) -> Moment:
        """Return the moment of the last firing."""
        return Moment(self.submap, np.array([float(self.submap), 0.0, 0.0]), 0.0)

    def known_way(self) -> KnownWay:
        """Return the maps of the way."""
        return KnownWay(np.array([[0.9, 0.0], [2.0, 0.0]]), np.zeros((1, 5)), np.zeros((0, 4)))

    def odometry_from_map(self) -> Pose:
        """Return the pose of the map frame in odometry's."""
        return Pose(1.0, 0.0, 0.0)

    def moved_since(self, moment: Moment) -> Pose:
        """Return how what was heard then moves."""
        return Pose(0.1 * (moment.submap - self.submap), 0.0, 0.0)


def test_echoes_are_also_at_poses_as_known_at_the_end(timeline: Timeline) -> None:
    builder, seen, frame = TimelineBuilder(timeline), perception(), CorrectedFrame()
    seen.map_frame = frame
    for k in range(3):
        frame.submap = k
        for _ in range(k):
            builder.add_firing(0.1 * k, firing(0.1 * k, Pose(float(k), 0.0, 0.0), s0=1.0))
        builder.end_cycle(0.1 * k, seen)
    builder.add_firing(0.3, firing(0.3, Pose(3.0, 0.0, 0.0), s0=1.0))
    builder.finish(seen)
    assert timeline.known_echoes is not None
    moved = timeline.known_echoes["x"] - timeline.echoes["x"]
    assert moved.tolist() == pytest.approx([-0.1, 0.0, 0.0, 0.0])
    assert timeline.echoes["x"].tolist() == pytest.approx([k + RADIUS_M for k in (1.0, 2.0, 2.0, 3.0)])
    assert timeline.known_way is not None
    assert timeline.known_way.path.tolist() == [[0.9, 0.0], [2.0, 0.0]]
    assert timeline.odometry_from_map == Pose(1.0, 0.0, 0.0)
