"""The replayer: cycles are run again from the beginning, a keyframe or a checkpoint, and are skipped after a gap."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from config.load import load_settings, with_known_room
from runtime.cycle.preparation import fresh_state
from runtime.recording.channels import CYCLE, KEYFRAME, decode, encode
from runtime.recording.reader import open_recording
from runtime.recording.replayer import (
    KeyframeError,
    KeyframeFinder,
    Replayer,
    ReplayStep,
    keyframe_cycle,
    replay_from,
)
from runtime.recording.schema import Cycle, Keyframe, perception_snapshot
from tests.recorded import entries_of, hall, record, rewrite, spoil


@pytest.mark.compiled
def test_a_restored_state_is_whole(run: Path) -> None:
    """Also values that perception derives from its memory and caches."""
    frames = [decode(Keyframe, e.data) for e in entries_of(run) if e.topic == KEYFRAME]
    with open_recording(run) as recording:
        state = fresh_state(recording.settings)
        assert state.perception.objects() == ()
        snapshot = perception_snapshot(frames[-1], state.perception.snapshot())
        state.perception.restore(snapshot)
        assert len(state.perception.objects()) >= 3
        other = fresh_state(hall("perception.bayes.tracks_max=7"))
        with pytest.raises(ValueError, match="of other settings"):
            other.perception.restore(snapshot)
        with pytest.raises(ValueError, match="another method"):
            fresh_state(hall("perception.method=paper")).perception.restore(snapshot)


@pytest.fixture(scope="module")
def paper_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("replayer") / "hall.mcap"
    record(hall("perception.method=paper"), path, 6.0)
    return path


def is_equal(step: ReplayStep) -> bool:
    """Return whether a cycle was replayed as it was recorded."""
    assert step.replayed is not None
    return encode(Cycle.model_construct(record=step.replayed)) == step.message.data


def cycles(replayer: Replayer) -> list[ReplayStep]:
    return [step for step in replayer if step.recorded is not None]


def test_every_cycle_is_replayed_from_the_beginning(paper_run: Path) -> None:
    with open_recording(paper_run) as recording:
        replayer = Replayer(recording)
        found = cycles(replayer)
        assert replayer.settings_data == recording.info.settings
    assert [step.recorded.cycle for step in found if step.recorded is not None] == list(range(1, 121))
    assert all(is_equal(step) for step in found)


@pytest.mark.soak
@pytest.mark.compiled
def test_a_run_in_a_known_room_is_replayed_to_the_bit_and_drives_as_without_the_map(tmp_path: Path) -> None:
    """From the beginning and from each keyframe, one of them in the midst of a search."""
    plain = load_settings("irregular", ["recording.keyframe_period_s=2.0", "perception.method=paper"])
    commands = {}
    for name, settings in (("plain", plain), ("mapped", with_known_room(plain, "irregular"))):
        record(settings, tmp_path / name, 8.0, refused=0.02)
        with open_recording(tmp_path / name) as recording:
            commands[name] = [one.command for one in recording.cycle_records()]
    assert commands["mapped"] == commands["plain"], "no correction of the place makes the drive jump"
    with open_recording(tmp_path / "mapped") as recording:
        finder = KeyframeFinder(recording)
        positions = [found for at, chunk in recording.chunks() for m in chunk if (found := finder.find(at, m))]
        statuses = []
        for start in (None, *positions[1::2]):
            replayer = Replayer(recording, start)
            steps = cycles(replayer)
            assert all(is_equal(step) for step in steps)
            assert replayer.state is not None
            statuses.append(repr(replayer.state.perception.localized()))
    assert len(set(statuses)) == 1
    assert "status='tracking'" in statuses[0]


def test_cross_paths_are_recorded_and_replayed_to_the_bit(tmp_path: Path) -> None:
    path = tmp_path / "ears.mcap"
    record(load_settings("hallway", ["perception.method=paper"], robot="ears"), path, 2.0)
    with open_recording(path) as recording:
        found = cycles(Replayer(recording))
    assert all(is_equal(step) for step in found)
    firings = [f for s in found if s.recorded is not None for f in s.recorded.inputs.received.firings]
    heard = [firing.cross_paths for firing in firings if firing.cross_paths is not None]
    assert len(heard) > 20
    assert all(paths.listeners.dtype == np.int64 for paths in heard)
    assert sum(int(np.isfinite(paths.half_paths_m).sum()) for paths in heard) > 20


def test_a_replay_continues_from_a_checkpoint_and_from_a_keyframe(paper_run: Path) -> None:
    with open_recording(paper_run) as recording:
        first = Replayer(recording)
        while first.state is not None and first.state.cycle < 50:
            next(first)
        checkpoint = first.checkpoint()
        assert checkpoint is not None
        assert (checkpoint.cycle, checkpoint.nbytes > 1000) == (50, True)
        finder = KeyframeFinder(recording)
        positions = [found for at, chunk in recording.chunks() for m in chunk if (found := finder.find(at, m))]
        assert len(positions) >= 2
        for replayer, first_cycle in (
            (Replayer(recording, checkpoint), 51),
            (Replayer(recording, positions[1]), positions[1].cycle + 1),
        ):
            steps = cycles(replayer)
            assert all(is_equal(step) for step in steps)
            assert [one.recorded.cycle for one in steps if one.recorded is not None] == list(range(first_cycle, 121))


def test_cycles_after_a_gap_are_skipped_until_the_next_keyframe(paper_run: Path, tmp_path: Path) -> None:
    entries = entries_of(paper_run)
    lost = [k for k, entry in enumerate(entries) if entry.topic == CYCLE][10]
    following = next(keyframe_cycle(entry) for entry in entries[lost:] if entry.topic == KEYFRAME)
    path = tmp_path / "gap.mcap"
    rewrite([*entries[:lost], *entries[lost + 1 :]], path)
    with open_recording(path) as recording:
        replayer = Replayer(recording)
        steps = list(islice((step for step in replayer if step.recorded is not None), 11))
        assert steps[-1].replayed is None
        assert replayer.state is None
        assert replayer.checkpoint() is None
        rest = cycles(replayer)
    skipped = [step.recorded.cycle for step in rest if step.replayed is None and step.recorded is not None]
    assert following is not None
    assert skipped == list(range(13, following + 1))
    assert all(is_equal(step) for step in rest[len(skipped) :])


def test_a_refused_keyframe_costs_what_follows_up_to_the_next_one(paper_run: Path, tmp_path: Path) -> None:
    path = tmp_path / "spoiled.mcap"
    first, second, *_ = spoil(paper_run, path, {0}, lost={20})
    assert 20 < first < second < 120
    with open_recording(path) as recording:
        steps = list(Replayer(recording))
    refused = [step.refused for step in steps if step.refused is not None]
    assert refused == [
        f"the keyframe of cycle {first} is refused: canyon_map.firings is -7, expected 0 to 9.0072e+15"
    ]
    replayed = [step.recorded.cycle for step in steps if step.replayed is not None and step.recorded is not None]
    assert replayed == [*range(1, 20), *range(second + 1, 121)]
    assert all(is_equal(step) for step in steps if step.replayed is not None)


def test_a_keyframe_that_is_not_valid_is_refused(paper_run: Path, tmp_path: Path) -> None:
    entries = entries_of(paper_run)
    where = [k for k, entry in enumerate(entries) if entry.topic == KEYFRAME]
    for data in (b"{}", b'{"run_s":1.0,"cycle":40,"state":7}', b""):
        entries[where[0]] = entries[where[0]]._replace(data=data)
        rewrite(entries, tmp_path / "x.mcap")
        with open_recording(tmp_path / "x.mcap") as recording:
            steps = list(Replayer(recording))
        (refused,) = (step.refused for step in steps if step.refused is not None)
        assert "keyframe" in refused
        assert "\n" not in refused
        assert sum(step.replayed is not None for step in steps) == 120


def test_a_replay_starts_at_the_best_state_that_is_not_refused(paper_run: Path, tmp_path: Path) -> None:
    path = tmp_path / "spoiled.mcap"
    first, last = spoil(paper_run, path, {1})
    with open_recording(path) as recording:
        finder, refused = KeyframeFinder(recording), list[KeyframeError]()
        positions = [found for at, chunk in recording.chunks() for m in chunk if (found := finder.find(at, m))]
        with pytest.raises(KeyframeError, match=f"^the keyframe of cycle {last} is refused"):
            Replayer(recording, positions[1])
        with pytest.raises(KeyframeError, match="the keyframe of cycle 77777 cannot be read"):
            Replayer(recording, positions[1]._replace(cycle=77777))
        for starts, begin in ((positions[::-1], first + 1), (positions[1:], 1)):
            replayer = replay_from(recording, starts, lambda _, error: refused.append(error))
            assert next(s.recorded.cycle for s in replayer if s.recorded and s.replayed) == begin
    assert len(refused) == 2


def test_the_cycle_of_a_keyframe_is_read_without_decoding(paper_run: Path) -> None:
    frames = [entry for entry in entries_of(paper_run) if entry.topic == KEYFRAME]
    for entry in frames:
        cycle = decode(Keyframe, entry.data).cycle
        assert keyframe_cycle(entry) == cycle
        assert keyframe_cycle(entry._replace(data=b" " + entry.data)) == cycle, "another form is decoded"
