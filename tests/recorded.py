"""Recordings made for tests: runs in virtual time with refinement cut short at random, recorded as a real run is."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
from mcap.writer import CompressionType, Writer

from config.load import load_settings
from config.settings import Settings
from runtime.cycle.step import State
from runtime.recording.channels import CHANNELS, CYCLE, RawMessage, schema_of
from runtime.recording.mcap_file import CHUNK_BYTES, INDEX, PROFILE
from runtime.recording.reader import open_recording
from runtime.recording.recorder import Recorder
from runtime.recording.schema import FORMAT
from runtime.recording.storage import RecordingTarget, SingleFile
from runtime.recording.verification import ReplayResult, verify_recording
from runtime.recording.writer import RecorderStatus
from runtime.simulation.closed_loop import OperatorInput, simulate

WAIT_S = 30.0
SECONDS = 12.0
"""Of the recorded run that tests share."""


def hall(*sets: str) -> Settings:
    """Return the settings of the six-drum hall, with a keyframe every two seconds."""
    return load_settings("hallway", ["recording.keyframe_period_s=2.0", *sets])


def until(done: Callable[[], bool], what: str) -> None:
    """Wait for another thread."""
    end_s = time.monotonic() + WAIT_S
    while not done():
        assert time.monotonic() < end_s, what
        time.sleep(0.001)


class FiveInSix:
    """Refuses every sixth quantum, at random."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)

    def begin(self) -> None:
        """Begin a cycle."""

    def __call__(self, _done: int) -> bool:
        """Say whether there may be another quantum."""
        return bool(self._rng.random() > 1.0 / 6.0)


def record(
    settings: Settings,
    path: Path | RecordingTarget,
    seconds: float,
    seed: int = 0,
    queue_max: int = 8192,
    reloads: Mapping[int, Settings] = MappingProxyType({}),
    operator: Callable[[int, State], OperatorInput] | None = None,
) -> RecorderStatus:
    """Record a run in virtual time in which every sixth quantum of refinement is refused for want of time."""
    world = settings.world
    assert world is not None
    now = [0.0]
    place = SingleFile(path) if isinstance(path, Path) else path
    with Recorder(settings, place, clock=lambda: now[0], queue_max=queue_max, emulated=True) as recorder:
        until(lambda: recorder.status.file is not None or recorder.status.last_error is not None, "a file")

        def on_state(record: object, state: object, _start: object) -> None:
            recorder.on_cycle(record, state)  # type: ignore[arg-type]
            for way in ("in", "out"):
                recorder.on_bytes(way, now[0], b"\x00bytes\xff")
            now[0] += 0.05

        recorder.on_log({"level": "info", "event": "start", "timestamp": "now", "why": None})

        def reload(cycle: int) -> Settings | None:
            if cycle in reloads:
                recorder.on_settings(reloads[cycle])
            return reloads.get(cycle)

        simulate(
            settings, world, seed, seconds, on_state=on_state, refinement_budget=FiveInSix(seed), reload=reload,
            operator=operator,
        )  # fmt: skip
        recorder.on_summary({"mode": "DRIVE", "cycles": 20 * seconds})
    return recorder.status


def entries_of(path: Path) -> list[RawMessage]:
    """Return every message of a recording."""
    with open_recording(path) as recording:
        return list(recording.messages())


def rewrite(
    entries: Iterator[RawMessage] | list[RawMessage], path: Path, profile: str = f"{PROFILE}/{FORMAT}"
) -> None:
    """Write messages as a recording, a chunk every ten cycles."""
    with path.open("wb") as file:
        writer = Writer(file, CHUNK_BYTES, CompressionType.ZSTD, INDEX, enable_data_crcs=True)
        writer.start(profile, "echolocate 9")
        numbers: dict[str, int] = {}
        for topic, form in CHANNELS.items():
            schema = writer.register_schema(form.__name__, "jsonschema", schema_of(form))
            numbers[topic] = writer.register_channel(topic, "json", schema)
        cycles = 0
        for entry in entries:
            writer.add_message(numbers[entry.topic], entry.log_ns, entry.data, entry.log_ns)
            cycles += entry.topic == CYCLE
            if entry.topic == CYCLE and cycles % 10 == 0:
                writer.flush()
        writer.finish()


def verify_file(path: Path, **span: float) -> ReplayResult:
    """Replay a recording that is whole, or a span of it."""
    with open_recording(path) as recording:
        result = verify_recording(recording, **span)  # type: ignore[arg-type]
        assert recording.corrupt_regions == []
    return result
