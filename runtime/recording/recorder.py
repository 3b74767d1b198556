"""The recorder: the control loop's side of a recording, which queues each cycle's data for the writer's thread.

Queueing is an append. Copies are made less often: the map once a second, the objects half a second later, and the
whole state, as a keyframe, rarely. The cycle's command is sent before any of this.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any, Final

from llvmlite.binding import get_host_cpu_name

from config.errors import UserError
from config.settings import Settings
from runtime import VERSION
from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import (
    BOOKMARK,
    BOOKMARK_WITHDRAWN,
    CYCLE,
    KEYFRAME,
    LOG,
    OBJECTS,
    SEGMENTS,
    SERIAL,
    SETTINGS,
    SUMMARY,
)
from runtime.recording.schema import FORMAT, Bookmark, BookmarkWithdrawn, LogLine, RunEnd, RunInfo, carried_state
from runtime.recording.storage import RecordingTarget
from runtime.recording.writer import (
    QUEUE_MAX,
    MapSnapshot,
    QueuedItem,
    RecorderStatus,
    RecordingSwitch,
    RecordingWriter,
    SettingsReload,
)
from runtime.support.kernel_cache import is_interpreted, kernels_key
from runtime.support.log_sentence import field_text
from runtime.timing.run_clock import RunClock, run_clock

WRITE_S: Final = 0.2
"""Interval at which a cycle wakes the thread that writes, s: it works while the loop sleeps, and on warm caches."""
SNAPSHOT_S: Final = 1.0
"""Interval at which changes of the map, and the objects, are recorded."""
BOOKMARK_MAX: Final = 500
"""Characters in a bookmark."""


def software_versions() -> dict[str, str]:
    """Return what the last bit of a result may depend on besides its inputs: versions, kernels and processor."""
    return {
        "echolocate": VERSION,
        "python": platform.python_version(),
        "numpy": version("numpy"),
        "numba": version("numba"),
        "kernels": kernels_key(),
        "compiled": "no" if is_interpreted() else "yes",
        "processor": f"{platform.machine()} {get_host_cpu_name()}",
    }


def run_info(settings: Settings, host_clock: Callable[[], float], *, emulated: bool) -> RunInfo:
    """Return the first message of a recording that starts now.

    Parameters
    ----------
    settings : Settings
        The run's.
    host_clock : callable
        The host's monotonic clock, s. Its difference to Unix time is fixed here, for all log times.
    emulated : bool
        Whether the settings' world is the true one.
    """
    return RunInfo(
        format=FORMAT,
        settings=settings.model_dump(mode="json"),
        versions=software_versions(),
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        unix_minus_host_ns=time.time_ns() - round(1e9 * host_clock()),
        part=1,
        emulated=emulated,
    )


class Recorder:
    """Records everything that a run does. As a context manager it starts and stops the writing.

    Log times are Unix times: the host's clock at that moment plus the difference at the start, whatever the run's
    clock does. Messages hold the run's time.

    Parameters
    ----------
    settings : Settings
        The run's.
    target : RecordingTarget
        Where the recording is written.
    clock : RunClock or callable
        The run's clock, which also reads the host's; any other monotonic clock (s) serves as both.
    queue_max : int
        Items that may wait; what does not fit is dropped and counted.
    emulated : bool
        Whether the settings' world is the true one.
    on : bool
        Whether to record from the start; `set_enabled` changes it.
    """

    def __init__(
        self,
        settings: Settings,
        target: RecordingTarget,
        clock: RunClock | Callable[[], float] = time.monotonic,
        queue_max: int = QUEUE_MAX,
        *,
        emulated: bool = False,
        on: bool = True,
    ) -> None:
        self._clock = run_clock(clock)
        self._snapshot_cycles = max(1, round(SNAPSHOT_S * settings.cycle.rate_hz))
        self._write_cycles = max(1, round(WRITE_S * settings.cycle.rate_hz))
        self._keyframe_s = settings.recording.keyframe_period_s
        info = run_info(settings, self._clock.host, emulated=emulated)
        self._writer = RecordingWriter(target, info, self._clock.host, queue_max, on=on)
        self._queue_item = self._writer.thread.put
        self._on = on
        self._is_starting = False
        """Whether recording was switched on and no cycle has ended since."""
        self._last_keyframe_run_s: float | None = None
        """When the last keyframe was queued; None before the first cycle."""
        self._has_gap = False
        """Whether a cycle was lost since: a keyframe is due."""
        self._cycle = 0
        """Number of the last cycle."""
        self._bookmarks: list[tuple[str | None, str]] = []
        """File and text of each that stands."""

    def __enter__(self) -> Recorder:
        self._writer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.stop()

    @property
    def status(self) -> RecorderStatus:
        """The state of the recording."""
        return self._writer.status

    @property
    def last_error(self) -> str | None:
        """The last trouble with the disk, None if there was none."""
        return self._writer.last_error

    @property
    def notice(self) -> str | None:
        """Which recording goes next, None while there is room."""
        return self._writer.notice

    def probe(self) -> str | None:
        """Return how its thread ended; None while it runs. See `runtime.support.health`."""
        return self._writer.thread.probe()

    @property
    def is_enabled(self) -> bool:
        """Whether recording is switched on."""
        return self._on

    def set_enabled(self, *, on: bool) -> None:
        """Begin another file with the next cycle, or end the current one. Does nothing if it is so already."""
        if on == self._on:
            return
        self._on = self._is_starting = on
        self._put_now(CYCLE, RecordingSwitch(on))

    def bookmark(self, text: str) -> str | None:
        """Write a bookmark at this moment; return why it is refused, None if it is written."""
        if not self._writer.status.is_writing or not self._on:
            return "nothing is being recorded: switch the recording on first"
        words = " ".join(text.split())
        if not words or len(words) > BOOKMARK_MAX:
            return f"a bookmark has from 1 to {BOOKMARK_MAX} characters, not {len(words)}"
        run_s, host_s = self._clock.both()
        mark = Bookmark.model_construct(run_s=run_s, cycle=self._cycle, text=words)
        if self._is_starting or not self._queue_item((BOOKMARK, host_s, run_s, mark)):
            return "the bookmark was not written: the recording is starting or the disk is too slow; try it again"
        self._bookmarks.append((self._writer.status.file, words))
        return None

    def undo_bookmark(self) -> str:
        """Withdraw the last bookmark that was not withdrawn; return its text.

        Raises
        ------
        UserError
            There is none, its file is finished, or the disk is too slow.
        """
        if not self._bookmarks:
            raise UserError("there is no bookmark of this run to withdraw")
        file, words = self._bookmarks[-1]
        status = self._writer.status
        if not self._on or not status.is_writing or status.file != file:
            raise UserError(f"the recording with the bookmark {words!r} is finished: it keeps that")
        run_s, host_s = self._clock.both()
        withdrawn = BookmarkWithdrawn.model_construct(run_s=run_s, cycle=self._cycle)
        if not self._queue_item((BOOKMARK_WITHDRAWN, host_s, run_s, withdrawn)):
            raise UserError("the disk is too slow: the bookmark stays, try it again")
        self._bookmarks.pop()
        return words

    def on_cycle(self, record: CycleRecord, state: State) -> None:
        """Record a cycle that has just left `state`, and the map, the objects or a keyframe if one is due."""
        run_s, host_s = record.inputs.run_s, record.inputs.host_s
        host_s = run_s if host_s is None else host_s  # virtual time has no other clock
        self._cycle = record.cycle
        if not self._on:
            return
        if self._is_starting:
            # The replay starts from the state that this cycle has left.
            self._is_starting, self._has_gap = False, True
        else:
            self._put((CYCLE, host_s, run_s, record))
        if self._last_keyframe_run_s is None:
            self._last_keyframe_run_s = run_s
        is_due = self._has_gap or self._writer.wants_keyframe or run_s - self._last_keyframe_run_s >= self._keyframe_s
        perception, cycle = state.perception, record.cycle
        if is_due and not self._writer.thread.is_full:
            self._has_gap = self._writer.wants_keyframe = False
            self._last_keyframe_run_s = run_s
            snapshot = MapSnapshot(
                cycle,
                perception.segment_geometry(),
                perception.objects(),
                carried_state(state),
                perception.snapshot(),
            )
            self._put((KEYFRAME, host_s, run_s, snapshot))
        elif cycle % self._snapshot_cycles == 0:
            segments = MapSnapshot(cycle, segments=perception.segment_geometry())
            self._put((SEGMENTS, host_s, run_s, segments))
        elif cycle % self._snapshot_cycles == self._snapshot_cycles // 2:
            objects = MapSnapshot(cycle, objects=perception.near_objects())
            self._put((OBJECTS, host_s, run_s, objects))
        if cycle % self._write_cycles == 0:
            self._writer.thread.wake()

    def on_bytes(self, direction: str, run_s: float, host_s: float, data: bytes) -> None:
        """Record bytes that have just been received or sent over the serial line, as the program sees it."""
        if self._on and not self._is_starting:  # as `_put`, at less cost: several times a cycle
            self._queue_item((SERIAL[direction], host_s, run_s, data))

    def on_settings(self, settings: Settings) -> None:
        """Record settings in force from the next cycle on; never dropped, as every later cycle needs them."""
        self._put_now(SETTINGS, SettingsReload(self._cycle + 1, settings))

    def on_summary(self, summary: Mapping[str, Any]) -> None:
        """Record the run's summary at its end."""
        self._put_now(SUMMARY, RunEnd.model_construct(run_s=self._clock(), summary=dict(summary)))

    def on_log(self, event: Mapping[str, Any]) -> None:
        """Record a line of the log; lost, and counted, if the queue is full."""
        fields = {name: value for name, value in event.items() if name not in {"level", "event", "timestamp"}}
        run_s, host_s = self._clock.both()
        line = LogLine.model_construct(
            run_s=run_s,
            level=str(event.get("level", "info")),
            event=str(event.get("event", "")),
            fields={name: field_text(value) for name, value in fields.items()},
        )
        self._put((LOG, host_s, run_s, line))

    def _put(self, item: QueuedItem) -> None:
        """Queue an item while recording is on; if a cycle is lost, the next keyframe is due at once."""
        if self._on and not self._is_starting and not self._queue_item(item):
            self._has_gap = self._has_gap or item[0] == CYCLE

    def _put_now(self, topic: str, content: object) -> None:
        """Queue an item of this moment even if the queue is full."""
        run_s, host_s = self._clock.both()
        self._queue_item((topic, host_s, run_s, content), always=True)
