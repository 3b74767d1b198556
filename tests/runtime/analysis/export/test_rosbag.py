"""Tests of the export as a ROS 2 bag, read back by rosbags."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from runtime.analysis.export.rosbag import write_bag
from tests.runtime.analysis.synthetic_timeline import synthetic_timeline, with_cross_paths, with_grid


def test_a_run_as_a_ros_2_bag(tmp_path: Path) -> None:
    run = synthetic_timeline()
    (bag,) = write_bag(run, tmp_path / "bag")
    kinds: dict[str, str] = {}
    counts: Counter[str] = Counter()
    newest: dict[str, Any] = {}
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, at, data in reader.messages():
            kinds[connection.topic] = connection.msgtype
            counts[connection.topic] += 1
            newest[connection.topic] = reader.deserialize(data, connection.msgtype)
            assert run.start_unix_ns <= at <= run.unix_ns(run.seconds)
    assert kinds == {
        "/sonar/s06": "sensor_msgs/msg/Range",
        "/odom": "nav_msgs/msg/Odometry",
        "/markers": "visualization_msgs/msg/MarkerArray",
        "/truth": "visualization_msgs/msg/MarkerArray",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/tf_static": "tf2_msgs/msg/TFMessage",
    }
    assert counts["/sonar/s06"] == len(run.echoes)
    published = newest["/sonar/s06"]
    assert math.isinf(published.range), "without an echo, as REP 117 defines"
    assert published.header.frame_id == "sonar_06"
    assert published.field_of_view == pytest.approx(math.radians(24.0))
    odometry = run.odometry[-1][1]
    assert newest["/odom"].pose.pose.position.x == odometry.pose.x
    assert newest["/odom"].twist.twist.linear.x == odometry.twist.v
    models = [m for m in newest["/markers"].markers if m.ns.startswith("models/")]
    places = np.array([[(p.x, p.y) for p in m.points[:-1]] for m in models]).mean(axis=1)
    assert np.allclose(places, [(o.x, o.y) for o in run.objects])
    assert len(newest["/tf_static"].transforms) == 25
    assert len(newest["/truth"].markers) == 6


def test_cross_paths_are_markers(tmp_path: Path) -> None:
    (folder,) = write_bag(with_cross_paths(synthetic_timeline()), tmp_path / "bag")
    with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        *_, (connection, _, data) = (one for one in reader.messages() if one[0].topic == "/markers")
        last: Any = reader.deserialize(data, connection.msgtype)
    assert [len(m.points) for m in last.markers if m.ns == "cross_paths"] == [9, 9]


def test_the_evidence_grid_is_an_occupancy_grid(tmp_path: Path) -> None:
    (folder,) = write_bag(with_grid(synthetic_timeline()), tmp_path / "bag")
    with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        (found,) = (one for one in reader.messages() if one[0].topic == "/grid")
        grid: Any = reader.deserialize(found[2], found[0].msgtype)
    assert found[0].msgtype == "nav_msgs/msg/OccupancyGrid"
    assert grid.data.reshape(grid.info.height, grid.info.width).tolist() == [[-1, 10, 90], [50, -1, 100]]
    assert (grid.header.frame_id, grid.info.origin.position.x, grid.info.origin.position.y) == ("odom", 1.0, -0.5)
    assert grid.info.resolution == pytest.approx(0.1)
