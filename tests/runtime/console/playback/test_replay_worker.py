"""Playing a recording: at its pace, in steps, and never farther behind the last command than one cycle."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orjson
import pytest

from runtime.console.playback.replay_cursor import ReplayCursor
from runtime.console.playback.replay_worker import FRAME_PERIOD_S, FrameParts, ReplayWorker
from runtime.recording.reader import open_recording, parse_settings
from tests.recorded import hall, record
from tests.runtime.console.stub_frames import make_stub_frames

pytestmark = pytest.mark.compiled

CYCLES = 200


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("playing") / "hall.mcap"
    record(hall(), path, 0.05 * CYCLES)
    return path


class Watching:
    """A player in virtual time, and what it has shown."""

    def __init__(self, playback: ReplayCursor) -> None:
        self.now_s = 50.0
        self.frames: list[tuple[float, int, int, dict[str, Any]]] = []
        self.worked = 0
        self.worker = ReplayWorker(
            playback,
            lambda told: make_stub_frames(parse_settings(told), emulated=True),
            self._show,
            lambda: self.now_s,
        )

    def _show(self, source: int, number: int, picture: FrameParts) -> None:
        self.frames.append((self.now_s, source, number, orjson.loads(picture.head + b"}")))

    def do(self, **command: object) -> None:
        self.worker.execute(command)

    def live(self, seconds: float, work_s: float = 0.0) -> None:
        """Let time go by; each cycle's work takes `work_s`."""
        end_s = self.now_s + seconds
        while (wait_s := self.worker.wait_s) < end_s - self.now_s:
            self.now_s += wait_s
            self.worker.advance()
            self.now_s += work_s
            self.worked += 1
        self.now_s = max(self.now_s, end_s)

    @property
    def last(self) -> dict[str, Any]:
        return self.frames[-1][3]


@pytest.fixture
def it(run: Path) -> Iterator[Watching]:
    with open_recording(run) as recording:
        yield Watching(ReplayCursor(recording))


def test_nothing_happens_by_itself(it: Watching) -> None:
    assert it.worker.wait_s == math.inf
    it.worker.advance()
    assert it.frames == []


def test_a_scrub_shows_one_frame(it: Watching) -> None:
    it.do(do="seek", s=4.0)
    it.live(1.0)
    assert len(it.frames) == 1
    assert (it.last["cycle"], it.last["s"], it.last["playing"]) == (81, 4.0, False)
    assert it.last["fired"] == 24, "by then the whole ring has been heard"
    assert it.worker.wait_s == math.inf


def test_only_the_last_of_many_scrubs_is_gone_to(it: Watching) -> None:
    it.do(do="seek", s=9.0)
    it.live(1.0)
    it.worked = 0
    for s in (1.0, 8.0, 3.0, 7.0):
        it.do(do="seek", s=s)
        it.worker.advance()
        it.worker.advance()
    it.live(1.0)
    assert [frame["cycle"] for _, _, _, frame in it.frames] == [181, 141]


def test_it_plays_at_its_pace_and_stops_at_the_end(it: Watching) -> None:
    it.do(do="seek", s=2.0)
    it.live(0.5)
    it.frames.clear()
    it.do(do="play", speed=1.0)
    begun_s = it.now_s
    it.live(3.0)
    assert it.last["s"] == pytest.approx(5.0, abs=0.06)
    for now_s, _, _, frame in it.frames:
        assert frame["s"] - 2.0 == pytest.approx(now_s - begun_s, abs=0.06)
        assert frame["playing"]
    it.live(20.0)
    assert (it.last["cycle"], it.last["playing"]) == (CYCLES, False)
    assert it.worker.wait_s == math.inf
    it.do(do="play", speed=2.0)
    it.live(1.0)
    assert it.last["s"] == pytest.approx(2.0, abs=0.12), "from the beginning again"


def test_frames_are_no_closer_however_fast_it_goes(it: Watching) -> None:
    it.do(do="play", speed=20.0)
    it.live(0.4)
    times = [now_s for now_s, _, _, _ in it.frames]
    assert len(times) >= 4
    assert min(b - a for a, b in itertools.pairwise(times)) >= FRAME_PERIOD_S - 1e-9
    assert it.last["s"] == pytest.approx(8.0, abs=1.1)
    numbers = [(source, number) for _, source, number, _ in it.frames]
    assert numbers == [(1, n + 1) for n in range(len(numbers))]


def test_a_slow_machine_is_slower_and_does_not_hurry_after(it: Watching) -> None:
    it.do(do="play", speed=10.0)
    it.live(1.0, work_s=0.02)
    slow_s = it.last["s"]
    assert slow_s == pytest.approx(2.5, abs=0.3)
    it.live(0.1)
    assert it.last["s"] - slow_s <= 0.1 * 10.0 + 0.25 * 10.0 + 0.6


def test_steps_on_and_back(it: Watching) -> None:
    it.do(do="play", speed=1.0)
    it.live(3.0)
    at = it.last["cycle"]
    for cycles in (1, 1, -1, -1, -1, 20, -40):
        it.do(do="step", cycles=cycles)
        it.live(0.5)
        at += cycles
        assert (it.last["cycle"], it.last["playing"], it.last["fired"]) == (at, False, 24)
    it.do(do="step", cycles=5)
    it.do(do="step", cycles=5)
    it.live(0.5)
    assert it.last["cycle"] == at + 10
    it.do(do="step", cycles=-1000)
    it.live(0.5)
    assert it.last["cycle"] == 1


def test_a_jump_begins_another_source_and_going_on_does_not(it: Watching) -> None:
    it.do(do="seek", s=1.0)
    it.live(0.5)
    it.do(do="step", cycles=1)
    it.live(0.5)
    it.do(do="seek", s=0.2)
    it.live(0.5)
    assert [source for _, source, _, _ in it.frames] == [1, 1, 2]
    assert [number for _, _, number, _ in it.frames] == [1, 2, 1]


def test_a_scrub_while_it_plays_goes_on_from_there(it: Watching) -> None:
    it.do(do="play", speed=1.0)
    it.live(1.0)
    it.do(do="seek", s=6.0)
    it.live(1.0)
    assert it.last["s"] == pytest.approx(7.0, abs=0.1)
    it.do(do="play", speed=0)
    it.frames.clear()
    it.live(5.0)
    assert it.frames == []


@pytest.mark.parametrize(
    "command",
    [{}, {"do": "dance"}, {"do": "seek"}, {"do": "play", "speed": 1e9}, {"do": "play", "speed": -1.0},
     {"do": "step", "cycles": None}],
)  # fmt: skip
def test_what_is_no_command(it: Watching, command: dict[str, Any]) -> None:
    with pytest.raises((ValueError, KeyError, TypeError)):
        it.worker.execute(command)
