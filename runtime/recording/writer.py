"""The writing side of a recording, on a thread: encodes what the control loop has handed over and writes it to disk.

Disk errors do not reach the control loop. A full disk, a read-only folder or a slow fsync is counted and reported;
the file is closed as it is, and a new one is tried after a while.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from config.files import utf8
from config.settings import Settings
from drivers.messages import Floats
from runtime.cycle.modes import ModeState
from runtime.cycle.step import CycleRecord
from runtime.cycle.summary import object_row
from runtime.recording.channels import CYCLE, KEYFRAME, MODE, OBJECTS, RUN_INFO, SEGMENTS, SETTINGS, encode
from runtime.recording.mcap_file import McapFile
from runtime.recording.schema import (
    Bookmark,
    BookmarkWithdrawn,
    Cycle,
    MapChange,
    ModeChange,
    ObjectList,
    Payload,
    RunInfo,
    SerialBytes,
    SettingsChange,
    StateFields,
    keyframe,
)
from runtime.recording.storage import RecordingTarget
from runtime.support.background_writer import BackgroundWriter

QUEUE_MAX: Final = 8192
"""Items that may wait: about a minute and a half of a stalled disk."""
POLL_S: Final = 0.3
"""Longest interval at which the thread looks for items: for a run without cycles, which otherwise wake it."""
FLUSH_S: Final = 0.5
"""A chunk ends at the first look after this time. With the poll this is what a killed process loses."""
SYNC_S: Final = 1.0
RETRY_S: Final = 10.0
"""Wait after a disk error before the next file is tried."""
CLOSE_MAX_S: Final = 10.0
"""Longest wait for the disk at the end of a run."""
SWITCH_INTERVAL_S: Final = 0.0005
"""Longest wait of the control loop for the interpreter while this thread encodes."""
SEGMENT_DIGITS: Final = 3
"""Decimals of a segment's coordinates: a millimetre is a thirtieth of the ring's resolution."""
OBJECT_DIGITS: Final = 6

QueuedItem: TypeAlias = tuple[str, float, float, Any]
"""Something to record: its topic, when it happened by the host's clock and by the run's (s), and what it is.

Nothing in it may change any more. A plain tuple, because the cycle makes several.
"""


class SettingsReload(NamedTuple):
    """Settings in force from a cycle on."""

    cycle: int
    settings: Settings


class RecordingSwitch(NamedTuple):
    """Recording is switched on or off from here on."""

    on: bool


class MapSnapshot(NamedTuple):
    """The map or the objects as a cycle left them; for a keyframe both, and the whole state."""

    cycle: int
    segments: Floats | None = None
    """(n, 5): ends x, y, x, y (m) and normal (rad)."""
    objects: tuple[Any, ...] | None = None
    state: StateFields | None = None
    perception: dict[str, Any] | None = None
    """Perception's arrays by name."""


@dataclass(frozen=True, slots=True)
class RecorderStatus:
    """State of a recording, or of a ring log."""

    file: str | None = None
    files: int = 0
    bytes: int = 0
    """In all files together."""
    messages: int = 0
    dropped: int = 0
    """Items not written: the queue was full, no file could be written, or a file failed before it was flushed."""
    last_error: str | None = None
    """The last trouble with the disk."""
    sync_max_s: float = 0.0
    """The longest time the disk took to confirm."""
    is_writing: bool = False
    """Whether a file is open."""
    notice: str | None = None
    """What a person should know about the storage: which recording goes next."""


class RecordingWriter:
    """A recording and the thread that writes it.

    Parameters
    ----------
    info : RunInfo
        The first message of each file.
    host_clock : callable
        The host's clock of the run, s, for the log time of `info`.
    on : bool
        Whether to record from the start.
    """

    def __init__(
        self,
        target: RecordingTarget,
        info: RunInfo,
        host_clock: Callable[[], float] = time.monotonic,
        queue_max: int = QUEUE_MAX,
        *,
        on: bool = True,
    ) -> None:
        self.wants_keyframe = False
        """A keyframe is needed to continue a replay: the file is new, or messages are missing."""
        self._status = RecorderStatus()
        self._target = target
        self._info = info
        self._host_clock = host_clock
        self._file: McapFile | None = None  # none while recording is off, and from an error to the next keyframe
        self._parts = 0
        self._on = on
        self._retry_s = self._flushed_s = self._synced_s = self._limited_s = 0.0  # not before; when last
        self._bytes_before = 0  # in all files before this one
        self._unflushed = 0  # messages that an error would lose
        self._is_empty = True  # no cycle and no bookmark so far
        self._have_pinned: list[bool] = []
        """Of each bookmark of the file that stands, whether it pinned it."""
        self._mode: ModeState | None = None  # of the last cycle in this file
        self._map: dict[bytes, int] = {}  # number of each segment in the file's map, by its bytes
        self._map_count = 0  # numbers given so far
        self._pieces: dict[str, list[QueuedItem]] = {}  # bytes of the line since the last flush, by topic
        self.thread = BackgroundWriter[QueuedItem](
            "recorder", self._write, begin=self._begin, tick=self._tick, finish=lambda: self._guarded(self._finish),
            poll_s=POLL_S, capacity=queue_max, close_max_s=CLOSE_MAX_S,
        )  # fmt: skip
        self._interval_s = sys.getswitchinterval()

    def start(self) -> None:
        """Start the thread."""
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        self.thread.start()

    def stop(self) -> None:
        """Write what is queued and end the thread, unless the disk takes too long."""
        self.thread.close()
        sys.setswitchinterval(self._interval_s)
        if self.thread.is_stuck:
            error = f"the end of {self._status.file} was not written within {CLOSE_MAX_S:.0f} s: check the disk"
            self._status = replace(self._status, last_error=error)
        elif self._file is not None:
            self._abandon(f"{self._status.file}: its writer failed: {self.thread.failure}")

    @property
    def status(self) -> RecorderStatus:
        """The state of the recording."""
        return replace(self._status, dropped=self._status.dropped + self.thread.lost)

    @property
    def last_error(self) -> str | None:
        """As in `status`, at a fraction of its cost: asked after every cycle."""
        return self._status.last_error

    @property
    def notice(self) -> str | None:
        """As in `status`, for the same reason."""
        return self._status.notice

    def _drop(self, count: int) -> None:
        self._status = replace(self._status, dropped=self._status.dropped + count)

    def _begin(self) -> None:
        self._flushed_s = self._synced_s = self._limited_s = time.monotonic()
        if self._on:
            self._guarded(self._open)

    def _write(self, item: QueuedItem) -> None:
        self._guarded(lambda: self._enter(item))

    def _tick(self) -> None:
        """Flush, sync and keep the limits of the folder, each when its time has come."""
        host_s = time.monotonic()
        if host_s - self._flushed_s >= FLUSH_S:
            self._guarded(self._flush)
            self._flushed_s = host_s
        if host_s - self._synced_s >= SYNC_S:
            self._guarded(self._sync)
            self._synced_s = time.monotonic()
        if host_s - self._limited_s >= RETRY_S and self._file is not None:
            path = self._file.path
            self._guarded(lambda: self._enforce_limits(path))
            self._limited_s = host_s

    def _guarded(self, act: Callable[[], None]) -> None:
        """Do something with the disk; if it fails, abandon the file and try a new one later."""
        try:
            act()
        except OSError as error:
            where = self._status.file if self._file is not None else error.filename or self._target.place
            self._abandon(f"{where}: {error.strerror or error}")

    def _abandon(self, error: str) -> None:
        """Close the file as it is, count what is lost with it, and try another one after `RETRY_S`."""
        if self._file is not None:
            self._file.abandon()
        self._file = None
        self._drop(self._unflushed + sum(map(len, self._pieces.values())))
        self._unflushed = 0
        self._pieces.clear()  # they belong between the cycles of this file, not into the next one
        self._retry_s = time.monotonic() + RETRY_S
        self._status = replace(self._status, last_error=utf8(error), is_writing=False)

    def _open(self) -> None:
        """Begin the next file."""
        self._parts += 1
        self._info = self._info.model_copy(update={"part": self._parts})
        log_ns = self._log_ns(self._host_clock())
        self._file = McapFile(self._target.begin_part(self._parts), encode(self._info), log_ns)
        self._bytes_before = self._status.bytes
        self._mode = None
        path, files = utf8(str(self._file.path)), self._status.files + 1
        self._status = replace(self._status, file=path, files=files, is_writing=True)
        self._is_empty = True
        self._have_pinned = []
        self._enforce_limits(self._file.path)

    def _finish(self) -> None:
        """Close the file, if one is open, with everything that belongs into it."""
        if self._file is not None:
            self._enter_pieces()
            file, self._file = self._file, None
            try:
                file.finish()
                size = self._bytes_before + file.path.stat().st_size
                self._status = replace(self._status, bytes=size, is_writing=False)
                self._unflushed = 0
                self._enforce_limits(file.path)
            except OSError as error:
                self._abandon(f"{file.path}: {error.strerror or error}")

    def _enforce_limits(self, current: Path) -> None:
        self._status = replace(self._status, notice=self._target.enforce_limits(current))

    def _switch_off(self) -> None:
        """Close the file; remove it if nothing happened in it, or else switching often would displace recordings."""
        path, is_empty = None if self._file is None else self._file.path, self._is_empty
        self._finish()
        if path is not None and is_empty and self._target.remove_empty(path):
            self._status = replace(self._status, file=None, files=self._status.files - 1, bytes=self._bytes_before)

    def _flush(self) -> None:
        """End the chunk; ask for a keyframe if the next file is due, as one begins with it."""
        if self._file is not None:
            self._enter_pieces()
            self._file.flush()
            self._unflushed = 0
            self._status = replace(self._status, bytes=self._bytes_before + self._file.bytes)
            if self._target.is_part_full(self._file.bytes):
                self.wants_keyframe = True
        elif self._on and time.monotonic() >= self._retry_s:
            self.wants_keyframe = True

    def _sync(self) -> None:
        """Wait until the disk has the file; keep the longest time that this took."""
        if self._file is not None:
            started_s = time.monotonic()
            self._file.sync()
            took_s = time.monotonic() - started_s
            if took_s > self._status.sync_max_s:
                self._status = replace(self._status, sync_max_s=took_s)

    def _enter(self, item: QueuedItem) -> None:
        """Write one item; at a keyframe a new file can begin."""
        topic, host_s, run_s, content = item
        if isinstance(content, RecordingSwitch):
            self._on, self._retry_s = content.on, 0.0
            if not self._on:
                self._switch_off()
            return
        if topic == KEYFRAME:
            if self._file is not None and self._target.is_part_full(self._file.bytes):
                self._finish()
            if self._file is None and time.monotonic() >= self._retry_s:
                self._open()
        if topic == SETTINGS:
            self._info = self._info.model_copy(update={"settings": content.settings.model_dump(mode="json")})
        if self._file is None:
            self._drop(int(self._on))
            return
        log_ns = self._log_ns(host_s)
        match content:
            case CycleRecord():
                self._enter_cycle(content, log_ns)
            case MapSnapshot():
                self._enter_snapshot(content, run_s, log_ns)
            case Bookmark():
                self._is_empty = False
                self._have_pinned.append(self._target.pin(self._file.path))
                self._add(topic, content, log_ns)
            case BookmarkWithdrawn():
                if self._have_pinned:
                    self._add(topic, content, log_ns)
                    if self._have_pinned.pop():
                        self._target.unpin(self._file.path)
            case SettingsReload(cycle, _):
                change = SettingsChange.model_construct(run_s=run_s, cycle=cycle, settings=self._info.settings)
                self._add(SETTINGS, change, log_ns)
            case bytes():
                self._pieces.setdefault(topic, []).append(item)
            case _:
                self._add(topic, content, log_ns)

    def _enter_pieces(self) -> None:
        """Write the serial line's data since the last call."""
        for topic, pieces in self._pieces.items():
            _, first_host_s, first_run_s, _ = pieces[0]
            payload = SerialBytes.model_construct(
                run_s=first_run_s,
                after_us=[round(1e6 * (run_s - first_run_s)) for _, _, run_s, _ in pieces],
                sizes=[len(data) for *_, data in pieces],
                data=b"".join(data for *_, data in pieces).hex(),
            )
            self._add(topic, payload, self._log_ns(first_host_s))
        self._pieces.clear()

    def _log_ns(self, host_s: float) -> int:
        """Return the Unix time of a moment of the host's clock."""
        return self._info.unix_minus_host_ns + round(1e9 * host_s)

    def _enter_cycle(self, record: CycleRecord, log_ns: int) -> None:
        """Write a cycle, and the mode if it changed."""
        self._is_empty = False
        self._add(CYCLE, Cycle.model_construct(record=record), log_ns, record.cycle)
        if record.mode != self._mode:
            self._mode = record.mode
            change = ModeChange.model_construct(run_s=record.inputs.run_s, cycle=record.cycle, mode=record.mode)
            self._add(MODE, change, log_ns)

    def _enter_snapshot(self, snapshot: MapSnapshot, run_s: float, log_ns: int) -> None:
        """Write what a snapshot has of keyframe, map and objects."""
        cycle = snapshot.cycle
        if snapshot.state is not None and snapshot.perception is not None:
            self._add(RUN_INFO, self._info, log_ns)
            self._add(KEYFRAME, keyframe(cycle, run_s, snapshot.state, snapshot.perception), log_ns, cycle)
        if snapshot.segments is not None:
            self._add(SEGMENTS, self._map_change(snapshot, snapshot.segments, run_s), log_ns)
        if snapshot.objects is not None:
            rows = [_rounded(dict(object_row(seen))) for seen in snapshot.objects]
            self._add(OBJECTS, ObjectList.model_construct(run_s=run_s, cycle=cycle, objects=rows), log_ns)

    def _map_change(self, snapshot: MapSnapshot, segments: Floats, run_s: float) -> MapChange:
        """Return the changes since the last snapshot of the map; with a keyframe, the whole map."""
        whole = snapshot.perception is not None
        if whole:
            self._map = {}
        rows = np.round(segments, SEGMENT_DIGITS)
        current = {row.tobytes(): row for row in rows}
        removed = [self._map.pop(key) for key in [key for key in self._map if key not in current]]
        added = [key for key in current if key not in self._map]
        first, self._map_count = self._map_count, self._map_count + len(added)
        self._map.update(zip(added, range(first, self._map_count), strict=True))
        return MapChange.model_construct(
            run_s=run_s, cycle=snapshot.cycle, whole=whole, first=first,
            added=[tuple(current[key].tolist()) for key in added], removed=removed,
        )  # fmt: skip

    def _add(self, topic: str, payload: Payload, log_ns: int, sequence: int = 0) -> None:
        if self._file is not None:
            self._unflushed += 1
            self._file.add(topic, encode(payload), log_ns, sequence)
            self._status = replace(self._status, messages=self._status.messages + 1)


def _rounded(row: dict[str, Any]) -> dict[str, Any]:
    """Return an object's row rounded for reading; a replay gives every digit."""
    return {k: round(v, OBJECT_DIGITS) if isinstance(v, float) else v for k, v in row.items() if k != "covariance"}
