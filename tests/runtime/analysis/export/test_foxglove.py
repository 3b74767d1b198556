"""Tests of the export for Foxglove, read back by the stock MCAP reader with protobuf."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from config.load import load_settings
from drivers.messages import Firing, Pose
from runtime.analysis.export.foxglove import write_foxglove
from runtime.analysis.timeline import MapPlace, Timeline
from runtime.analysis.timeline_builder import TimelineBuilder
from tests.runtime.analysis.synthetic_timeline import (
    synthetic_timeline,
    with_cross_paths,
    with_grid,
    with_polyline,
)

UNEVEN = """
[ring]
sensors = [{x_m = 0.1, y_m = 0.0, angle_deg = 0.0}, {x_m = 0.0, y_m = 0.1, angle_deg = 80.0}]
beam_half_angle_deg = 10.0
resolution_m = 0.01
range_min_m = 0.1
range_max_m = 5.0
[ring.firing]
sets = [[0, 1]]
step_period_s = 0.1
[body]
radius_m = 0.2
speed_max_m_s = 1.0
turn_max_rad_s = 2.0
"""


def messages(path: Path) -> Iterator[tuple[str, str, int, Any]]:
    """Yield topic, schema, log time and content of each message."""
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, message, proto in reader.iter_decoded_messages():
            assert schema is not None
            yield channel.topic, schema.name, message.log_time, proto


def test_a_run_for_foxglove(tmp_path: Path) -> None:
    run = with_polyline(synthetic_timeline())
    (path,) = write_foxglove(run, tmp_path / "fox.mcap")
    seen: Counter[tuple[str, str]] = Counter()
    newest: dict[str, Any] = {}
    first: dict[str, Any] = {}
    times: list[int] = []
    for topic, schema, log_ns, proto in messages(path):
        seen[topic, schema] += 1
        newest[topic] = proto
        first.setdefault(topic, proto)
        times.append(log_ns)
    assert seen == {
        ("/tf", "foxglove.FrameTransforms"): 4,
        ("/pose", "foxglove.PoseInFrame"): 4,
        ("/ring", "foxglove.LaserScan"): 12,
        ("/segments", "foxglove.SceneUpdate"): 4,
        ("/clusters", "foxglove.SceneUpdate"): 4,
        ("/models", "foxglove.SceneUpdate"): 4,
        ("/truth", "foxglove.SceneUpdate"): 1,
        ("/log", "foxglove.Log"): 1,
    }
    assert times == sorted(times)
    assert (times[0], times[-1]) == (run.start_unix_ns, run.unix_ns(run.seconds))
    assert len(newest["/truth"].entities[0].lines) == 6
    assert [len(line.points) for line in newest["/models"].entities[0].lines[3:]] == [2, 3], "a wall, a polyline"
    assert len(newest["/segments"].entities[0].lines[0].points) == 2 * 3
    assert len(newest["/clusters"].entities[0].lines) == 3 * 3
    base = first["/tf"].transforms[0]
    assert (base.parent_frame_id, base.child_frame_id) == ("odom", "base")
    assert newest["/truth"].entities[0].frame_id == "odom"
    assert run.world is not None
    xs = [line.points[0].x for line in newest["/truth"].entities[0].lines]
    assert min(xs) == pytest.approx(min(d.x_m for d in run.world.drum) + 0.3048 + 1.8288, abs=0.01)
    scan = newest["/ring"]
    assert [i for i, r in enumerate(scan.ranges) if not math.isnan(r)] == [6]
    assert math.isinf(scan.ranges[6])
    assert newest["/log"].message == "sensor 7 never answers"


def test_the_map_has_a_frame_while_the_place_in_it_is_known(tmp_path: Path) -> None:
    run = synthetic_timeline()
    run.snapshots[1] = replace(run.snapshots[1], place=MapPlace(Pose(1.0, 0.0, 0.0), np.eye(3), Pose(0.5, 0.0, 0.0)))
    (path,) = write_foxglove(run, tmp_path / "fox.mcap")
    frames = [proto.transforms[0] for topic, _, _, proto in messages(path) if topic == "/tf"]
    ((child, x),) = [(f.child_frame_id, f.translation.x) for f in frames if f.parent_frame_id == "map"]
    assert (child, x) == ("odom", -0.5)


def test_cross_paths_are_arcs(tmp_path: Path) -> None:
    (path,) = write_foxglove(with_cross_paths(synthetic_timeline()), tmp_path / "fox.mcap")
    scenes = [proto.entities[0] for topic, _, _, proto in messages(path) if topic == "/cross_paths"]
    assert [len(scene.lines) for scene in scenes] == [0, 0, 0, 2], "those of the last second that were heard"
    assert len(scenes[-1].lines[0].points) == 9


def test_the_evidence_grid_lies_where_it_is(tmp_path: Path) -> None:
    (path,) = write_foxglove(with_grid(synthetic_timeline()), tmp_path / "fox.mcap")
    (grid,) = (proto for topic, _, _, proto in messages(path) if topic == "/grid")
    cells = np.frombuffer(grid.data, np.int8).reshape(-1, grid.column_count)
    assert cells.tolist() == [[-1, 10, 90], [50, -1, 100]]
    assert (grid.frame_id, grid.pose.position.x, grid.pose.position.y) == ("odom", 1.0, -0.5)
    assert (grid.cell_size.x, grid.row_stride, grid.fields[0].name) == (0.1, 3, "occupied")


def test_an_uneven_ring_is_an_arc_for_each_sensor(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(UNEVEN, "utf-8")
    settings = load_settings(None, robot=str(tmp_path / "robot.toml"))
    run = Timeline(tmp_path / "x", settings, None)
    builder = TimelineBuilder(run)
    for k, ranges in enumerate(((1.0, 2.0), (0.9, math.inf), (0.8, math.nan))):
        builder.add_firing(0.1 * k, Firing(0.1 * k, Pose(0.1 * k, 0.0, 0.0), 0.0, np.array(ranges)))
    builder.finish(None)
    (path,) = write_foxglove(run, tmp_path / "x.mcap")
    scans = [proto for topic, _, _, proto in messages(path) if topic == "/ring"]
    assert [scan.ranges[0] for scan in scans] == [1.0, 2.0, 0.9, math.inf, 0.8]
    assert scans[1].pose.position.y == pytest.approx(0.1)
    assert scans[0].end_angle == pytest.approx(math.radians(10.0))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_is_an_os_error(tmp_path: Path) -> None:
    """The SDK itself reports only that something went wrong."""
    path = tmp_path / "fox.mcap"
    path.symlink_to("/dev/full")
    with pytest.raises(OSError, match="No space left"):
        write_foxglove(synthetic_timeline(), path)
