"""The replay worker: plays at the recorded pace, steps, and follows a command within one cycle."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import orjson
import pytest

from runtime.console.playback.replay_cursor import ReplayCursor
from runtime.console.playback.replay_worker import FRAME_PERIOD_S, FrameParts, ReplayWorker
from runtime.recording.reader import RecordingError, open_recording, parse_settings
from runtime.recording.replayer import GAP_MAX_S
from tests.recorded import SECONDS, spoil, write_with_gap
from tests.runtime.console.stub_frames import make_stub_frames

pytestmark = pytest.mark.compiled

CYCLES = round(20 * SECONDS)


class WorkerCase:
    """A worker in virtual time, and the frames it has shown."""

    def __init__(self, cursor: ReplayCursor) -> None:
        self.host_s = 50.0
        self.frames: list[tuple[float, int, int, dict[str, Any]]] = []
        self.answers: list[Mapping[str, Any]] = []
        self.worked = 0
        self.worker = ReplayWorker(
            cursor,
            lambda settings: make_stub_frames(parse_settings(settings), emulated=True),
            self._show,
            self.answers.append,
            lambda: self.host_s,
        )

    def _show(self, source: int, number: int, picture: FrameParts) -> None:
        self.frames.append((self.host_s, source, number, orjson.loads(picture.head + b"}")))

    def do(self, **command: object) -> None:
        self.worker.execute(command)

    def run_for(self, seconds: float, work_s: float = 0.0) -> None:
        """Let time pass; each replayed cycle takes `work_s`."""
        end_s = self.host_s + seconds
        while (wait_s := self.worker.wait_s) < end_s - self.host_s:
            self.host_s += wait_s
            self.worker.advance()
            self.host_s += work_s
            self.worked += 1
        self.host_s = max(self.host_s, end_s)

    @property
    def last(self) -> dict[str, Any]:
        return self.frames[-1][3]


@pytest.fixture
def it(run: Path) -> Iterator[WorkerCase]:
    with open_recording(run) as recording:
        yield WorkerCase(ReplayCursor(recording))


def test_without_a_command_nothing_happens(it: WorkerCase) -> None:
    assert it.worker.wait_s == math.inf
    it.worker.advance()
    assert it.frames == []


def test_a_seek_shows_one_frame(it: WorkerCase) -> None:
    it.do(do="seek", s=4.0)
    it.run_for(1.0)
    assert len(it.frames) == 1
    assert (it.last["cycle"], it.last["s"], it.last["playing"]) == (81, 4.0, False)
    assert it.last["fired"] == 24, "by then every sensor has fired"
    assert it.worker.wait_s == math.inf


def test_the_grid_is_that_of_the_cycle_shown_and_comes_only_when_asked(it: WorkerCase) -> None:
    it.do(do="grid")
    assert it.answers == [], "nothing is shown yet"
    it.do(do="seek", s=4.0)
    it.run_for(1.0)
    assert it.answers == []
    it.do(do="grid")
    assert it.answers == [{"type": "grid", "cycle": 81}]


def test_only_the_last_of_many_seeks_is_completed(it: WorkerCase) -> None:
    it.do(do="seek", s=9.0)
    it.run_for(1.0)
    it.worked = 0
    for s in (1.0, 8.0, 3.0, 7.0):
        it.do(do="seek", s=s)
        it.worker.advance()
        it.worker.advance()
    it.run_for(1.0)
    assert [frame["cycle"] for _, _, _, frame in it.frames] == [181, 141]


def test_it_plays_at_the_recorded_pace_and_stops_at_the_end(it: WorkerCase) -> None:
    it.do(do="seek", s=2.0)
    it.run_for(0.5)
    it.frames.clear()
    it.do(do="play", speed=1.0)
    start_s = it.host_s
    it.run_for(3.0)
    assert it.last["s"] == pytest.approx(5.0, abs=0.06)
    for host_s, _, _, frame in it.frames:
        assert frame["s"] - 2.0 == pytest.approx(host_s - start_s, abs=0.06)
        assert frame["playing"]
    it.run_for(20.0)
    assert (it.last["cycle"], it.last["playing"]) == (CYCLES, False)
    assert it.worker.wait_s == math.inf
    it.do(do="play", speed=2.0)
    it.run_for(1.0)
    assert it.last["s"] == pytest.approx(2.0, abs=0.12), "it starts again from the beginning"


def test_the_frame_rate_is_bounded_at_any_speed(it: WorkerCase) -> None:
    it.do(do="play", speed=20.0)
    it.run_for(0.4)
    times = [host_s for host_s, _, _, _ in it.frames]
    assert len(times) >= 4
    assert min(b - a for a, b in itertools.pairwise(times)) >= FRAME_PERIOD_S - 1e-9
    assert it.last["s"] == pytest.approx(8.0, abs=1.1)
    numbers = [(source, number) for _, source, number, _ in it.frames]
    assert numbers == [(1, n + 1) for n in range(len(numbers))]


def test_a_slow_machine_plays_slower_and_does_not_catch_up(it: WorkerCase) -> None:
    it.do(do="play", speed=10.0)
    it.run_for(1.0, work_s=0.02)
    slow_s = it.last["s"]
    assert slow_s == pytest.approx(2.5, abs=0.3)
    it.run_for(0.1)
    assert it.last["s"] - slow_s <= 0.1 * 10.0 + 0.25 * 10.0 + 0.6


@pytest.mark.promise("P21")
def test_a_gap_in_time_is_shortened(run: Path, tmp_path: Path) -> None:
    write_with_gap(run, tmp_path / "gap.mcap", 100, 1e8)
    with open_recording(tmp_path / "gap.mcap") as recording:
        case = WorkerCase(ReplayCursor(recording))
        case.do(do="play", speed=1.0)
        case.run_for(SECONDS + GAP_MAX_S + 0.5)
    assert case.last["cycle"] == CYCLES
    waits = [b - a for (a, *_), (b, *_) in itertools.pairwise(case.frames)]
    assert max(waits) == pytest.approx(GAP_MAX_S, abs=0.06)
    assert sum(wait > 0.5 for wait in waits) == 1


def test_steps_forward_and_backward(it: WorkerCase) -> None:
    it.do(do="play", speed=1.0)
    it.run_for(3.0)
    at = it.last["cycle"]
    for cycles in (1, 1, -1, -1, -1, 20, -40):
        it.do(do="step", cycles=cycles)
        it.run_for(0.5)
        at += cycles
        assert (it.last["cycle"], it.last["playing"], it.last["fired"]) == (at, False, 24)
    it.do(do="step", cycles=5)
    it.do(do="step", cycles=5)
    it.run_for(0.5)
    assert it.last["cycle"] == at + 10
    it.do(do="step", cycles=-1000)
    it.run_for(0.5)
    assert it.last["cycle"] == 1


def test_a_jump_begins_another_source_and_a_step_does_not(it: WorkerCase) -> None:
    it.do(do="seek", s=1.0)
    it.run_for(0.5)
    it.do(do="step", cycles=1)
    it.run_for(0.5)
    it.do(do="seek", s=0.2)
    it.run_for(0.5)
    assert [source for _, source, _, _ in it.frames] == [1, 1, 2]
    assert [number for _, _, number, _ in it.frames] == [1, 2, 1]


def test_after_a_seek_it_plays_on_from_there(it: WorkerCase) -> None:
    it.do(do="play", speed=1.0)
    it.run_for(1.0)
    it.do(do="seek", s=6.0)
    it.run_for(1.0)
    assert it.last["s"] == pytest.approx(7.0, abs=0.1)
    it.do(do="play", speed=0)
    it.frames.clear()
    it.run_for(5.0)
    assert it.frames == []


def test_a_refused_keyframe_is_reported_and_the_seek_is_completed(run: Path, tmp_path: Path) -> None:
    frames = spoil(run, tmp_path / "spoiled.mcap", {1, 2, 3})
    with open_recording(tmp_path / "spoiled.mcap") as recording:
        case = WorkerCase(ReplayCursor(recording))
        case.do(do="seek", s=0.05 * (frames[3] + 30))
        case.run_for(1.0)
        assert case.last["cycle"] == frames[3] + 31
        (answer,) = case.answers
    assert answer["type"] == "replay_problem"
    assert "firings is -7, expected 0 to 9.0072e+15, and 2 more; the replay goes on" in answer["error"]


def test_a_place_without_a_state_and_a_cycle_that_fails_are_reported_and_the_worker_plays_on(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = spoil(run, tmp_path / "spoiled.mcap", range(100), lost={50})
    with open_recording(tmp_path / "spoiled.mcap") as recording:
        case = WorkerCase(ReplayCursor(recording))
        case.do(do="seek", s=0.05 * frames[-1])
        case.run_for(1.0)
        assert case.frames == []
        assert {answer["type"] for answer in case.answers} == {"replay_problem"}
        assert case.answers[-1]["error"].startswith("this moment cannot be replayed")
        assert len(case.answers) <= len(frames) + 1
        case.do(do="seek", s=1.0)
        case.run_for(1.0)
        assert case.last["cycle"] == 21
        monkeypatch.setattr(case.worker._cursor, "next_cycle", failing)
        case.do(do="play", speed=1.0)
        case.run_for(1.0)
        assert case.answers[-1] == {"type": "replay_problem", "error": "cycle 7 cannot be replayed"}
        assert case.worker.wait_s == math.inf, "it is paused"


def failing() -> None:
    raise RecordingError("cycle 7 cannot be replayed")


@pytest.mark.parametrize(
    "command",
    [{}, {"do": "dance"}, {"do": "seek"}, {"do": "play", "speed": 1e9}, {"do": "play", "speed": -1.0},
     {"do": "step", "cycles": None}],
)  # fmt: skip
def test_a_malformed_command(it: WorkerCase, command: dict[str, Any]) -> None:
    with pytest.raises((ValueError, KeyError, TypeError)):
        it.worker.execute(command)
