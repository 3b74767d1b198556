"""Exports, read back by whom they are for: csv, pyarrow, the stock MCAP reader with protobuf, rosbags, ourselves."""

from __future__ import annotations

import csv
import json
import math
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from drivers.messages import Firing
from runtime.analysis.timeline import Timeline
from runtime.analysis.timeline_sources import TimelineSource, load_timeline
from runtime.cli.app import run_command
from runtime.cli.commands import export
from runtime.recording.channels import CYCLE, decode
from runtime.recording.ring_log import read_ring_log
from runtime.recording.schema import Cycle
from tests.recorded import entries_of

TABLES = {"echoes", "segments", "objects", "odometry"}


@pytest.fixture(scope="module")
def timeline(hall_run: Path) -> Timeline:
    return load_timeline(TimelineSource(str(hall_run)), lambda _settings: None)


def exported(run: Path, form: str, out: Path, *more: str) -> Path:
    assert run_command(["export", str(run), "--to", form, "--out", str(out), *more]) == DONE
    return out


def test_csv(hall_run: Path, timeline: Timeline, tmp_path: Path) -> None:
    folder = exported(hall_run, "csv", tmp_path / "new")
    read = {}
    for path in folder.iterdir():
        with path.open(encoding="utf-8", newline="") as file:
            read[path.stem] = list(csv.DictReader(file))
    assert set(read) == TABLES
    assert len(read["echoes"]) == len(timeline.echoes)
    for row, kept in zip(read["echoes"], timeline.echoes, strict=True):
        assert float(row["bearing_rad"]) == kept["bearing"], "every digit"
        assert row["heard"] == str(math.isfinite(kept["range_m"]))
        assert row["range_m"] == (str(float(kept["range_m"])) if math.isfinite(kept["range_m"]) else "")
    last = [row for row in read["objects"] if float(row["t_s"]) == timeline.seconds]
    assert [(r["model"], float(r["x_m"]), float(r["y_m"])) for r in last] == [
        (o.model, o.x, o.y) for o in timeline.objects
    ]
    assert all(float(r["first_seen_s"]) <= float(r["last_seen_s"]) for r in read["segments"])
    assert len(read["odometry"]) > 100


def test_foxglove(hall_run: Path, timeline: Timeline, tmp_path: Path) -> None:
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    path = exported(hall_run, "foxglove", tmp_path / "fox.mcap")
    seen: Counter[tuple[str, str]] = Counter()
    newest: dict[str, Any] = {}
    first: dict[str, Any] = {}
    times: list[int] = []
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, message, proto in reader.iter_decoded_messages():
            assert schema is not None
            seen[channel.topic, schema.name] += 1
            newest[channel.topic] = proto
            first.setdefault(channel.topic, proto)
            times.append(message.log_time)
    assert set(seen) == {
        ("/tf", "foxglove.FrameTransforms"),
        ("/pose", "foxglove.PoseInFrame"),
        ("/ring", "foxglove.LaserScan"),
        ("/segments", "foxglove.SceneUpdate"),
        ("/clusters", "foxglove.SceneUpdate"),
        ("/models", "foxglove.SceneUpdate"),
        ("/truth", "foxglove.SceneUpdate"),
        ("/log", "foxglove.Log"),
    }
    assert times[0] == timeline.start_unix_ns
    assert times[-1] <= timeline.unix_ns(timeline.seconds)
    assert len(newest["/truth"].entities[0].lines) == 6
    assert len(newest["/models"].entities[0].lines) == len(timeline.objects)
    assert timeline.last is not None
    assert len(newest["/segments"].entities[0].lines[0].points) == 2 * len(timeline.last.segments)
    assert len(newest["/clusters"].entities[0].lines) == 3 * len(timeline.last.clusters)
    start = first["/tf"].transforms[0]
    assert (start.parent_frame_id, start.child_frame_id) == ("world", "odom")
    assert start.translation.x == pytest.approx(-1.8288)
    scan = newest["/ring"]
    assert len(scan.ranges) == 24
    fired = [i for i, r in enumerate(scan.ranges) if not math.isnan(r)]
    assert fired == sorted(
        int(row["sensor"]) for row in timeline.echoes if row["robot_s"] == timeline.echoes["robot_s"][-1]
    )


def test_rosbag2(hall_run: Path, timeline: Timeline, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    bag = exported(hall_run, "rosbag2", tmp_path / "bag")
    kinds: dict[str, str] = {}
    counts: Counter[str] = Counter()
    newest: dict[str, Any] = {}
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, at, data in reader.messages():
            kinds[connection.topic] = connection.msgtype
            counts[connection.topic] += 1
            newest[connection.topic] = reader.deserialize(data, connection.msgtype)
            assert timeline.start_unix_ns <= at <= timeline.unix_ns(timeline.seconds)
    sonars = {topic for topic in kinds if topic.startswith("/sonar/")}
    assert len(sonars) == 24
    assert {kinds[topic] for topic in sonars} == {"sensor_msgs/msg/Range"}
    assert sum(counts[topic] for topic in sonars) == len(timeline.echoes)
    assert kinds["/odom"] == "nav_msgs/msg/Odometry"
    assert kinds["/markers"] == "visualization_msgs/msg/MarkerArray"
    sensor = int(timeline.echoes["sensor"][-1])
    published = newest[f"/sonar/s{sensor:02d}"]
    assert published.range == pytest.approx(timeline.echoes["range_m"][-1])
    assert published.header.frame_id == f"sonar_{sensor:02d}"
    assert published.field_of_view == pytest.approx(math.radians(24.0))
    odometry = timeline.odometry[-1][1]
    assert newest["/odom"].pose.pose.position.x == odometry.pose.x
    assert newest["/odom"].twist.twist.linear.x == odometry.twist.v
    models = [m for m in newest["/markers"].markers if m.ns.startswith("models/")]
    assert len(models) == len(timeline.objects)
    places = np.array([[(p.x, p.y) for p in m.points[:-1]] for m in models]).mean(axis=1)
    assert np.allclose(places, [(o.x, o.y) for o in timeline.objects])
    assert len(newest["/tf_static"].transforms) == 25
    capsys.readouterr()
    assert run_command(["export", str(hall_run), "--to", "rosbag2", "--out", str(bag)]) == FAILED
    assert "exists; a bag needs a new folder" in capsys.readouterr().err


def test_a_ring_log_out_and_in(hall_run: Path, hall_log: Path, timeline: Timeline, tmp_path: Path) -> None:
    heard: list[Firing] = []
    for entry in entries_of(hall_run):
        if entry.topic == CYCLE:
            heard += decode(Cycle, entry.data).record.inputs.received.firings
    back = list(read_ring_log(hall_log))
    assert len(back) == len(heard) > 100
    for one, other in zip(heard, back, strict=True):
        assert (one.robot_s, one.pose, one.ring_yaw) == (other.robot_s, other.pose, other.ring_yaw)
        assert one.ranges_m.tobytes() == other.ranges_m.tobytes()
    summary = tmp_path / "summary.json"
    assert run_command(["replay", str(hall_log), "--json", str(summary)]) == DONE
    seen = json.loads(summary.read_bytes())["objects"]
    assert len(seen) >= 3
    for one in seen:
        assert min(math.hypot(one["x"] - o.x, one["y"] - o.y) for o in timeline.objects) < 0.02


@pytest.mark.compiled
def test_a_ring_log_into_the_others(hall_log: Path, tmp_path: Path) -> None:
    for form in ("csv", "foxglove", "rosbag2"):
        exported(hall_log, form, tmp_path / form, "--world", "hallway")


@pytest.mark.parametrize("form", sorted(export.OPTIONAL_PACKAGES))
def test_a_missing_extra_is_one_line(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import importlib.util

    module, package = export.OPTIONAL_PACKAGES[form]
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *a: None if name == module else find(name, *a))
    assert run_command(["export", str(tmp_path / "any.mcap"), "--to", form, "--out", str(tmp_path / "out")]) == FAILED
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "pip install 'echolocate[export]'" in err
    assert package in err


def test_a_ring_log_needs_no_conversion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,x,y,theta,r00\n0,0,0,0,1\n", encoding="utf-8")
    assert run_command(["export", str(log), "--to", "ringlog", "--out", str(tmp_path / "x.csv")]) == WRONG_CALL
    assert "a ring log needs no conversion" in capsys.readouterr().err
    assert run_command(["export", str(log), "--to", "csv", "--out", str(log)]) == WRONG_CALL
