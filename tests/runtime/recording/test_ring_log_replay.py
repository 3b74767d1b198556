"""A ring log replayed: perception sees every firing in order and finds what it found in the run."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bench.trials.furnished_rooms import furnished_room
from bench.trials.known_room_trials import furnished_drive
from config.load import load_settings
from config.units import FOOT_M
from perception.localization.localized_pose import LocalizedPose
from runtime.recording.replay_summary import ReplaySummary
from runtime.recording.ring_log import read_ring_log
from runtime.recording.ring_log_replay import (
    FiringReplayer,
    replay_firings,
    replay_in_known_room,
    replay_localized,
)
from tests.perception.localization.rooms import RING
from tests.perception.localization.submaps.test_submap_graph import ROOM, driven

PAPER = load_settings("hallway", ["perception.method=paper"])
START_FT = -6.0
"""Where the robot starts in the hallway; its odometry counts from there."""


def test_perception_has_seen_each_firing_when_it_is_yielded(hall_log: Path) -> None:
    firings = list(read_ring_log(hall_log))
    replayer, segments = FiringReplayer(PAPER, firings), []
    for k, firing in enumerate(replayer):
        assert firing is firings[k]
        assert replayer.summary()["cycles"] == k + 1
        segments.append(replayer.perception.counts.segments_total)
    assert len(segments) == len(firings) > 200
    assert segments[0] == 0 < segments[-1]
    assert (np.diff(segments) >= 0).all()


@pytest.mark.compiled
def test_the_summary_names_the_drums(hall_log: Path) -> None:
    summary = replay_firings(load_settings("hallway"), read_ring_log(hall_log))
    assert summary["segments"] > 0
    assert summary["clusters"] > 0
    found = [(seen["x"], abs(seen["y"])) for seen in summary["objects"]]
    assert len(found) >= 3
    for x, y in found:
        assert y == pytest.approx(4.0 * FOOT_M, abs=0.1)
        assert min(abs(x - FOOT_M * (drum - START_FT)) for drum in (1.0, 4.0, 7.0)) < 0.1


def test_no_firing_gives_an_empty_summary() -> None:
    summary = replay_firings(PAPER, [])
    assert (summary["objects"], summary["segments"], summary["cycles"]) == ([], 0, 0)


@pytest.mark.compiled
def test_a_replay_in_a_known_room_gives_objects_and_pose_in_its_frame() -> None:
    settings = load_settings("hallway", ("perception.method=paper",))
    drive = furnished_drive(settings.ring, 2000, length_m=1.5)
    poses: list[LocalizedPose] = []
    with pytest.raises(ValueError, match="no known room"):
        replay_in_known_room(settings, [], lambda _t, _here: None)
    known_room = furnished_room(2000).world
    localization = settings.perception.localization.model_copy(update={"known_room": known_room})
    perception = settings.perception.model_copy(update={"localization": localization})
    settings = settings.model_copy(update={"perception": perception})
    summary = replay_in_known_room(settings, drive.firings, lambda _t, here: poses.append(here))
    assert len(poses) == summary["cycles"] == len(drive.firings)
    assert poses[0].status == "localizing"
    assert (summary["pose"]["status"], summary["frame"]) == ("tracking", "map")
    x, y, _ = drive.truth[-1].tolist()
    assert (summary["pose"]["x"], summary["pose"]["y"]) == pytest.approx((x, y), abs=0.05)


def share_in_place(summary: ReplaySummary) -> float:
    """Return the share of the reported length of walls that lies within 0.1 m of the room's."""
    corners = np.array((*ROOM, ROOM[0]))
    begins, sides = corners[:-1], np.diff(corners, axis=0)
    ends = [((wall["x1"], wall["y1"]), (wall["x2"], wall["y2"])) for wall in summary["walls"]]
    places = np.concatenate([np.linspace(a, b, int(math.dist(a, b) / 0.05) + 2) for a, b in ends])[:, None, :]
    along = (((places - begins) * sides).sum(axis=2) / (sides**2).sum(axis=1)).clip(0.0, 1.0)
    away = np.hypot(*np.moveaxis(begins + along[..., None] * sides - places, 2, 0)).min(axis=1)
    return float((away < 0.1).mean())


@pytest.mark.soak
@pytest.mark.compiled
def test_walls_are_recognised_from_the_path_as_known_at_the_end() -> None:
    settings = load_settings(None).model_copy(update={"ring": RING})
    firings, _ = driven(0.04, 0.02)
    corrected = replay_localized(settings, firings, lambda *_: None)
    assert corrected["frame"] == "map"
    shares = share_in_place(corrected), share_in_place(replay_firings(settings, firings))
    assert shares[0] > 0.8 > 0.5 > shares[1], shares


@pytest.mark.soak
@pytest.mark.compiled
def test_without_drift_its_correction_changes_nothing() -> None:
    """The map frame took quanta of a cycle, so that walls and outlines were refined in another order."""
    settings = load_settings(None).model_copy(update={"ring": RING})
    firings, _ = driven(0.0, 0.0)
    corrected, plain = replay_localized(settings, firings, lambda *_: None), replay_firings(settings, firings)
    assert plain["walls"]
    for name in ("walls", "corners", "polylines", "objects"):
        assert corrected[name] == plain[name]


@pytest.mark.compiled
def test_in_a_run_walls_move_with_their_maps_of_the_way_and_a_snapshot_goes_on_to_the_bit() -> None:
    settings = load_settings(None, ["perception.localization.correct_drift=true"]).of_log()
    settings = settings.model_copy(update={"ring": RING})
    firings, _ = driven(0.04, 0.02, rounds=2)
    first = FiringReplayer(settings, firings)
    runs, frame, moments = [first], first.perception.map_frame, []
    for k, _ in enumerate(first):
        moments.append(frame.moment())
        if k == 300:
            second = FiringReplayer(settings, firings[k + 1 :])
            second.perception.restore(first.perception.snapshot())
            runs.append(second)
    for _ in runs[1]:
        pass
    assert frame.corrects_path
    to = first.perception.odometry_from_map().inverse()
    for moment, firing in zip(moments, firings, strict=True):
        here = first.perception.localized()
        assert moment is not None
        assert here is not None
        known, moved = (
            frame.as_known_now(here, moment).pose,
            to.compose(frame.moved_since(moment)).compose(firing.pose),
        )
        assert (moved.x, moved.y) == pytest.approx((known.x, known.y))
    summary, again = (run.summary(to) for run in runs)
    for name in ("walls", "corners", "polylines", "objects"):
        assert summary[name] == again[name]
    assert share_in_place(summary) > 0.8
