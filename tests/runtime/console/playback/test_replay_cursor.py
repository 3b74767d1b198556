"""A seek from any position gives the same cycle, and the same state after it, to the bit."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from config.settings import Settings
from runtime.console.playback.replay_cursor import KEPT_BYTES, LOOK_BACK, ReplayCursor
from runtime.cycle.step import CycleRecord, State
from runtime.recording import replayer
from runtime.recording.channels import BOOKMARK, CYCLE, KEYFRAME, RUN_INFO, RawMessage, encode
from runtime.recording.reader import RecordingError, open_recording
from runtime.recording.schema import Bookmark
from tests.recorded import entries_of, hall, record, rewrite, spoil
from tests.runtime.console.stub_frames import fingerprint

pytestmark = pytest.mark.compiled

SECONDS = 10.0
CYCLES = 200


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("replayed") / "hall.mcap"
    settings = hall()
    other = settings.model_copy(update={"cycle": settings.cycle.model_copy(update={"perception_budget_s": 0.01})})
    record(settings, path, SECONDS, reloads={90: other})
    return path


@pytest.fixture(scope="module")
def truth(run: Path) -> list[dict[str, Any]]:
    """Return every cycle, replayed from the beginning to the end."""
    with open_recording(run) as recording:
        cursor = ReplayCursor(recording)
        cycles = []
        while (replayed := cursor.next_cycle()) is not None:
            cycles.append(fingerprint(replayed))
    assert [one["cycle"] for one in cycles] == list(range(1, CYCLES + 1))
    return cycles


@pytest.fixture
def cursor(run: Path) -> Iterator[ReplayCursor]:
    with open_recording(run) as recording:
        yield ReplayCursor(recording)


def seek_to(cursor: ReplayCursor, position: int) -> dict[str, Any]:
    """Seek to a position and return the cycle there."""
    last, steps = None, 0
    for replayed in cursor.seek(position):
        last, steps = replayed, steps + 1
    assert last is not None
    assert steps <= 2.0 * 20 + LOOK_BACK + 1, "a keyframe is every two seconds"
    return fingerprint(last)


def test_the_description_of_a_recording(cursor: ReplayCursor) -> None:
    assert cursor.cycles == CYCLES
    assert cursor.duration_s == pytest.approx(SECONDS - 0.05)
    assert cursor.modes[0][1].mode.value == "READY"
    assert cursor.modes[-1][1].mode.value == "DRIVE"
    assert cursor.position_at(-1.0) == 1
    assert cursor.position_at(0.0) == 1
    assert cursor.position_at(1.0) == 21
    assert cursor.position_at(1e9) == CYCLES
    assert cursor.time_of(21) == pytest.approx(1.0)


def test_seek_from_anywhere_to_anywhere(cursor: ReplayCursor, truth: list[dict[str, Any]]) -> None:
    rng = random.Random(5)
    for position in [CYCLES, 1, 2, CYCLES, 100, 99, 98, 97, *(rng.randint(1, CYCLES) for _ in range(8))]:
        assert seek_to(cursor, position) == truth[position - 1]
        assert cursor.position == position
        assert cursor.t_s == pytest.approx(0.05 * (position - 1))
        if position < CYCLES:
            replayed = cursor.next_cycle()
            assert replayed is not None
            assert fingerprint(replayed) == truth[position]
    assert seek_to(cursor, CYCLES + 50) == truth[-1]
    assert cursor.next_cycle() is None
    assert seek_to(cursor, -3) == truth[0]


def test_kept_states_make_a_seek_backward_short(
    cursor: ReplayCursor, monkeypatch: pytest.MonkeyPatch, truth: list[dict[str, Any]]
) -> None:
    monkeypatch.setattr("runtime.console.playback.replay_cursor.KEEP_PERIOD", 10)
    while cursor.next_cycle() is not None:
        pass
    for position in range(CYCLES - 1, CYCLES - 15, -1):
        steps, last = 0, {}
        for replayed in cursor.seek(position):
            steps, last = steps + 1, fingerprint(replayed) if cursor.position == position else {}
        assert steps <= 10 + LOOK_BACK
        assert last == truth[position - 1]
    assert cursor._kept_bytes <= KEPT_BYTES


def test_kept_states_are_bounded(
    cursor: ReplayCursor, monkeypatch: pytest.MonkeyPatch, truth: list[dict[str, Any]]
) -> None:
    monkeypatch.setattr("runtime.console.playback.replay_cursor.KEEP_PERIOD", 10)
    list(cursor.seek(40))
    one = cursor._kept_bytes // len(cursor._kept)
    monkeypatch.setattr("runtime.console.playback.replay_cursor.KEPT_BYTES", 3 * one)
    list(cursor.seek(CYCLES))
    assert cursor._kept_bytes <= 3 * one
    assert seek_to(cursor, 120) == truth[119]


def test_a_recording_that_starts_in_mid_run(run: Path, tmp_path: Path, truth: list[dict[str, Any]]) -> None:
    """As when recording is switched on in mid-run: it starts with a keyframe."""
    entries = entries_of(run)
    frames = [at for at, entry in enumerate(entries) if entry.topic == KEYFRAME]
    path = tmp_path / "part.mcap"
    rewrite([entries[0], *entries[frames[1] - 1 :]], path)
    with open_recording(path) as recording:
        cursor = ReplayCursor(recording)
        cycles = []
        while (replayed := cursor.next_cycle()) is not None:
            cycles.append(fingerprint(replayed))
        assert 0 < len(cycles) < CYCLES
        assert cycles == truth[-len(cycles) :]
        for position in (len(cycles), 1, len(cycles) // 2):
            assert seek_to(cursor, position) == cycles[position - 1]


def test_seek_over_a_gap(run: Path, tmp_path: Path, truth: list[dict[str, Any]]) -> None:
    entries, numbers = entries_of(run), iter(range(1, CYCLES + 1))
    kept: list[RawMessage] = []
    for entry in entries:
        number = next(numbers) if entry.topic == CYCLE else 0
        if not 50 < number <= 60:
            kept.append(entry)
    path = tmp_path / "gap.mcap"
    rewrite(kept, path)
    with open_recording(path) as recording:
        cursor = ReplayCursor(recording)
        assert cursor.cycles == CYCLES - 10
        replayed = list(cursor.seek(cursor.position_at(3.0)))[-1]
        assert fingerprint(replayed) == truth[replayed.record.cycle - 1]
        assert replayed.record.cycle > 60


def test_a_seek_goes_round_a_refused_keyframe(run: Path, tmp_path: Path, truth: list[dict[str, Any]]) -> None:
    path = tmp_path / "spoiled.mcap"
    frames = spoil(run, path, {1, 2})
    with open_recording(path) as recording:
        cursor = ReplayCursor(recording)
        for position in (frames[2] + 30, 1, frames[1] + 25, CYCLES, frames[2] + 30):
            last = list(cursor.seek(position))[-1]
            assert fingerprint(last) == truth[position - 1]
        refused = cursor.take_refused()
        assert len(refused) == 2, "each is reported once"
        assert all("firings is -7" in line for line in refused)
        assert cursor.take_refused() == []


def test_a_seek_works_after_a_cycle_that_cannot_be_replayed(
    run: Path, truth: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    replay = replayer.replay_cycle

    def failing(state: State, record: CycleRecord, settings: Settings) -> CycleRecord:
        if record.cycle == 60:
            raise ValueError("it is impossible")
        return replay(state, record, settings)

    monkeypatch.setattr(replayer, "replay_cycle", failing)
    with open_recording(run) as recording:
        cursor = ReplayCursor(recording)
        for _ in range(2):
            with pytest.raises(RecordingError, match=r"cycle 60 cannot be replayed.*it is impossible"):
                list(cursor.seek(65))
            for position in (50, 120):
                assert fingerprint(list(cursor.seek(position))[-1]) == truth[position - 1]


def test_bookmarks_have_their_time(run: Path, tmp_path: Path) -> None:
    entries, path = entries_of(run), tmp_path / "marked.mcap"
    cycles = [at for at, entry in enumerate(entries) if entry.topic == CYCLE]
    at = cycles[40]
    mark = RawMessage(BOOKMARK, entries[at].log_ns, encode(Bookmark(run_s=2.05, cycle=41, text="here <it> was")))
    rewrite([*entries[: at + 1], mark, *entries[at + 1 :]], path)
    with open_recording(path) as recording:
        cursor = ReplayCursor(recording)
        assert [(round(s, 6), text) for s, text in cursor.bookmarks] == [(2.0, "here <it> was")]


def test_a_recording_without_cycles_is_refused(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "none.mcap"
    rewrite([entry for entry in entries_of(run) if entry.topic == RUN_INFO][:1], path)
    with open_recording(path) as recording, pytest.raises(RecordingError, match="holds no cycle"):
        ReplayCursor(recording)
