"""The recorder's thread: takes what the loop has handed over, encodes it, and sees to the disk.

Whatever the disk does stays here. A full disk, a folder that cannot be written, an fsync that takes seconds: it is
counted and told, a file that fails is left as far as it came, and another is tried after a while.
"""

from __future__ import annotations

import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from config.settings import Settings
from drivers.messages import Floats
from runtime.cycle.modes import ModeState
from runtime.cycle.step import CycleRecord
from runtime.cycle.summary import object_row
from runtime.recording.channels import CYCLE, KEYFRAME, MODE, OBJECTS, RUN_INFO, SEGMENTS, SETTINGS, encode
from runtime.recording.mcap_file import McapFile
from runtime.recording.schema import (
    Cycle,
    MapChange,
    ModeChange,
    ObjectsSeen,
    Payload,
    RunInfo,
    SerialBytes,
    SettingsChange,
    StateFields,
    keyframe,
)
from runtime.recording.storage import RecordingTarget
from runtime.support.health import Worker

QUEUE_MAX: Final = 8192
"""Handed over and not yet taken, at most: a minute and a half of a disk that does nothing."""
POLL_S: Final = 0.05
FLUSH_S: Final = 0.6
"""A chunk ends this long after the last one: with the poll, what a killed process loses."""
SYNC_S: Final = 1.0
RETRY_S: Final = 10.0
"""After trouble with the disk the next file is tried this much later."""
CLOSE_MAX_S: Final = 10.0
"""So long the end of a run waits for the disk."""
BATCH: Final = 256
BREATH_S: Final = 0.002
"""Between batches of a backlog the interpreter belongs to the loop."""
SWITCH_INTERVAL_S: Final = 0.0005
"""While this thread encodes, the loop waits for the interpreter this long at most."""
DIGITS: Final = 3
"""Of a segment's coordinates: a millimetre is a thirtieth of what the ring resolves."""
OBJECT_DIGITS: Final = 6


class Item(NamedTuple):
    """Something handed over: nothing in it changes any more."""

    topic: str
    host_s: float
    what: Any


class Reloaded(NamedTuple):
    """Settings that are in force from a cycle on."""

    cycle: int
    settings: Settings


class Switch(NamedTuple):
    """From here on a recording is wanted, or none is."""

    on: bool


class MapSnapshot(NamedTuple):
    """The map, or the objects, as a cycle left them; for a keyframe both and everything else."""

    cycle: int
    segments: Floats | None = None
    objects: tuple[Any, ...] | None = None
    left: StateFields | None = None
    memory: dict[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class RecorderStatus:
    """How the recording stands."""

    file: str | None = None
    files: int = 0
    bytes: int = 0
    """In all files."""
    messages: int = 0
    dropped: int = 0
    """Handed over while the queue was full or no file could be written, or not yet in a file when it failed."""
    last_error: str | None = None
    """The last one with the disk."""
    sync_max_s: float = 0.0
    """The longest that the disk took to confirm."""
    is_writing: bool = False
    """Whether the file is being written."""


class RecordingWriter:
    """A thread that writes a recording.

    Parameters
    ----------
    place : RecordingTarget
        Where its files go.
    info : RunInfo
        What stands at the beginning of each.
    clock : callable
        Monotonic, s: the thread's own pace.
    on : bool
        Whether a recording is wanted from the beginning.
    """

    def __init__(
        self, place: RecordingTarget, info: RunInfo, clock: Callable[[], float] = time.monotonic, *, on: bool = True
    ) -> None:
        self.queue: deque[Item] = deque()
        self.wants_keyframe = False
        """A file has begun, or something is missing: without a keyframe no replay could go on."""
        self.status = RecorderStatus()
        self._place = place
        self._info = info
        self._clock = clock
        self._part: McapFile | None = None
        self._parts = 0
        self._on = on
        self._retry_s = 0.0
        self._before = 0
        self._unflushed = 0
        self._mode: ModeState | None = None
        self._map: dict[bytes, int] = {}
        self._numbered = 0
        self._pieces: dict[str, list[tuple[float, bytes]]] = {}
        self._ending = threading.Event()
        self._thread = Worker("recorder", self._work)
        self._interval_s = sys.getswitchinterval()

    def start(self) -> None:
        """Begin."""
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        self._thread.start()

    def stop(self) -> None:
        """Write what is left and end, unless the disk takes too long."""
        self._ending.set()
        self._thread.join(CLOSE_MAX_S)
        sys.setswitchinterval(self._interval_s)
        if self._thread.is_alive():
            why = f"the disk did not take the end of {self.status.file} within {CLOSE_MAX_S:.0f} s"
            self.status = replace(self.status, last_error=why)
        elif self._part is not None:
            self._leave(f"{self.status.file}: its writer failed: {self._thread.failure}")

    def probe(self) -> str | None:
        """Say how the thread ended; None while it runs. See `runtime.support.health`."""
        return self._thread.probe()

    def drop(self, count: int = 1) -> None:
        """Count what is not written."""
        self.status = replace(self.status, dropped=self.status.dropped + count)

    def _work(self) -> None:
        flushed_s = synced_s = tidied_s = self._clock()
        if self._on:
            self._guarded(self._open)
        ending = False
        while not (ending and not self.queue):
            ending = self._ending.wait(POLL_S if len(self.queue) < BATCH else BREATH_S)
            for _ in range(min(BATCH, len(self.queue))):
                item = self.queue.popleft()
                self._guarded(lambda item=item: self._enter(item))  # type: ignore[misc]
            now_s = self._clock()
            if now_s - flushed_s >= FLUSH_S:
                self._guarded(self._flush)
                flushed_s = now_s
            if now_s - synced_s >= SYNC_S:
                self._guarded(self._sync)
                synced_s = self._clock()
            if now_s - tidied_s >= RETRY_S and self._part is not None:
                self._guarded(lambda: self._place.enforce_limits(self._current()))
                tidied_s = now_s
        self._guarded(self._finish)

    def _guarded(self, work: Callable[[], None]) -> None:
        """Do something with the disk; where it fails, leave the file and try the next one later."""
        try:
            work()
        except OSError as error:
            where = self.status.file if self._part is not None else str(error.filename)
            self._leave(f"{where}: {error.strerror or error}")

    def _leave(self, why: str) -> None:
        if self._part is not None:
            self._part.abandon()
        self._part = None
        self.drop(self._unflushed)
        self._unflushed = 0
        self._retry_s = self._clock() + RETRY_S
        self.status = replace(self.status, last_error=why, is_writing=False)

    def _current(self) -> Path:
        return Path() if self._part is None else self._part.path

    def _open(self) -> None:
        self._parts += 1
        info = self._info.model_copy(update={"part": self._parts})
        self._info = info
        host_ns = time.time_ns()
        self._part = McapFile(self._place.path(self._parts), encode(info), host_ns)
        self._before = self.status.bytes
        self._mode = None
        path, files = str(self._part.path), self.status.files + 1
        self.status = replace(self.status, file=path, files=files, is_writing=True)

    def _finish(self) -> None:
        if self._part is not None:
            self._enter_pieces()
            part, self._part = self._part, None
            try:
                part.finish()
                size = self._before + part.path.stat().st_size
                self.status = replace(self.status, bytes=size, is_writing=False)
                self._unflushed = 0
            except OSError as error:
                self._leave(f"{part.path}: {error.strerror or error}")

    def _flush(self) -> None:
        if self._part is not None:
            self._enter_pieces()
            self._part.flush()
            self._unflushed = 0
            self.status = replace(self.status, bytes=self._before + self._part.bytes)
            if self._place.is_part_full(self._part.bytes):
                self.wants_keyframe = True
        elif self._on and self._clock() >= self._retry_s:
            self.wants_keyframe = True

    def _sync(self) -> None:
        if self._part is not None:
            began_s = self._clock()
            self._part.sync()
            took_s = self._clock() - began_s
            if took_s > self.status.sync_max_s:
                self.status = replace(self.status, sync_max_s=took_s)

    def _enter(self, item: Item) -> None:
        """Write one item; with a keyframe the next file can begin."""
        if isinstance(item.what, Switch):
            self._on, self._retry_s = item.what.on, 0.0
            if not self._on:
                self._finish()
            return
        if item.topic == KEYFRAME:
            if self._part is not None and self._place.is_part_full(self._part.bytes):
                self._finish()
            if self._part is None and self._clock() >= self._retry_s:
                self._open()
        if item.topic == SETTINGS:
            settings = item.what.settings.model_dump(mode="json")
            self._info = self._info.model_copy(update={"settings": settings})
        if self._part is None:
            self.drop(int(self._on))
            return
        log_ns = self._log_ns(item.host_s)
        match item.what:
            case CycleRecord():
                self._enter_cycle(item.what, log_ns)
            case MapSnapshot():
                self._enter_moment(item.what, log_ns)
            case Reloaded(cycle, _):
                change = SettingsChange.model_construct(cycle=cycle, settings=self._info.settings)
                self._add(SETTINGS, change, log_ns)
            case bytes():
                self._pieces.setdefault(item.topic, []).append((item.host_s, item.what))
            case _:
                self._add(item.topic, item.what, log_ns)

    def _enter_pieces(self) -> None:
        """Write what went over the line since the last time."""
        for topic, pieces in self._pieces.items():
            first_s = pieces[0][0]
            form = SerialBytes.model_construct(
                host_s=first_s, after_us=[round(1e6 * (t_s - first_s)) for t_s, _ in pieces],
                sizes=[len(data) for _, data in pieces], data=b"".join(data for _, data in pieces).hex(),
            )  # fmt: skip
            self._add(topic, form, self._log_ns(first_s))
        self._pieces.clear()

    def _log_ns(self, host_s: float) -> int:
        return self._info.unix_minus_host_ns + round(1e9 * host_s)

    def _enter_cycle(self, record: CycleRecord, log_ns: int) -> None:
        self._add(CYCLE, Cycle.model_construct(record=record), log_ns, record.cycle)
        if record.mode != self._mode:
            self._mode = record.mode
            self._add(MODE, ModeChange.model_construct(cycle=record.cycle, mode=record.mode), log_ns)

    def _enter_moment(self, moment: MapSnapshot, log_ns: int) -> None:
        if moment.left is not None and moment.memory is not None:
            self._add(RUN_INFO, self._info, log_ns)
            self._add(KEYFRAME, keyframe(moment.cycle, moment.left, moment.memory), log_ns, moment.cycle)
        if moment.segments is not None:
            self._add(SEGMENTS, self._map_change(moment, moment.segments), log_ns)
        if moment.objects is not None:
            rows = [_rounded(dict(object_row(seen))) for seen in moment.objects]
            self._add(OBJECTS, ObjectsSeen.model_construct(cycle=moment.cycle, objects=rows), log_ns)

    def _map_change(self, moment: MapSnapshot, segments: Floats) -> MapChange:
        """Return what has come and gone since the last moment; a keyframe tells the whole map."""
        whole = moment.memory is not None
        if whole:
            self._map = {}
        rows = np.round(segments, DIGITS)
        now = {row.tobytes(): row for row in rows}
        removed = [self._map.pop(key) for key in [key for key in self._map if key not in now]]
        fresh = [key for key in now if key not in self._map]
        first, self._numbered = self._numbered, self._numbered + len(fresh)
        self._map.update(zip(fresh, range(first, self._numbered), strict=True))
        return MapChange.model_construct(
            cycle=moment.cycle, whole=whole, first=first, added=[tuple(now[key].tolist()) for key in fresh],
            removed=removed,
        )  # fmt: skip

    def _add(self, topic: str, form: Payload, log_ns: int, sequence: int = 0) -> None:
        if self._part is not None:
            self._unflushed += 1
            self._part.add(topic, encode(form), log_ns, sequence)
            self.status = replace(self.status, messages=self.status.messages + 1)


def _rounded(row: dict[str, Any]) -> dict[str, Any]:
    """Return an object's row for the eye; replaying gives every digit."""
    return {k: round(v, OBJECT_DIGITS) if isinstance(v, float) else v for k, v in row.items() if k != "covariance"}
