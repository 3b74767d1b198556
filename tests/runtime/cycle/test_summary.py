"""Tests of the summaries: public keys, numbers that survive JSON, and errors that name the path."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import cast, get_type_hints

import numpy as np
import pytest

from config.errors import FAILED, UserError
from drivers.messages import Pose
from perception.detected_object import DetectedObject
from perception.localization.localized_pose import LocalizedPose
from perception.percept import Canyon
from perception.pipeline import Perception
from perception.polyline import Polyline
from runtime.cycle.summary import (
    LinkRow,
    ObjectRow,
    RunSummary,
    StartSummary,
    failed_start,
    object_row,
    perceived_rows,
    pose_row,
    write_json,
)
from runtime.recording.replay_summary import ReplaySummary
from runtime.simulation.evaluation import DrumRow, Outcome
from tests.polylines import BEND

SEEN = DetectedObject("semicircle", 1.0, -2.0, 0.1 + 0.2, 1e-17, 39, 2.0 / 3.0)


def test_the_summaries_have_the_fields_of_the_public_surface() -> None:
    assert list(get_type_hints(ObjectRow))[:7] == ["model", "x", "y", "theta", "sigma", "support", "score"]
    assert {"objects", "cycles", "cycle_us", "late", "link", "mode", "stop_reasons", "timing"} <= set(
        get_type_hints(RunSummary)
    )
    assert set(failed_start("no answer")) == set(get_type_hints(StartSummary)) < set(get_type_hints(RunSummary))
    assert set(get_type_hints(LinkRow)) == {"frames", "bad", "lost"}
    assert {"objects", "segments", "clusters", "cycles", "cycle_us"} <= set(get_type_hints(ReplaySummary))
    assert {"drums", "false", "mean_error", "max_error", "times_real_time"} <= set(get_type_hints(Outcome))
    assert set(get_type_hints(DrumRow)) == {"truth", "estimate", "error"}


def test_an_object_survives_json_to_the_bit(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    write_json(str(path), {"objects": [object_row(SEEN)], "estimate": None, "nan": math.nan})
    text = path.read_text("utf-8")
    assert text.endswith("}\n")
    read = json.loads(text)
    assert read["objects"] == [
        {"model": "semicircle", "x": 1.0, "y": -2.0, "theta": 0.1 + 0.2, "sigma": 1e-17, "support": 39,
         "score": 2.0 / 3.0}
    ]  # fmt: skip
    assert read["estimate"] is None
    assert read["nan"] is None, "JSON has no NaN"


class Perceived:
    """Perception with a drum, a wall, corners, a post, and an edge that the robot has left behind."""

    def objects(self) -> tuple[DetectedObject, ...]:
        return (SEEN,)

    def labelled_objects(self) -> tuple[DetectedObject, ...]:
        along, across = 2.0**2 / 12.0, 0.01**2
        wall = DetectedObject(
            "wall", 1.0, 3.0, math.pi / 2, 0.6, 40, 0.99, 0.99, (across, 0.0, along), sigma_theta=0.002
        )
        corner = DetectedObject("inside corner", 1.0, 4.0, 0.0, 0.02, 12, 0.97)
        return SEEN, wall, corner, DetectedObject("post", 0.0, 0.0, 0.0, 0.1, 9, 0.9)

    def archived_objects(self) -> tuple[DetectedObject, ...]:
        return (DetectedObject("edge", -5.0, 0.0, 0.0, 0.03, 9, 0.9),)

    def polylines(self) -> tuple[Polyline, ...]:
        return (BEND,)

    def canyons(self) -> tuple[Canyon, ...]:
        return (Canyon(3, (1.0, -1.0, 1.0, 1.0), 0.0, 2.5, 0.97),)


def test_walls_and_corners_have_rows_of_their_own_in_the_frame_of_the_result() -> None:
    rows = perceived_rows(cast("Perception", Perceived()), Pose(10.0, 0.0, math.pi / 2))
    (seen,) = rows["objects"]
    assert seen["model"] == "semicircle"
    assert seen["x"] == pytest.approx(12.0)
    (canyon,) = rows["canyons"]
    assert (canyon["x1"], canyon["y1"], canyon["x2"], canyon["y2"]) == pytest.approx((11.0, 1.0, 9.0, 1.0))
    assert (canyon["number"], canyon["depth"], canyon["probability"]) == (3, 2.5, 0.97)
    assert canyon["axis"] == pytest.approx(math.pi / 2)
    (wall,) = rows["walls"]
    assert (wall["x1"], wall["y1"], wall["x2"], wall["y2"]) == pytest.approx((8.0, 1.0, 6.0, 1.0))
    assert (wall["sigma_offset"], wall["sigma_angle"], wall["probability"]) == pytest.approx((0.01, 0.002, 0.99))
    inside, edge = rows["corners"]
    assert (inside["kind"], edge["kind"]) == ("inside", "edge")
    assert (inside["x"], inside["y"], inside["sigma"]) == pytest.approx((6.0, 1.0, 0.02))
    assert (edge["x"], edge["y"], edge["sigma"]) == pytest.approx((10.0, -5.0, 0.03))
    (polyline,) = rows["polylines"]
    assert (polyline["number"], polyline["probability"]) == (BEND.number, BEND.probability)
    assert np.array(polyline["points"]) == pytest.approx(np.array([(10.0, 1.0), (10.0, 2.0), (9.0, 2.0)]))
    assert json.loads(json.dumps(rows["polylines"])) == rows["polylines"]


def test_objects_given_in_the_frame_of_the_result_are_not_turned() -> None:
    rows = perceived_rows(cast("Perception", Perceived()), Pose(10.0, 0.0, 0.0), (SEEN,))
    assert rows["objects"] == [object_row(SEEN)]
    assert perceived_rows(cast("Perception", Perceived()))["corners"][0]["x"] == 1.0


def test_a_pose_has_what_the_public_surface_names() -> None:
    here = LocalizedPose(Pose(1.0, 2.0, 0.5), 3.0, np.diag([0.1, 0.2, 0.3]), "tracking", 0.98)
    row = pose_row(here)
    assert json.loads(json.dumps(row)) == row
    assert (row["x"], row["theta"], row["covariance"][1], row["status"], row["probability"]) == (
        1.0, 0.5, [0.0, 0.2, 0.0], "tracking", 0.98,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["", "file/summary.json", "nowhere/summary.json"])
def test_a_file_that_cannot_be_written(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").touch()
    path = str(tmp_path / name)
    with pytest.raises(UserError, match=r"^--json .* cannot be written: .*; choose another file$") as caught:
        write_json(path, {})
    assert caught.value.exit_code == FAILED
    assert path in str(caught.value)
