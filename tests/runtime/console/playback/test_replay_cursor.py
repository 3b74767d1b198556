"""Moving about in a recording: wherever one comes from, a cycle and what it left are the same, to the bit."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from runtime.console.playback.replay_cursor import KEPT_BYTES, LOOK_BACK, ReplayCursor
from runtime.recording.channels import BOOKMARK, CYCLE, KEYFRAME, RUN_INFO, RawMessage, encode
from runtime.recording.reader import RecordingError, open_recording
from runtime.recording.schema import Bookmark
from tests.recorded import entries_of, hall, record, rewrite
from tests.runtime.console.stub_frames import fingerprint

pytestmark = pytest.mark.compiled

SECONDS = 10.0
CYCLES = 200


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("played") / "hall.mcap"
    settings = hall()
    other = settings.model_copy(update={"cycle": settings.cycle.model_copy(update={"perception_budget_s": 0.01})})
    record(settings, path, SECONDS, reloads={90: other})
    return path


@pytest.fixture(scope="module")
def truth(run: Path) -> list[dict[str, Any]]:
    """Return every cycle as it comes when one begins at the beginning and goes on to the end."""
    with open_recording(run) as recording:
        playback = ReplayCursor(recording)
        seen = []
        while (shown := playback.next_cycle()) is not None:
            seen.append(fingerprint(shown))
    assert [one["cycle"] for one in seen] == list(range(1, CYCLES + 1))
    return seen


@pytest.fixture
def playback(run: Path) -> Iterator[ReplayCursor]:
    with open_recording(run) as recording:
        yield ReplayCursor(recording)


def arrive(playback: ReplayCursor, position: int) -> dict[str, Any]:
    """Go somewhere and return what is there."""
    last, steps = None, 0
    for shown in playback.seek(position):
        last, steps = shown, steps + 1
    assert last is not None
    assert steps <= 2.0 * 20 + LOOK_BACK + 1, "a keyframe is every two seconds"
    return fingerprint(last)


def test_what_there_is_to_know(playback: ReplayCursor) -> None:
    assert playback.cycles == CYCLES
    assert playback.duration_s == pytest.approx(SECONDS - 0.05)
    assert playback.modes[0][1].mode.value == "READY"
    assert playback.modes[-1][1].mode.value == "DRIVE"
    assert playback.position_at(-1.0) == 1
    assert playback.position_at(0.0) == 1
    assert playback.position_at(1.0) == 21
    assert playback.position_at(1e9) == CYCLES
    assert playback.time_of(21) == pytest.approx(1.0)


def test_anywhere_from_anywhere(playback: ReplayCursor, truth: list[dict[str, Any]]) -> None:
    rng = random.Random(5)
    for position in [CYCLES, 1, 2, CYCLES, 100, 99, 98, 97, *(rng.randint(1, CYCLES) for _ in range(25))]:
        assert arrive(playback, position) == truth[position - 1]
        assert playback.position == position
        assert playback.t_s == pytest.approx(0.05 * (position - 1))
        if position < CYCLES:
            shown = playback.next_cycle()
            assert shown is not None
            assert fingerprint(shown) == truth[position]
    assert arrive(playback, CYCLES + 50) == truth[-1]
    assert playback.next_cycle() is None
    assert arrive(playback, -3) == truth[0]


def test_the_way_back_is_short_once_it_was_gone(
    playback: ReplayCursor, monkeypatch: pytest.MonkeyPatch, truth: list[dict[str, Any]]
) -> None:
    monkeypatch.setattr("runtime.console.playback.replay_cursor.KEEP_PERIOD", 10)
    while playback.next_cycle() is not None:
        pass
    for position in range(CYCLES - 1, CYCLES - 30, -1):
        steps, last = 0, {}
        for shown in playback.seek(position):
            steps, last = steps + 1, fingerprint(shown) if playback.position == position else {}
        assert steps <= 10 + LOOK_BACK
        assert last == truth[position - 1]
    assert playback._kept_bytes <= KEPT_BYTES


def test_little_is_kept(playback: ReplayCursor, monkeypatch: pytest.MonkeyPatch, truth: list[dict[str, Any]]) -> None:
    monkeypatch.setattr("runtime.console.playback.replay_cursor.KEEP_PERIOD", 10)
    list(playback.seek(40))
    one = playback._kept_bytes // len(playback._kept)
    monkeypatch.setattr("runtime.console.playback.replay_cursor.KEPT_BYTES", 3 * one)
    list(playback.seek(CYCLES))
    assert playback._kept_bytes <= 3 * one
    assert arrive(playback, 120) == truth[119]


def test_a_recording_that_begins_in_the_middle(run: Path, tmp_path: Path, truth: list[dict[str, Any]]) -> None:
    """As when recording is switched on in mid-run: the first thing in it is a keyframe."""
    entries = entries_of(run)
    frames = [at for at, entry in enumerate(entries) if entry.topic == KEYFRAME]
    path = tmp_path / "part.mcap"
    rewrite([entries[0], *entries[frames[1] - 1 :]], path)
    with open_recording(path) as recording:
        playback = ReplayCursor(recording)
        seen = []
        while (shown := playback.next_cycle()) is not None:
            seen.append(fingerprint(shown))
        assert 0 < len(seen) < CYCLES
        assert seen == truth[-len(seen) :]
        for position in (len(seen), 1, len(seen) // 2):
            assert arrive(playback, position) == seen[position - 1]


def test_over_a_gap(run: Path, tmp_path: Path, truth: list[dict[str, Any]]) -> None:
    entries, numbers = entries_of(run), iter(range(1, CYCLES + 1))
    kept: list[RawMessage] = []
    for entry in entries:
        number = next(numbers) if entry.topic == CYCLE else 0
        if not 50 < number <= 60:
            kept.append(entry)
    path = tmp_path / "gap.mcap"
    rewrite(kept, path)
    with open_recording(path) as recording:
        playback = ReplayCursor(recording)
        assert playback.cycles == CYCLES - 10
        shown = list(playback.seek(playback.position_at(3.0)))[-1]
        assert fingerprint(shown) == truth[shown.record.cycle - 1]
        assert shown.record.cycle > 60


def test_bookmarks(run: Path, tmp_path: Path) -> None:
    entries, path = entries_of(run), tmp_path / "marked.mcap"
    cycles = [at for at, entry in enumerate(entries) if entry.topic == CYCLE]
    at = cycles[40]
    mark = RawMessage(BOOKMARK, entries[at].log_ns, encode(Bookmark(run_s=2.05, cycle=41, text="here <it> was")))
    rewrite([*entries[: at + 1], mark, *entries[at + 1 :]], path)
    with open_recording(path) as recording:
        playback = ReplayCursor(recording)
        assert [(round(s, 6), text) for s, text in playback.bookmarks] == [(2.0, "here <it> was")]


def test_what_holds_no_cycle(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "none.mcap"
    rewrite([entry for entry in entries_of(run) if entry.topic == RUN_INFO][:1], path)
    with open_recording(path) as recording, pytest.raises(RecordingError, match="holds no cycle"):
        ReplayCursor(recording)
