"""The fields of a frame, and segments as changes or whole."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import orjson
import pytest

from behaviors.follow_valley import Valley
from behaviors.memory.goal_progress import Progress
from behaviors.valley.look_ahead import Search
from config.load import load_settings
from drivers.driver import LineState, Received
from drivers.messages import CrossPaths, Firing, Pose
from perception.detected_object import DetectedObject
from perception.edits import PlaceModel
from perception.localization.drift.drift_correction import SeenObject
from perception.localization.map_frame import MapFrame
from perception.percept import Canyon
from perception.pipeline import Perception
from runtime.console.frames.frame_encoder import TURNS, FrameContext, FrameEncoder, _canyon, _object
from runtime.cycle.goal_drive import GoalDrive
from runtime.cycle.step import Inputs, State
from tests.polylines import report_bend
from tests.runtime.console.console_case import ConsoleCase, open_console

Segments = dict[int, list[float]]


def apply(segments: Segments, changes: dict[str, Any]) -> None:
    """Apply the changes of a frame as the page does."""
    if changes["whole"]:
        segments.clear()
    for number in changes["removed"]:
        del segments[number]
    for number, *row in changes["added"]:
        assert number not in segments
        segments[number] = row


def assert_same_segments(segments: Segments, case: ConsoleCase) -> None:
    """Assert that the page has the segments of the map."""
    now = case.run.state.perception.segments()
    assert sorted(segments) == sorted(now.numbers.tolist())
    for number, geometry in zip(now.numbers.tolist(), now.geometry.tolist(), strict=True):
        assert segments[number][:5] == pytest.approx(geometry, abs=1e-4)


async def test_the_fields_of_a_frame() -> None:
    async with open_console() as case:
        page = await case.page()
        case.cycles(3)
        frame = await page.next("state")
        assert frame["cycle"] == 3
        assert frame["mode"] == "CONNECTING"
        assert frame["pose"] == [0.06, 0.0, 0.0]
        assert frame["twist"] == [0.3, 0.0]
        assert frame["firing"] == [1, 2, 3, 9, 10, 11, 17, 18, 19], "of all cycles since the last frame"
        assert (frame["ranges"][3], frame["ranges"][11], frame["ranges"][0]) == (1.5, -1.0, None)
        assert (frame["age"][3], frame["age"][1], frame["age"][0]) == (0.0, 0.1, None)
        assert frame["link"] == {"frames": 7, "bad": 1, "lost": 2}
        assert frame["quanta"] == 2
        assert frame["refinement"] == "quota"
        assert frame["drive_request"]["kind"] == "legs"
        assert frame["controller"] is True
        assert frame["clients"] == 1
        assert frame["recording"] is None
        assert frame["paused"] is False
        assert frame["cross_paths"] == [], "no sensor of this ring listens"


async def test_the_place_in_the_map_and_its_frame_are_shown_where_drift_is_corrected() -> None:
    async with open_console() as case:
        page = await case.page()
        case.cycles()
        assert (await page.next("state"))["localized"] is None
    async with open_console("perception.method=bayes", "perception.localization.correct_drift=true") as case:
        page = await case.page()
        case.cycles()
        first = (await page.next("state"))["localized"]
        assert (first["status"], first["pose"], first["frame"]) == ("localizing", [0.02, 0.0, 0.0], [0.0, 0.0, 0.0])

        frame = case.run.state.perception.map_frame
        assert isinstance(frame, MapFrame)
        frame.drift._evidence.is_refuted = True
        frame.drift.learn(SeenObject(k, 3.0 * math.cos(k), 3.0 * math.sin(k), 0.3) for k in (1, 2, 3))
        frame.drift.e[0].x += 0.5
        case.cycles()
        then = (await page.next("state"))["localized"]
        assert then["pose"][0] == pytest.approx(0.54, abs=0.1)
        assert len(then["covariance"]) == 4
        in_odometry = Pose(*then["frame"]).compose(Pose(*then["pose"]))
        assert (in_odometry.x, in_odometry.y, in_odometry.theta) == pytest.approx((0.04, 0.0, 0.0), abs=1e-3)


async def test_in_a_known_room_the_place_is_unknown_at_first() -> None:
    async with open_console(
        "perception.localization.known_room.drum=[{x_m = 3.0, y_m = 1.0, radius_m = 0.3}]"
    ) as case:
        page = await case.page()
        case.cycles()
        here = (await page.next("state"))["localized"]
        assert (here["status"], here["covariance"], here["probability"]) == ("localizing", None, 0.0)
        assert here["frame"] == [0.0, 0.0, 0.0]


async def test_changes_add_up_to_all_segments() -> None:
    async with open_console() as case:
        page, segments = await case.page(), Segments()
        for k in range(60):
            case.cycles()
            frame = await page.next("state")
            apply(segments, frame["segments"])
            assert frame["segments"]["whole"] == (k == 0)
            assert frame["dropped"] == 0
            assert_same_segments(segments, case)
        assert segments, "the map is empty, so nothing was tested"


async def test_a_later_client_gets_all_segments() -> None:
    async with open_console() as case:
        first = await case.page()
        case.cycles(40)
        await first.next("state")
        page, segments = await case.page(), Segments()
        case.cycles()
        frame = await page.next("state")
        assert frame["segments"]["whole"]
        apply(segments, frame["segments"])
        assert_same_segments(segments, case)


async def test_polylines_come_when_they_change_and_whole_to_a_later_client(monkeypatch: pytest.MonkeyPatch) -> None:
    async with open_console() as case:
        page = await case.page()
        case.cycles()
        assert (await page.next("state"))["polylines"] == []
        report_bend(monkeypatch)
        bend = {"number": 3, "points": [[1.0, 0.0], [2.0, 0.0], [2.0, 1.0]], "probability": 0.9}
        case.cycles()
        assert (await page.next("state"))["polylines"] == [bend]
        case.cycles()
        assert "polylines" not in await page.next("state")
        later = await case.page()
        case.cycles()
        assert (await later.next("state"))["polylines"] == [bend]


async def test_new_segments_come_with_every_second_frame() -> None:
    async with open_console() as case:
        page, with_segments = await case.page(), set[int]()
        for k in range(60):
            case.cycles()
            frame = await page.next("state")
            if frame["segments"]["added"]:
                with_segments.add(k % TURNS)
        assert with_segments == {TURNS - 1}


def test_objects_are_listed_in_turns_with_segments_and_at_once_when_edited_or_paused() -> None:
    settings = load_settings("hallway", ["perception.method=paper"])
    state = State(Perception(settings.ring, settings.models, settings.perception))
    encoder = FrameEncoder(settings)

    def shown_after_one_more(*, is_edit: bool = False, is_paused: bool = False) -> int:
        edit = PlaceModel(settings.models[0].name, float(len(state.perception.labelled_objects())), 0.0, 0.0)
        state.perception.edit(edit)
        inputs = Inputs(0.05, LineState.READY, None, Received((), None, rebooted=False), edits=(edit,) * is_edit)
        encoder.take(SimpleNamespace(inputs=inputs))  # type: ignore[arg-type]
        head = encoder.frame(state, None, FrameContext(0.0, is_paused=is_paused)).head
        return len(orjson.loads(head + b"}")["objects"])

    assert [shown_after_one_more() for _ in range(5)] == [1, 1, 3, 3, 5]
    assert shown_after_one_more(is_edit=True) == 6
    assert [shown_after_one_more(), shown_after_one_more(is_paused=True)] == [7, 8]


async def test_the_way_to_a_goal_and_the_blocked_directions_are_shown() -> None:
    async with open_console() as case:
        page = await case.page()
        case.cycles()
        assert (await page.next("state"))["valley"] is None
        blocked = "1" * 3 + "0" * 69
        case.run.state.goal_drive = GoalDrive(
            Progress.starting_at(Pose(0.0, 0.0, 0.0), 3.0, 0.0),
            Valley(blocked, 1.23456),
            Search(way=((0.0, 0.0), (0.5, 0.123456))),
        )
        case.cycles()
        shown = (await page.next("state"))["valley"]
        assert shown == {"blocked": blocked, "direction": 1.235, "way": [[0.0, 0.0], [0.5, 0.12]]}


def test_cross_paths_are_shown_once_and_not_after_a_restart() -> None:
    settings = load_settings("hallway", ["perception.method=paper"], robot="ears")
    state = State(Perception(settings.ring, settings.models, settings.perception))
    encoder, context = FrameEncoder(settings), FrameContext(0.0)
    crosses = CrossPaths(np.array([0, 0]), np.array([1, 2]), np.array([1.5, math.inf]))
    firing = Firing(0.05, Pose(0.0, 0.0, 0.0), 0.0, np.full(24, np.nan), crosses)

    def shown(*heard: Received) -> list[dict[str, Any]]:
        for received in heard:
            encoder.take(SimpleNamespace(inputs=Inputs(0.05, LineState.READY, None, received)))  # type: ignore[arg-type]
        head = encoder.frame(state, None, context).head
        return list(orjson.loads(head + b"}")["cross_paths"])

    before = Received((firing,), None, rebooted=False)
    assert shown(before) == [{"robot_s": 0.05, "pose": [0.0, 0.0, 0.0, 0.0], "paths": [[0, 1, 1.5]]}]
    assert shown() == []
    assert shown(before, Received((), None, rebooted=True)) == []


def test_a_canyon_is_sent_with_its_mouth_axis_depth_and_probability() -> None:
    canyon = Canyon(3, (0.0, 1.0, 0.12346, -1.0), 0.123456, 2.98765, 0.98765)
    assert _canyon(canyon) == {
        "number": 3, "mouth": (0.0, 1.0, 0.123, -1.0), "axis": 0.1235, "depth": 2.988, "probability": 0.988,
    }  # fmt: skip


def test_a_wall_is_sent_with_its_ends_and_other_objects_without() -> None:
    """The page draws a wall as a line: an ellipse of its length looks like another wall."""
    wall = DetectedObject("wall", 2.0, 1.0, 0.0, 0.01, 40, 0.99, covariance=(4.0**2 / 12.0, 0.0, 1e-4))
    assert _object(wall)["ends"] == pytest.approx([0.0, 1.0, 4.0, 1.0], abs=2e-3)
    assert (
        _object(DetectedObject("drum", 2.0, 1.0, 0.0, 0.01, 40, 0.99, covariance=(1e-4, 0.0, 1e-4)))["ends"] is None
    )
