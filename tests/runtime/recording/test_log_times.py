"""Log times are Unix times even if the run's clock is paused; messages hold the run's time."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.messages import Pose
from runtime.analysis.timeline_sources import TimelineSource, load_timeline
from runtime.console.playback.replay_cursor import ReplayCursor
from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import BOOKMARK, CYCLE, LOG, MODE, SERIAL, RawMessage, decode
from runtime.recording.reader import cycle_head, open_recording
from runtime.recording.recorder import Recorder
from runtime.recording.schema import Bookmark, LogLine, ModeChange, SerialBytes
from runtime.recording.storage import SingleFile
from runtime.simulation.closed_loop import simulate
from runtime.timing.run_clock import ScaledClock
from tests.recorded import entries_of, hall, until, verify_file

PAUSE_S = 10.0
PAUSED_AFTER = 40
CYCLES = 80


class Host:
    """A monotonic clock that a test sets."""

    def __init__(self) -> None:
        self.s = 0.0

    def __call__(self) -> float:
        return self.s


@pytest.fixture(scope="module")
def paused(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the recording of an emulated run that was paused for ten seconds after two."""
    path = tmp_path_factory.mktemp("paused") / "run.mcap"
    settings, host = hall("perception.method=paper"), Host()
    assert settings.world is not None
    clock = ScaledClock(host)
    with Recorder(settings, SingleFile(path), clock, emulated=True) as recorder:
        until(lambda: recorder.status.is_writing, "a file")

        def on_state(record: CycleRecord, state: State, _start: Pose) -> None:
            host.s += 0.05
            assert clock() == pytest.approx(record.inputs.run_s, abs=1e-6)
            recorder.on_bytes("in", clock(), host.s, b"bytes")
            recorder.on_cycle(replace(record, inputs=replace(record.inputs, host_s=host.s)), state)
            if record.cycle == PAUSED_AFTER:
                clock.pause(0.0)
                host.s += PAUSE_S
                recorder.on_log({"level": "info", "event": "paused"})
                assert recorder.bookmark("in the pause") is None
                assert recorder.bookmark("by mistake") is None
                assert recorder.undo_bookmark() == "by mistake"
                clock.resume()

        simulate(settings, settings.world, 0, CYCLES / 20.0, on_state=on_state)
    return path


def of(messages: list[RawMessage], topic: str) -> list[RawMessage]:
    return [message for message in messages if message.topic == topic]


def test_a_pause_advances_log_times_but_not_run_times(paused: Path) -> None:
    cycles = of(entries_of(paused), CYCLE)
    assert len(cycles) == CYCLES
    log_gaps = np.diff([message.log_ns for message in cycles]) * 1e-9
    run_gaps = np.diff([cycle_head(message)[1] for message in cycles])
    assert run_gaps == pytest.approx(np.full(CYCLES - 1, 0.05), abs=1e-6)
    expected = np.full(CYCLES - 1, 0.05)
    expected[PAUSED_AFTER - 1] += PAUSE_S
    assert log_gaps == pytest.approx(expected, abs=1e-6)


def test_log_times_are_unix_times(paused: Path) -> None:
    """The file was written within the last minutes; its host clock ran at test speed."""
    with open_recording(paused) as recording:
        first = next(message.log_ns for message in recording.messages() if message.topic == CYCLE)
        offset = recording.info.unix_minus_host_ns
    assert abs(first - time.time_ns()) < 600e9
    assert first - offset == pytest.approx(1e9 * 0.05, abs=1e3)


def test_every_message_in_the_pause_has_the_run_s_time(paused: Path) -> None:
    messages = entries_of(paused)
    last = of(messages, CYCLE)[PAUSED_AFTER - 1]
    run_s, pause_ns = cycle_head(last)[1], round(1e9 * PAUSE_S)
    line, mark = of(messages, LOG)[0], of(messages, BOOKMARK)[0]
    assert decode(LogLine, line.data).run_s == pytest.approx(run_s, abs=1e-6)
    assert decode(Bookmark, mark.data).run_s == pytest.approx(run_s, abs=1e-6)
    assert (line.log_ns - last.log_ns, mark.log_ns - last.log_ns) == (pause_ns, pause_ns)
    pieces = [p for m in of(messages, SERIAL["in"]) for p in decode(SerialBytes, m.data).pieces()]
    assert np.diff([run_s for run_s, _ in pieces]) == pytest.approx(np.full(CYCLES - 1, 0.05), abs=1e-5)
    assert all(decode(ModeChange, m.data).run_s > 0.0 for m in of(messages, MODE))


def test_replay_timeline_and_playback_use_the_run_s_time(paused: Path) -> None:
    with open_recording(paused) as recording:
        cursor = ReplayCursor(recording)
        assert cursor.duration_s == pytest.approx(0.05 * (CYCLES - 1), abs=1e-6)
        assert [text for _, text in cursor.bookmarks] == ["in the pause"]
        assert cursor.bookmarks[0][0] == pytest.approx(0.05 * (PAUSED_AFTER - 1), abs=1e-6)
    result = verify_file(paused)
    assert (result.cycles, result.differences) == (CYCLES, 0)
    assert result.recorded_s == pytest.approx(0.05 * (CYCLES - 1), abs=1e-6)
    timeline = load_timeline(TimelineSource(str(paused)), lambda _settings: None)
    assert timeline.seconds == pytest.approx(0.05 * (CYCLES - 1), abs=1e-6)
    assert [mark.text for mark in timeline.bookmarks] == ["in the pause"]
    assert timeline.bookmarks[0].t_s == timeline.log[0].t_s == pytest.approx(0.05 * (PAUSED_AFTER - 1), abs=1e-6)
    # Exports have true Unix times on both sides of the pause.
    gap_ns = timeline.unix_ns(timeline.seconds) - timeline.start_unix_ns
    assert 1e-9 * gap_ns == pytest.approx(0.05 * (CYCLES - 1) + PAUSE_S, abs=1e-5)
