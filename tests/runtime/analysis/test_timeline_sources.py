"""Tests of loading timelines: from a recording by a replay, and from a ring log by running perception over it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from config.errors import WRONG_CALL, UserError
from config.load import load_world
from config.settings import Settings
from runtime.analysis import timeline_sources
from runtime.analysis.timeline import Timeline
from runtime.analysis.timeline_sources import TimelineSource, load_timeline
from runtime.cycle.step import CycleRecord, State
from runtime.recording import replayer
from tests.recorded import spoil

REPLAY_CYCLE = replayer.replay_cycle


def ignore(_settings: Settings) -> None:
    """Prepare nothing."""


def test_a_recording_is_replayed_whole(timeline: Timeline) -> None:
    assert timeline.world == load_world("hallway")
    assert timeline.cycles == 280
    assert timeline.notes == [], "the replay does not differ from the run"
    assert timeline.seconds == pytest.approx(13.95, abs=0.06)
    assert [entered.mode for entered in timeline.modes][-1] == "DRIVE"
    assert timeline.summary is not None
    times = [snapshot.t_s for snapshot in timeline.snapshots]
    assert times == sorted(times)
    assert times[-1] == timeline.seconds
    assert len(timeline.objects) >= 3
    assert len(timeline.cycle_gaps_s) == 279
    assert sum(timeline.refinement_stops.values()) == 280
    assert timeline.counts is not None, "bytes of the line are recorded"


def test_a_long_recording_is_read_from_its_keyframes(
    hall_run: Path, timeline: Timeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is between the first and the last keyframe is read, not replayed; the end is the same to the bit."""
    replayed = list[int]()
    monkeypatch.setattr(timeline_sources, "SKIMMED_KEYFRAMES_MIN", 3)

    def counting(state: State, record: CycleRecord, settings: Settings) -> CycleRecord:
        replayed.append(record.cycle)
        return REPLAY_CYCLE(state, record, settings)

    monkeypatch.setattr(replayer, "replay_cycle", counting)
    read = load_timeline(TimelineSource(str(hall_run)), ignore, skim=True)
    assert len(replayed) < 0.5 * timeline.cycles
    assert (read.cycles, read.seconds, read.notes) == (timeline.cycles, timeline.seconds, [])
    assert (read.objects, read.walls) == (timeline.objects, timeline.walls)
    np.testing.assert_array_equal(read.snapshots[-1].segments, timeline.snapshots[-1].segments)
    np.testing.assert_array_equal(read.echoes, timeline.echoes)
    assert (read.modes, read.counts, read.refinement_stops) == (
        timeline.modes, timeline.counts, timeline.refinement_stops
    )  # fmt: skip
    times = [snapshot.t_s for snapshot in read.snapshots]
    assert times == sorted(times)
    assert len(times) > 5


@pytest.mark.soak
def test_a_recording_with_refused_keyframes_is_read_and_they_are_noted(
    hall_run: Path, timeline: Timeline, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With all cycles there nothing is lost; after a gap it goes on at the next good keyframe."""
    monkeypatch.setattr(timeline_sources, "SKIMMED_KEYFRAMES_MIN", 3)
    path = tmp_path / "spoiled.mcap"
    spoil(hall_run, path, {1})
    read = load_timeline(TimelineSource(str(path)), ignore, skim=True)
    assert (read.cycles, read.objects) == (timeline.cycles, timeline.objects)
    first, *_ = spoil(hall_run, path, {0}, lost={10})
    read = load_timeline(TimelineSource(str(path)), ignore)
    assert 0 < read.cycles < timeline.cycles - (first - 10)
    assert len(read.objects) >= 3
    (note,) = (note for note in read.notes if "refused" in note)
    assert f"the keyframe of cycle {first} is refused: canyon_map.firings is -7" in note


def test_a_ring_log_has_echoes_and_objects_and_no_modes(hall_log: Path, timeline: Timeline) -> None:
    prepared, steps = list[Settings](), list[None]()
    sets = ("perception.method=paper",)
    loaded = load_timeline(
        TimelineSource(str(hall_log), sets, world="hallway"), prepared.append, lambda: steps.append(None)
    )
    assert prepared == [loaded.settings]
    assert loaded.settings.perception.method == "paper"
    assert loaded.world == timeline.world
    assert loaded.cycles == len(steps) == len(np.unique(timeline.echoes["robot_s"]))
    for name in ("sensor", "range_m", "robot_s"):
        np.testing.assert_array_equal(loaded.echoes[name], timeline.echoes[name])
    assert len(loaded.objects) >= 3
    assert (loaded.modes, loaded.cycle_unix, loaded.summary, loaded.counts) == ([], [], None, None)
    way, known = np.array([(o.pose.x, o.pose.y) for _, o in loaded.odometry]), timeline.odometry
    assert np.ptp(way[:, 0]) == pytest.approx(np.ptp([o.pose.x for _, o in known]), abs=0.1), "its path is known"
    assert np.diff([o.robot_s for _, o in loaded.odometry]).max() < 0.3
    assert all(math.isnan(o.twist.v) for _, o in loaded.odometry), "a ring log does not say how fast the wheels were"
    assert load_timeline(TimelineSource(str(hall_log), sets), ignore).world is None


@pytest.mark.parametrize("option", [{"sets": ("cycle.rate_hz=10",)}, {"robot": "denning"}, {"models": ("drum",)}])
def test_a_recording_contains_its_settings(hall_run: Path, option: dict[str, object]) -> None:
    with pytest.raises(UserError, match="contains its settings") as caught:
        load_timeline(TimelineSource(str(hall_run), **option), ignore)  # type: ignore[arg-type]
    assert caught.value.exit_code == WRONG_CALL
