"""What each kind of message says, written into a file by Foxglove's SDK and read back with its schemas."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import foxglove
import pytest

from drivers.messages import Pose
from runtime.analysis.export.foxglove_messages import ARC_POINTS, RunChannels, object_label
from tests.polylines import BEND
from tests.runtime.analysis.export.test_foxglove import messages

AT = 1_700_000_000_250_000_000


def test_what_is_written_is_on_its_topic(tmp_path: Path) -> None:
    context, path = foxglove.Context(), tmp_path / "a.mcap"
    with foxglove.open_mcap(path, context=context):
        run = RunChannels(context)
        run.write_frames([("map", "odom", Pose(1.0, 2.0, 0.0)), ("odom", "base", Pose(0.0, 0.0, math.pi))], AT)
        run.write_pose(Pose(3.0, 4.0, 0.0), AT)
        run.write_ring(Pose(0.0, 0.0, 0.0), [1.0, 2.0, math.nan, math.inf], AT)
        run.write_arc(Pose(0.0, 0.0, 0.0), 0.2, 1.5, AT)
        run.write_segments([(0.0, 0.0), (1.0, 1.0)], AT)
        run.write_segments([], AT)
        run.write_objects(
            [([(0.0, 0.0), (1.0, 0.0)], False)],
            [BEND.points.tolist()],
            [(5.0, 6.0, object_label(7, "drum", 0.5))],
            AT,
        )
        run.write_truth([[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]], [[(0.0, 0.0), (2.0, 0.0)]], AT)
        run.write_log("warning", "a line", AT)
    found: dict[str, list[Any]] = {}
    for topic, _, log_ns, proto in messages(path):
        assert log_ns == AT
        found.setdefault(topic, []).append(proto)
    (frames,) = found["/tf"]
    assert [(t.parent_frame_id, t.child_frame_id, t.translation.x) for t in frames.transforms] == [
        ("map", "odom", 1.0), ("odom", "base", 0.0),
    ]  # fmt: skip
    assert frames.transforms[1].rotation.z == pytest.approx(1.0)
    assert (found["/pose"][0].pose.position.x, found["/pose"][0].timestamp.nanos) == (3.0, 250_000_000)
    ring, arc = found["/ring"]
    assert (ring.start_angle, ring.end_angle, len(ring.ranges)) == (0.0, pytest.approx(1.5 * math.pi), 4)
    assert (arc.start_angle, arc.end_angle, list(arc.ranges)) == (-0.2, 0.2, [1.5] * ARC_POINTS)
    assert [len(scene.entities[0].lines) for scene in found["/segments"]] == [1, 0]
    outline, polyline = found["/models"][0].entities[0].lines
    assert [(p.x, p.y) for p in polyline.points] == [(1.0, 0.0), (2.0, 0.0), (2.0, 1.0)]
    assert polyline.thickness < outline.thickness
    (text,) = found["/models"][0].entities[0].texts
    assert (text.text, text.pose.position.y) == ("7 drum 0.50", 6.0)
    assert [line.type for line in found["/truth"][0].entities[0].lines] == [1, 0]
    assert found["/log"][0].level == 3
