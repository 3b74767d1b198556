"""Recordings for tests: runs in virtual time, recorded as a real run is, with refinement ended early at random."""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from unittest import mock

import numpy as np
import orjson
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from config.load import load_settings
from config.settings import Settings
from drivers.messages import Pose
from runtime.cycle.inputs import OperatorInput
from runtime.cycle.preparation import fresh_state
from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import CHANNELS, CYCLE, KEYFRAME, RawMessage, decode, encode, schema_of
from runtime.recording.mcap_file import CHUNK_BYTES, PROFILE
from runtime.recording.mcap_scanner import McapScanner
from runtime.recording.reader import cycle_head, open_recording
from runtime.recording.recorder import Recorder
from runtime.recording.schema import FORMAT, Keyframe, keyframe, perception_snapshot, state_fields
from runtime.recording.storage import RecordingTarget, SingleFile
from runtime.recording.verification import ReplayResult, verify_recording
from runtime.recording.writer import RecorderStatus
from runtime.simulation.closed_loop import SimulationOptions, simulate
from tests.hil.machine import TIMEOUT_S

SECONDS = 12.0
"""Length of the recorded run that tests share, s."""


def hall(*sets: str) -> Settings:
    """Return the settings of the six-drum hall, with a keyframe every two seconds."""
    return load_settings("hallway", ["recording.keyframe_period_s=2.0", *sets])


def until(done: Callable[[], bool], what: str) -> None:
    """Wait until a condition holds that another thread makes true."""
    end_s = time.monotonic() + TIMEOUT_S
    while not done():
        assert time.monotonic() < end_s, what
        time.sleep(0.001)


class FiveInSix:
    """A refinement budget that refuses every sixth quantum, at random, or another share."""

    def __init__(self, seed: int, refused: float = 1.0 / 6.0) -> None:
        self._rng = np.random.default_rng(seed)
        self._refused = refused

    def begin(self) -> None:
        """Begin a cycle."""

    def __call__(self, _done: int) -> bool:
        """Return whether another quantum may begin."""
        return bool(self._rng.random() > self._refused)


def record(
    settings: Settings,
    path: Path | RecordingTarget,
    seconds: float,
    seed: int = 0,
    queue_max: int = 8192,
    reloads: Mapping[int, Settings] = MappingProxyType({}),
    operator: Callable[[int, State], OperatorInput] | None = None,
    after: Mapping[int, Callable[[Recorder], None]] = MappingProxyType({}),
    *,
    on: bool = True,
    refused: float = 1.0 / 6.0,
) -> RecorderStatus:
    """Record a run in virtual time in which every sixth quantum of refinement is refused; return the final status.

    A busy machine may take long to write the end of the file: it has a minute for that.

    Parameters
    ----------
    settings
        Settings of the run, with a world.
    path
        The file or folder of the recording.
    seconds
        Length of the run, s of virtual time.
    seed
        Of the emulator, and of the refused quanta.
    queue_max
        Capacity of the recorder's queue.
    reloads
        Settings to put in force, by cycle.
    operator
        The operator's input in every cycle.
    after
        Actions on the recorder, by the cycle that they follow.
    on
        Whether to record from the start.
    refused
        Share of the quanta that are refused; each ends a cycle's refinement.
    """
    world = settings.world
    assert world is not None
    now = [0.0]
    place = SingleFile(path) if isinstance(path, Path) else path
    with (
        mock.patch("runtime.recording.writer.CLOSE_MAX_S", TIMEOUT_S),
        Recorder(settings, place, clock=lambda: now[0], queue_max=queue_max, emulated=True, on=on) as recorder,
    ):
        until(lambda: not on or recorder.status.file is not None or recorder.status.last_error is not None, "a file")

        def on_state(record: CycleRecord, state: State, _start: Pose) -> None:
            recorder.on_cycle(record, state)
            for way in ("in", "out"):
                recorder.on_bytes(way, now[0], now[0], b"\x00bytes\xff")
            now[0] += 0.05
            if record.cycle in after:
                after[record.cycle](recorder)

        recorder.on_log({"level": "info", "event": "start", "timestamp": "now", "why": None})

        def reload(cycle: int) -> Settings | None:
            if cycle in reloads:
                recorder.on_settings(reloads[cycle])
            return reloads.get(cycle)

        simulate(
            settings,
            world,
            seed,
            seconds,
            on_state=on_state,
            operator=operator,
            options=SimulationOptions(refinement_budget=FiveInSix(seed, refused), reload=reload),
        )
        recorder.on_summary({"mode": "DRIVE", "cycles": 20 * seconds})
    return recorder.status


def entries_of(path: Path) -> list[RawMessage]:
    """Return every message of a recording."""
    with open_recording(path) as recording:
        return list(recording.messages())


def scanned(data: bytes) -> tuple[list[list[RawMessage]], McapScanner]:
    """Return every readable chunk, and the scanner."""
    scanner = McapScanner(memoryview(data))
    return list(scanner.chunks()), scanner


def chunks_at(data: bytes) -> list[tuple[int, int]]:
    """Return where each chunk begins and ends in the file, as the stock reader finds them."""
    file, found, begin = io.BytesIO(data), [], 0
    for entry in StreamReader(file, emit_chunks=True).records:
        if isinstance(entry, Chunk):
            end = file.tell()
            begin = end - len(entry.data) - 44 - 9
            found.append((begin, end))
    return found


def rewrite(
    entries: Iterator[RawMessage] | list[RawMessage], path: Path, profile: str = f"{PROFILE}/{FORMAT}"
) -> None:
    """Write messages as a recording, a chunk every ten cycles."""
    with path.open("wb") as file:
        writer = Writer(file, CHUNK_BYTES, CompressionType.ZSTD, enable_data_crcs=True)
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


def write_with_gap(source: Path, path: Path, cycle: int, gap_s: float) -> None:
    """Write a recording in which the cycles after one are later by `gap_s` s of the run."""
    entries = entries_of(source)
    for k, entry in enumerate(entries):
        if entry.topic == CYCLE and cycle_head(entry)[0] > cycle:
            found = orjson.loads(entry.data)
            found["record"]["inputs"]["run_s"] += gap_s
            entries[k] = entry._replace(data=orjson.dumps(found))
    rewrite(entries, path)


def spoil(source: Path, path: Path, spoiled: Collection[int], lost: Collection[int] = ()) -> list[int]:
    """Write a recording with a number out of its bound in some keyframes, counted from 0, and without some cycles.

    Return the cycles of all keyframes.
    """
    entries, cycles = [], list[int]()
    with open_recording(source) as recording:
        layout = fresh_state(recording.settings).perception.snapshot()
    for entry in entries_of(source):
        kept = entry
        if entry.topic == KEYFRAME:
            frame = decode(Keyframe, entry.data)
            if len(cycles) in spoiled:
                wrong = perception_snapshot(frame, layout) | {"canyon_map.firings": np.array(-7)}
                kept = entry._replace(data=encode(keyframe(frame.cycle, frame.run_s, state_fields(frame), wrong)))
            cycles.append(frame.cycle)
        if entry.topic != CYCLE or cycle_head(entry)[0] not in lost:
            entries.append(kept)
    rewrite(entries, path)
    return cycles


def verify_file(path: Path, **span: float) -> ReplayResult:
    """Verify a recording without corrupt regions, or a span of it."""
    with open_recording(path) as recording:
        result = verify_recording(recording, **span)  # type: ignore[arg-type]
        assert recording.corrupt_regions == []
    return result
