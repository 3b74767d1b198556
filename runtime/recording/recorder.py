"""The loop's side of a recording: what happened is handed over as it is, and the loop goes on.

Handing over is an append to a queue. Only now and then is more asked of the loop: once a second a copy of the map,
half a second later the objects, and once in a while, as a keyframe, a copy of everything that is remembered; all of
it after the command has been sent.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from types import TracebackType
from typing import Any, Final

from llvmlite.binding import get_host_cpu_name

from config.settings import Settings
from runtime import VERSION
from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import BOOKMARK, CYCLE, KEYFRAME, LOG, OBJECTS, SEGMENTS, SERIAL, SETTINGS, SUMMARY
from runtime.recording.schema import FORMAT, Bookmark, LogLine, RunEnd, RunInfo, carried_state
from runtime.recording.storage import RecordingTarget
from runtime.recording.writer import QUEUE_MAX, Item, MapSnapshot, RecorderStatus, RecordingWriter, Reloaded, Switch
from runtime.support.kernel_cache import kernels_key

MOMENT_S: Final = 1.0
"""So often the map and the objects are recorded, as changes."""
BOOKMARK_MAX: Final = 500
"""Characters."""


def software_versions() -> dict[str, str]:
    """Return what the last bit of a result may depend on besides its inputs."""
    return {
        "echolocate": VERSION,
        "python": platform.python_version(),
        "numpy": version("numpy"),
        "numba": version("numba"),
        "kernels": kernels_key(),
        "compiled": "no" if os.environ.get("NUMBA_DISABLE_JIT", "0") not in {"", "0"} else "yes",
        "processor": f"{platform.machine()} {get_host_cpu_name()}",
    }


def run_info(settings: Settings, clock: Callable[[], float], *, emulated: bool) -> RunInfo:
    """Return what stands at the beginning of a recording that begins now."""
    return RunInfo(
        format=FORMAT,
        settings=settings.model_dump(mode="json"),
        versions=software_versions(),
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        unix_minus_host_ns=time.time_ns() - round(1e9 * clock()),
        part=1,
        emulated=emulated,
    )


class Recorder:
    """Takes everything that a run does and has it written; a context in which the writing goes on.

    Parameters
    ----------
    settings : Settings
        Of the run.
    place : RecordingTarget
        Where the recording goes.
    clock : callable
        The host's clock of the run: monotonic, s.
    queue_max : int
        Items that may wait; what does not fit is dropped and counted.
    emulated : bool
        Whether the settings' world is what the robot meets.
    on : bool
        Whether to record from the beginning; `set_enabled` may do so later.
    """

    def __init__(
        self,
        settings: Settings,
        place: RecordingTarget,
        clock: Callable[[], float] = time.monotonic,
        queue_max: int = QUEUE_MAX,
        *,
        emulated: bool = False,
        on: bool = True,
    ) -> None:
        self._clock = clock
        self._queue_max = queue_max
        self._moment_cycles = max(1, round(MOMENT_S * settings.cycle.rate_hz))
        self._keyframe_s = settings.recording.keyframe_period_s
        self._writer = RecordingWriter(place, run_info(settings, clock, emulated=emulated), on=on)
        self._on = on
        self._begins = False
        self._last_keyframe_s: float | None = None
        self._gap = False
        self._cycle = 0

    def __enter__(self) -> Recorder:
        self._writer.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.stop()

    @property
    def status(self) -> RecorderStatus:
        """How the recording stands."""
        return self._writer.status

    def probe(self) -> str | None:
        """Say how its thread ended; None while it runs. See `runtime.support.health`."""
        return self._writer.probe()

    @property
    def is_enabled(self) -> bool:
        """Whether a recording is wanted."""
        return self._on

    def set_enabled(self, *, on: bool) -> None:
        """Begin another file with the next cycle, or end the one under way; nothing where it is so already."""
        if on == self._on:
            return
        self._on = self._begins = on
        self._writer.queue.append(Item(CYCLE, self._clock(), Switch(on)))

    def bookmark(self, text: str) -> str | None:
        """Put a mark into the recording; returns why not."""
        if not self._writer.status.is_writing or not self._on:
            return "nothing is being recorded: switch the recording on first"
        words = " ".join(text.split())
        if not words or len(words) > BOOKMARK_MAX:
            return f"a bookmark has from 1 to {BOOKMARK_MAX} characters, not {len(words)}"
        self._hand(BOOKMARK, self._clock(), Bookmark.model_construct(cycle=self._cycle, text=words))
        return None

    def on_cycle(self, record: CycleRecord, state: State) -> None:
        """Take a cycle, just over."""
        run_s = record.inputs.run_s
        self._cycle = record.cycle
        if not self._on:
            return
        if self._begins:
            # What follows is replayed from the state that this one left.
            self._begins, self._gap = False, True
        else:
            self._hand(CYCLE, run_s, record)
        if self._last_keyframe_s is None:
            self._last_keyframe_s = run_s
        room = len(self._writer.queue) < self._queue_max
        due = self._gap or self._writer.wants_keyframe or run_s - self._last_keyframe_s >= self._keyframe_s
        if due and room:
            self._gap = self._writer.wants_keyframe = False
            self._last_keyframe_s = run_s
            seen = state.perception
            whole = MapSnapshot(
                record.cycle, seen.segment_geometry(), seen.objects(), carried_state(state), seen.snapshot()
            )
            self._hand(KEYFRAME, run_s, whole)
        elif record.cycle % self._moment_cycles == 0:
            self._hand(SEGMENTS, run_s, MapSnapshot(record.cycle, segments=state.perception.segment_geometry()))
        elif record.cycle % self._moment_cycles == self._moment_cycles // 2:
            self._hand(OBJECTS, run_s, MapSnapshot(record.cycle, objects=state.perception.objects()))

    def on_bytes(self, way: str, host_s: float, data: bytes) -> None:
        """Take bytes that came or went over the line."""
        self._hand(SERIAL[way], host_s, data)

    def on_settings(self, settings: Settings) -> None:
        """Take settings that are in force from the next cycle on; never dropped, for what follows hangs on them."""
        self._writer.queue.append(Item(SETTINGS, self._clock(), Reloaded(self._cycle + 1, settings)))

    def on_summary(self, summary: Mapping[str, Any]) -> None:
        """Take what the run says of itself at its end."""
        self._writer.queue.append(Item(SUMMARY, self._clock(), RunEnd.model_construct(summary=dict(summary))))

    def on_log(self, event: Mapping[str, Any]) -> None:
        """Take a line of the log."""
        fields = {name: value for name, value in event.items() if name not in {"level", "event", "timestamp"}}
        line = LogLine.model_construct(
            level=str(event.get("level", "info")), event=str(event.get("event", "")),
            fields={name: str(value) for name, value in fields.items()},
        )  # fmt: skip
        self._hand(LOG, self._clock(), line)

    def _hand(self, topic: str, host_s: float, what: object) -> None:
        if not self._on or self._begins:
            return
        if len(self._writer.queue) < self._queue_max:
            self._writer.queue.append(Item(topic, host_s, what))
        else:
            self._writer.drop()
            self._gap = self._gap or topic == CYCLE
