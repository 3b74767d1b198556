"""A run whose recognition begins in a later cycle is replayed to the bit, from the start and from every keyframe."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from config.load import load_settings, with_known_room
from config.settings import Settings
from runtime.recording.channels import CYCLE, KEYFRAME
from runtime.recording.reader import open_recording
from runtime.recording.recorder import Recorder
from runtime.recording.replayer import KeyframeFinder, Replayer
from runtime.recording.storage import SingleFile
from runtime.recording.verification import verify_recording
from tests.recorded import until
from tests.runtime.emulated_run import Run

CYCLES = 120


def record(settings: Settings, path: Path, begins: int) -> list[int]:
    """Record a drive that recognises from a cycle on; return how many segments each cycle has."""
    assert settings.world is not None
    now = [0.0]
    with Recorder(settings, SingleFile(path), clock=lambda: now[0], emulated=True) as recorder:
        until(lambda: recorder.status.file is not None, "a file")
        run = Run(settings, settings.world, 0, preparing="being prepared: 0 of 9")
        for cycle in range(1, CYCLES + 1):
            run.preparing = None if cycle >= begins else f"being prepared: {cycle // 10} of 9"
            found = run.cycle()
            now[0] = found.inputs.run_s
            recorder.on_cycle(found, run.state)
    assert begins < 40 or max(abs(truth.twist.v) for truth in run.truths[: begins - 1]) > 0.05
    return [found.segments for found in run.records]


@pytest.mark.parametrize(
    "kind", ["drift", *(pytest.param(kind, marks=pytest.mark.soak) for kind in ("paper", "grid", "known room"))]
)
@pytest.mark.compiled
def test_it_is_replayed_to_the_bit(kind: str, tmp_path: Path) -> None:
    """Of keyframes before it, beside it and after it; the cycle in which it begins is drawn."""
    more = {"grid": "perception.grid.method=directed", "drift": "perception.localization.correct_drift=true"}
    sets = ["recording.keyframe_period_s=0.5", "perception.method=paper", *([more[kind]] if kind in more else [])]
    settings = load_settings("hallway", sets)
    if kind == "known room":
        settings = with_known_room(settings, "hallway")
    begins = int(np.random.default_rng(len(kind)).integers(30, 90))
    path = tmp_path / "run.mcap"
    segments = record(settings, path, begins)
    assert set(segments[: begins - 1]) == {0}
    assert segments[-1] > 0
    with open_recording(path) as recording:
        result = verify_recording(recording)
        assert (result.differences, result.cycles, result.refused) == (0, CYCLES, [])
        assert result.keyframes > CYCLES // 12
        finder = KeyframeFinder(recording)
        frames = [
            frame
            for offset, chunk in recording.chunks()
            for message in chunk
            if (frame := finder.find(offset, message)) is not None
        ]
        assert min(frame.cycle for frame in frames) < begins < max(frame.cycle for frame in frames)
        # Each keyframe is the state of the replay, as verified: the first, the last, and some about the beginning.
        first = next(k for k, frame in enumerate(frames) if frame.cycle >= begins)
        last_k = len(frames) - 1
        for frame in [frames[k] for k in sorted({0, first - 2, first - 1, first, min(first + 1, last_k), last_k})]:
            replayer = Replayer(recording, frame)
            assert replayer.state is not None
            assert replayer.state.perception.recognises is (frame.cycle >= begins)
            at = replayer.checkpoint()
            assert at is not None
            last = [found for found in Replayer(recording, at) if found.message.topic in {CYCLE, KEYFRAME}]
            for found in replayer:
                if found.recorded is not None:
                    assert found.replayed == found.recorded
            assert not last or last[-1].replayed is None or last[-1].replayed == last[-1].recorded


def test_inputs_that_an_older_version_did_not_know_are_no_difference(tmp_path: Path) -> None:
    import orjson

    from tests.recorded import entries_of, rewrite

    settings = load_settings("hallway", ["perception.method=paper"])
    path, older = tmp_path / "run.mcap", tmp_path / "older.mcap"
    record(settings, path, 1)
    entries = []
    for entry in entries_of(path):
        data = orjson.loads(entry.data)
        if entry.topic == CYCLE:
            del data["record"]["inputs"]["preparing"]
        entries.append(entry._replace(data=orjson.dumps(data)) if entry.topic == CYCLE else entry)
    rewrite(entries, older)
    with open_recording(older) as recording:
        result = verify_recording(recording)
    assert (result.differences, result.cycles) == (0, CYCLES)
