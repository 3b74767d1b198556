"""Tests of the export as a ROS 2 bag, read back by rosbags."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.typesys import Stores, get_typestore

from drivers.messages import Pose, Twist
from runtime.analysis.export.ros_messages import Frames
from runtime.analysis.export.rosbag import as_seen, write_bag
from runtime.analysis.timeline import MapPlace
from runtime.bridges.ros2.topics import Topics
from runtime.console.frames.session_info import session_info
from tests.polylines import BEND
from tests.runtime.analysis.synthetic_timeline import (
    synthetic_timeline,
    with_cross_paths,
    with_grid,
    with_polyline,
)


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
        "/objects": "visualization_msgs/msg/MarkerArray",
        "/object_poses": "geometry_msgs/msg/PoseWithCovarianceStamped",
        "/markers": "visualization_msgs/msg/MarkerArray",
        "/truth": "visualization_msgs/msg/MarkerArray",
        "/mode": "std_msgs/msg/String",
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
    drums = [m for m in newest["/objects"].markers if m.ns == "drum"]
    places = np.array([(m.pose.position.x, m.pose.position.y) for m in drums])
    assert np.allclose(places, [(o.x, o.y) for o in run.objects])
    assert counts["/object_poses"] == sum(len(snapshot.objects) for snapshot in run.snapshots)
    assert len(newest["/tf_static"].transforms) == 24
    assert len(newest["/truth"].markers) == 6
    assert newest["/mode"].data == "DRIVE"


def read(bag: Path) -> dict[str, list[Any]]:
    """Return the messages of each topic."""
    found: dict[str, list[Any]] = {}
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, _, data in reader.messages():
            found.setdefault(connection.topic, []).append(reader.deserialize(data, connection.msgtype))
    return found


def plain(message: Any) -> Any:
    """Return a message as plain data."""
    if dataclasses.is_dataclass(message):
        fields = {f.name: plain(getattr(message, f.name)) for f in dataclasses.fields(message)}
        return {name: value for name, value in fields.items() if name != "__msgtype__"}
    if isinstance(message, np.ndarray | list | tuple):
        return [plain(one) for one in message]
    return message


def contains(whole: Any, part: Any) -> bool:
    """Return whether plain data have the fields that are given, within float32."""
    if isinstance(part, dict):
        return all(contains(whole[name], value) for name, value in part.items())
    if isinstance(part, list):
        return len(whole) == len(part) and all(map(contains, whole, part))
    return bool(whole == pytest.approx(part)) if isinstance(part, float) else bool(whole == part)


@pytest.mark.parametrize("localized", [False, True])
def test_a_bag_holds_what_the_live_bridge_publishes(tmp_path: Path, localized: bool) -> None:
    """The last moment of a run, as a state of the console before the bridge, and in the bag."""
    run = with_polyline(synthetic_timeline())
    place = MapPlace(Pose(1.0, 2.0, 0.3), np.diag([1e-3, 2e-3, 3e-3]), Pose(0.2, -0.1, 0.05))
    if localized:
        run.snapshots[-1] = replace(run.snapshots[-1], place=place)
    bag = read(write_bag(run, tmp_path / "bag")[0])
    live = Topics(Frames())
    live.begin(session_info(run.settings, name="denning", emulated=True, units="m"))
    last, odometry = run.snapshots[-1], run.odometry[-1][1]
    at_s = 1e-9 * run.unix_ns(last.t_s)
    ranges, ages = list[float | None]([None] * 24), list[float | None]([None] * 24)
    heard = run.echoes[-1]
    ranges[6], ages[6] = (-1.0 if math.isinf(heard["range_m"]) else float(heard["range_m"])), 0.0
    state = {
        "mode": "DRIVE", "reason": None, "hold_reason": None, "cycle": 3, "robot_s": odometry.robot_s,
        "pose": [last.pose.x, last.pose.y, last.pose.theta], "ring_yaw": last.ring_yaw, "flags": [], "ranges": ranges,
        "twist": [odometry.twist.v, odometry.twist.w], "age": ages, "paused": False, "speed": 1.0, "playback": None,
        "objects": [as_seen(one) for one in (*last.objects, *last.walls)], "sensors": [], "link": None, "clients": 1,
        "localized": {
            "pose": [1.0, 2.0, 0.3], "covariance": [1e-3, 0.0, 2e-3, 3e-3], "frame": [0.2, -0.1, 0.05],
            "status": "tracking", "probability": 0.9,
        } if localized else None,
        "cycle_us": 1.0, "late_us": 1.0, "missed": 0, "late": 0, "quanta": 0,
    }  # fmt: skip
    polyline = {"number": 3, "points": BEND.points.tolist(), "probability": 0.9}
    frames, outputs = live.take(state, at_s, at_s, [polyline])
    names = {frame.child for frame in frames} | {f"sonar_{k:02d}" for k in range(24)}
    found = {t.child_frame_id: t for topic in ("/tf", "/tf_static") for m in bag[topic] for t in m.transforms}
    assert set(found) == names
    for frame in frames:
        there = found[frame.child]
        assert there.header.frame_id == frame.parent
        move = there.transform.translation
        assert (move.x, move.y, move.z) == pytest.approx(frame.translation)
    compared = [output for output in outputs if output.topic != "/diagnostics"]
    assert {f"/{output.topic}" for output in compared} == set(bag) - {"/tf", "/tf_static", "/markers", "/truth"}
    for output in compared:
        messages = [plain(message) for message in bag[f"/{output.topic}"]]
        wanted = without_stamps(output.fields)
        assert any(contains(without_delete_all(message), wanted) for message in messages), output.topic


def without_stamps(fields: Any) -> Any:
    if isinstance(fields, dict):
        return {name: without_stamps(value) for name, value in fields.items() if name != "stamp"}
    return [without_stamps(one) for one in fields] if isinstance(fields, list) else fields


def without_delete_all(message: dict[str, Any]) -> dict[str, Any]:
    if "markers" not in message:
        return message
    return {"markers": [marker for marker in message["markers"] if marker["action"] != 3]}


def test_connections_offer_the_qos_of_the_live_bridge(tmp_path: Path) -> None:
    """`ros2 bag play` offers what the metadata say; a listener of frames needs transient local, or gets nothing."""
    (folder,) = write_bag(with_grid(synthetic_timeline()), tmp_path / "bag")
    with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        offered = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}  # type: ignore[union-attr]
    latched = {topic for topic, qos in offered.items() if qos.durability is QosDurability.TRANSIENT_LOCAL}
    assert latched == {"/tf_static", "/mode", "/grid"}
    assert offered["/sonar/s06"].reliability is QosReliability.BEST_EFFORT
    assert (offered["/odom"].reliability, offered["/odom"].depth) == (QosReliability.RELIABLE, 10)
    assert offered["/tf"].depth == 100
    text = (folder / "metadata.yaml").read_text()
    assert "transient_local" in text


def test_a_ring_log_has_odometry_of_unknown_velocity(tmp_path: Path) -> None:
    run = synthetic_timeline(with_world=False)
    run.odometry = [(t, replace(o, twist=Twist(math.nan, math.nan))) for t, o in run.odometry]
    twist = read(write_bag(run, tmp_path / "bag")[0])["/odom"][-1].twist
    assert (twist.twist.linear.x, twist.covariance[0]) == (0.0, 1e6)


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
