"""States as ROS messages, in plain data: what a robot's frames, ranges and objects look like to others."""

from __future__ import annotations

import base64
import itertools
import math
from typing import Any

import pytest

from config.load import load_settings
from drivers.ros_tf import Frame
from runtime.analysis.export.ros_messages import STRIP, Frames, Output
from runtime.bridges.ros2.topics import DELETE, Topics, disconnected
from runtime.console.frames.session_info import session_info

DRUM: dict[str, Any] = {
    "number": 7, "model": "drum", "x": 2.0, "y": 1.0, "theta": 0.3, "sigma": 0.01,
    "covariance": [4e-4, 1e-4, 9e-4], "probability": 0.99, "support": 40, "score": 0.99, "confirmed": False,
    "placed": False, "ends": None,
}  # fmt: skip
WALL = {**DRUM, "number": None, "model": "wall", "ends": [0.0, 1.0, 2.0, 1.0]}


def state(robot_s: float = 10.0, **changes: Any) -> dict[str, Any]:
    ranges, ages = [None] * 24, [None] * 24
    return {
        "type": "state", "mode": "DRIVE", "reason": None, "hold_reason": None, "cycle": 3, "robot_s": robot_s,
        "pose": [1.0, 2.0, 0.5], "ring_yaw": 0.2, "twist": [0.3, 0.1], "flags": ["BUMPER"], "ranges": ranges,
        "age": ages, "objects": [], "localized": None, "sensors": [], "paused": False, "speed": 1.0, "playback": None,
        "cycle_us": 500.0, "late_us": 3.0, "missed": 0, "late": 0, "quanta": 4, "clients": 1,
        "link": {"frames": 9, "bad": 0, "lost": 0}, **changes,
    }  # fmt: skip


def topics(frames: Frames | None = None) -> Topics:
    made = Topics(frames or Frames())
    made.begin(session_info(load_settings("hallway"), name="denning", emulated=True, units="m"))
    return made


def of(outputs: list[Output], topic: str) -> list[dict[str, Any]]:
    return [output.fields for output in outputs if output.topic == topic]


def yaw(frame: Frame) -> float:
    return 2.0 * math.atan2(frame.rotation[2], frame.rotation[3])


def test_a_reading_is_published_once_with_its_own_time_and_no_echo_is_infinite() -> None:
    made, first = topics(), state()
    first["ranges"][3], first["age"][3] = 1.5, 0.04
    first["ranges"][4], first["age"][4] = -1.0, 0.04
    _, outputs = made.take(first, 100.0, 100.0)
    (near,), (far,) = of(outputs, "sonar/s03"), of(outputs, "sonar/s04")
    assert near["header"] == {"stamp": {"sec": 99, "nanosec": 960_000_000}, "frame_id": "sonar_03"}
    assert (near["range"], near["min_range"], near["max_range"]) == (1.5, 0.1524, 7.7724)
    assert near["field_of_view"] == pytest.approx(math.radians(24.0))
    assert far["range"] == math.inf, "REP 117"
    second = state(10.05, ranges=first["ranges"], age=[a if a is None else a + 0.05 for a in first["age"]])
    assert not [output for output in made.take(second, 100.05, 100.05)[1] if output.topic.startswith("sonar/")]
    second["age"][3] = 0.0
    assert [output.topic for output in made.take(second, 100.05, 100.05)[1] if output.topic.startswith("sonar/")] == [
        "sonar/s03"
    ]


LOCALIZED: dict[str, Any] = {
    "pose": [5.0, 1.0, 0.7], "covariance": [1.0, 2.0, 3.0, 4.0], "frame": [1.0, 0.0, 0.5 * math.pi],
    "status": "tracking", "probability": 0.98,
}  # fmt: skip


def test_frames_lead_from_odometry_to_every_sensor() -> None:
    made = topics()
    frames, outputs = made.take(state(), 100.0, 100.0)
    assert [(f.parent, f.child) for f in frames] == [("odom", "base_link"), ("base_link", "ring")]
    assert frames[0].translation == (1.0, 2.0, 0.0)
    assert [yaw(frame) for frame in frames] == pytest.approx([0.5, -0.3])
    static = made.static(5)
    assert [f.child for f in static] == [f"sonar_{k:02d}" for k in range(24)]
    assert static[6].translation == pytest.approx((0.0, 0.381, 0.0))
    assert yaw(static[6]) == pytest.approx(0.5 * math.pi)
    (odometry,) = of(outputs, "odom")
    assert (odometry["header"]["frame_id"], odometry["child_frame_id"]) == ("odom", "base_link")
    assert odometry["twist"]["twist"] == {"linear": {"x": 0.3}, "angular": {"z": 0.1}}


def test_a_known_room_moves_the_odometry_in_the_map() -> None:
    frames, outputs = topics().take(state(localized=LOCALIZED), 100.0, 100.0)
    assert (frames[0].parent, frames[0].child) == ("map", "odom")
    assert frames[0].translation == pytest.approx((0.0, 1.0, 0.0)), "the inverse of the map in odom"
    assert yaw(frames[0]) == pytest.approx(-0.5 * math.pi)
    (pose,) = of(outputs, "pose")
    covariance = pose["pose"]["covariance"]
    assert (covariance[0], covariance[1], covariance[6], covariance[7], covariance[35]) == (1.0, 2.0, 2.0, 3.0, 4.0)


def test_a_prefix_is_before_every_frame_but_the_map() -> None:
    made = topics(Frames(prefix="r1/"))
    frames, _ = made.take(state(localized=LOCALIZED), 100.0, 100.0)
    names = [*itertools.chain(*((f.parent, f.child) for f in frames)), made.static(0)[0].child]
    assert names == ["map", "r1/odom", "r1/odom", "r1/base_link", "r1/base_link", "r1/ring", "r1/sonar_00"]


def test_objects_are_markers_that_keep_their_numbers_and_are_deleted() -> None:
    made = topics()
    _, outputs = made.take(state(objects=[DRUM, WALL]), 100.0, 100.0)
    (markers,) = of(outputs, "objects")
    named = {(m["ns"], m["id"]): m for m in markers["markers"]}
    assert named.keys() == {("drum", 7), ("drum label", 7), ("wall", 0)}
    assert named["drum", 7]["scale"]["x"] == pytest.approx(0.6096)
    assert named["wall", 0]["type"] == STRIP
    assert named["wall", 0]["points"] == [{"x": 0.0, "y": 1.0}, {"x": 2.0, "y": 1.0}]
    (pose,) = of(outputs, "object_poses")
    assert pose["pose"]["covariance"][0] == 4e-4
    assert not of(made.take(state(10.05), 100.05, 100.05)[1], "objects"), "five times a second is enough"
    (markers,) = of(made.take(state(10.2, objects=[WALL]), 100.2, 100.2)[1], "objects")
    assert {(m["ns"], m["id"]) for m in markers["markers"] if m["action"] == DELETE} == {
        ("drum", 7), ("drum label", 7)
    }  # fmt: skip


def test_polylines_are_lines_thinner_than_walls() -> None:
    made, bend = topics(), {"number": 3, "points": [[1.0, 0.0], [2.0, 0.0], [2.0, 1.0]], "probability": 0.9}
    (markers,) = of(made.take(state(objects=[WALL]), 100.0, 100.0, [bend])[1], "objects")
    wall, drawn = markers["markers"]
    assert (drawn["ns"], drawn["id"], drawn["type"]) == ("polyline", 3, STRIP)
    assert drawn["points"] == [{"x": 1.0, "y": 0.0}, {"x": 2.0, "y": 0.0}, {"x": 2.0, "y": 1.0}]
    assert drawn["scale"]["x"] < wall["scale"]["x"]
    (markers,) = of(made.take(state(10.2), 100.2, 100.2)[1], "objects")
    assert ("polyline", 3) in {(m["ns"], m["id"]) for m in markers["markers"] if m["action"] == DELETE}


def test_a_model_with_corners_is_its_outline() -> None:
    made = Topics(Frames())
    made.begin(session_info(load_settings("hallway", ["models=box"]), name=None, emulated=True, units="m"))
    name = next(m["name"] for m in made._session["models"] if m["arc_radius_m"] is None)
    _, outputs = made.take(state(objects=[{**DRUM, "model": name, "theta": 0.5 * math.pi}]), 100.0, 100.0)
    (markers,) = of(outputs, "objects")
    (vx, vy), *_ = next(m["vertices"] for m in made._session["models"] if m["name"] == name)
    first = markers["markers"][0]["points"][0]
    assert (first["x"], first["y"]) == pytest.approx((2.0 - vy, 1.0 + vx))


def test_the_mode_is_sent_when_it_changes_and_diagnostics_every_second() -> None:
    made = topics()
    runs = [made.take(state(10.0 + 0.05 * k), 100.0 + 0.05 * k, 100.0 + 0.05 * k)[1] for k in range(41)]
    assert [k for k, outputs in enumerate(runs) if of(outputs, "mode")] == [0]
    assert [k for k, outputs in enumerate(runs) if of(outputs, "/diagnostics")] == [0, 20, 40]
    _, outputs = made.take(
        state(12.1, mode="SAFE_STOP", reason="halted", sensors=[[3, "deaf", "hears nothing"]]), 103.0, 103.0
    )
    assert of(outputs, "mode") == [{"data": "SAFE_STOP"}]
    (array,) = of(outputs, "/diagnostics")
    mode, ring, line = array["status"]
    assert (mode["level"], mode["message"], mode["hardware_id"]) == (b"\x01", "SAFE_STOP: halted", "denning")
    assert (ring["level"], ring["message"]) == (b"\x01", "sensor 3: deaf, hears nothing")
    assert {"key": "frames", "value": "9"} in line["values"]


def test_the_grid_is_a_map_where_it_is_kept() -> None:
    made = topics()
    assert made.grid({"on": False, "columns": 0, "rows": 0, "cells": ""}, 5) == []
    cells = base64.b64encode(bytes([0, 100, 255, 50, 7, 255])).decode()
    message = {"on": True, "x": -1.0, "y": 2.0, "cell": 0.05, "columns": 3, "rows": 2, "cells": cells}
    ((topic, kind, fields),) = made.grid(message, 5)
    assert (topic, kind, fields["header"]["frame_id"]) == ("grid", "nav_msgs/OccupancyGrid", "odom")
    assert fields["data"].tolist() == [0, 100, -1, 50, 7, -1]
    info = fields["info"]
    assert (info["resolution"], info["width"], info["height"]) == (0.05, 3, 2)
    assert (info["origin"]["position"]["x"], info["origin"]["position"]["y"]) == (-1.0, 2.0)


def test_a_clock_that_jumped_is_a_note_and_readings_go_on() -> None:
    made, first = topics(), state()
    first["ranges"][0], first["age"][0] = 1.0, 0.0
    made.take(first, 100.0, 100.0)
    first_note, again = made.note, state(0.1, ranges=first["ranges"], age=first["age"])
    _, outputs = made.take(again, 100.05, 100.05)
    assert (first_note, made.note is None) == (None, False)
    assert of(outputs, "sonar/s00")


def test_the_map_has_no_frame_while_the_place_in_it_is_not_known() -> None:
    made = topics()
    statuses = [None, "localizing", "tracking", "lost", "tracking"]
    for k, status in enumerate(statuses):
        localized = None if status is None else {**LOCALIZED, "status": status}
        now_s = 100.0 + 0.1 * k
        frames, outputs = made.take(state(10.0 + 0.1 * k, localized=localized), now_s, now_s)
        assert [f.parent for f in frames].count("map") == (status == "tracking"), status
        assert len(of(outputs, "pose")) == (status == "tracking"), "the pose agrees with the frames"
        assert made.place == status


def test_each_sample_of_the_odometry_is_published_once() -> None:
    made = topics()
    counts = []
    for k in range(40):  # the odometry is half as frequent as states
        frames, outputs = made.take(state(10.0 + 0.1 * (k // 2)), 100.0 + 0.05 * k, 100.0 + 0.05 * k)
        counts.append((len(of(outputs, "odom")), len(frames)))
    assert counts == [(1, 2), (0, 0)] * 20


def test_what_comes_late_after_a_stall_keeps_its_time() -> None:
    """States of 0.7 s queue up while a process stalls; then they come at once."""
    made, stamps = topics(), []
    for k in range(60):
        arrives_s = 100.0 + 0.05 * k
        if 30 <= k < 44:
            arrives_s = 100.0 + 0.05 * 44
        _, outputs = made.take(state(10.0 + 0.05 * k), arrives_s, arrives_s)
        assert made.note is None, k
        (odometry,) = of(outputs, "odom")
        stamp = odometry["header"]["stamp"]
        stamps.append(stamp["sec"] + 1e-9 * stamp["nanosec"])
    assert stamps == pytest.approx([100.0 + 0.05 * k for k in range(60)], abs=0.005)


def test_a_run_that_is_over_leaves_no_mode_behind() -> None:
    outputs = disconnected(5_000_000_000)
    assert of(outputs, "mode") == [{"data": "DISCONNECTED"}]
    ((status,),) = [array["status"] for array in of(outputs, "/diagnostics")]
    assert status["level"] == b"\x02"


def test_silence_can_be_the_greatest_range() -> None:
    made = Topics(Frames(), max_range_for_silence=True)
    made.begin(session_info(load_settings("hallway"), name="denning", emulated=True, units="m"))
    first = state()
    first["ranges"][4], first["age"][4] = -1.0, 0.0
    ((far,),) = [of(made.take(first, 100.0, 100.0)[1], "sonar/s04")]
    assert far["range"] == far["max_range"] == 7.7724


def test_nothing_is_published_before_the_session_nor_of_a_recording() -> None:
    assert Topics(Frames()).take(state(), 1.0, 1.0) == ([], [])
    assert topics().take(state(playback={"s": 1.0}), 1.0, 1.0) == ([], [])
