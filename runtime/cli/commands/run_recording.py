"""What a run leaves behind: a recording where nothing else is said, and a ring log where that is asked for.

There is a recorder in every run, be it one that is switched off: an operator may want to record from now on.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from config.errors import FAILED, UserError
from config.settings import Settings

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

    from drivers.driver import RobotDriver
    from runtime.cycle.process import Observers
    from runtime.cycle.step import CycleRecord, State
    from runtime.cycle.summary import RecordingRow
    from runtime.recording.recorder import Recorder
    from runtime.recording.ring_log_writer import RingLogWriter
    from runtime.recording.writer import RecorderStatus
    from runtime.timing.cycle_stats import CycleStats

    OnCycle = Callable[[CycleRecord, State, CycleStats, RobotDriver], None]

RING_LOG: Final = ".csv"
"""A file to record into that ends so becomes a ring log."""


class RunRecording:
    """The recorder of a run, and what is told about it.

    Parameters
    ----------
    recorder : Recorder
        On or off.
    ring_log : RingLogWriter, optional
        None where there is no ring log.
    asked_for : bool
        Whether the user named the file: then trouble with it is the command's failure.
    """

    def __init__(self, recorder: Recorder, ring_log: RingLogWriter | None = None, *, asked_for: bool = False) -> None:
        self._recorder = recorder
        self._ring_log = ring_log
        self._asked_for = asked_for
        self._told: dict[Recorder | RingLogWriter, str | None] = {}

    def on_log(self, event: Mapping[str, Any]) -> None:
        """Take a line of the log."""
        self._recorder.on_log(event)

    def observers(self, view: OnCycle | None, log: FilteringBoundLogger) -> Observers:
        """Return who watches the run: the recorder and the view."""
        from runtime.cycle.process import Observers

        recorder, ring_log = self._recorder, self._ring_log
        parts = (recorder,) if ring_log is None else (ring_log, recorder)

        def on_cycle(record: CycleRecord, state: State, stats: CycleStats, driver: RobotDriver) -> None:
            recorder.on_cycle(record, state)
            for part in parts:
                standing = part.status
                if standing.last_error != self._told.get(part):
                    self._told[part] = standing.last_error
                    log.warning("the recording has trouble", reason=standing.last_error, dropped=standing.dropped)
            if view is not None:
                view(record, state, stats, driver)

        on_firing = None if ring_log is None else ring_log.put
        return Observers(on_cycle, on_firing, recorder.on_bytes, recorder.on_settings)

    def on_summary(self, summary: Mapping[str, Any]) -> None:
        """Take what the run says of itself at its end."""
        self._recorder.on_summary(summary)

    @property
    def now(self) -> RecorderStatus | None:
        """The recording under way; None where there is none."""
        standing = self._recorder.status
        return standing if standing.is_writing and self._recorder.is_enabled else None

    async def record(self, *, on: bool) -> str | None:
        """Begin another recording with the next cycle, or end the one under way; returns why not."""
        self._recorder.set_enabled(on=on)
        return None

    async def bookmark(self, text: str) -> str | None:
        """Put a mark into the recording; returns why not."""
        return self._recorder.bookmark(text)

    def probe(self) -> str | None:
        """Say how the recorder or the ring log's writer ended; None while they run. See `runtime.support.health`."""
        return self._recorder.probe() or (None if self._ring_log is None else self._ring_log.probe())

    @property
    def _asked(self) -> Recorder | RingLogWriter:
        """What the run is to leave behind first of all."""
        return self._recorder if self._ring_log is None else self._ring_log

    @property
    def standing(self) -> RecordingRow | None:
        """How ring log or recording stands, for the summary; None where there was none."""
        standing = asdict(self._asked.status)
        if not standing["files"] and standing["last_error"] is None:
            return None
        return {
            "file": standing["file"],
            "files": standing["files"],
            "bytes": standing["bytes"],
            "dropped": standing["dropped"],
            "trouble": standing["last_error"],
            "sync_max_s": round(standing["sync_max_s"], 4),
        }

    def complain(self) -> None:
        """Complain where the file that was asked for is not whole.

        Raises
        ------
        UserError
            The disk refused, or something was dropped.
        """
        now = self._asked.status
        if self._asked_for and (now.last_error is not None or now.dropped):
            what, salvage = "recording", " (`echolocate recover` reads what is there)"
            if self._ring_log is not None:
                what, salvage = "ring log", ""
            raise UserError(
                f"--record: the {what} is not whole: {now.last_error or 'the disk was too slow'}; {now.dropped} "
                f"messages are missing; make room or choose another disk{salvage}",
                FAILED,
            )


@contextlib.contextmanager
def kept(
    settings: Settings,
    record: str | None,
    *,
    no_record: bool,
    emulated: bool,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[RunRecording]:
    """Keep what is to be kept while the run lasts.

    Parameters
    ----------
    settings : Settings
        The run's, with the section `recording`.
    record : str, optional
        A file by name: a recording, or a ring log where it ends in ``.csv``.
    no_record : bool
        Keep no recording in the folder either, unless it is switched on.
    emulated : bool
        Whether the settings' world is what the robot meets.
    clock : callable
        The run's, s.
    """
    from runtime.recording.recorder import Recorder
    from runtime.recording.ring_log_writer import RingLogWriter
    from runtime.recording.storage import RecordingTarget, RotatingFolder, SingleFile, recordings_folder

    run = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{os.getpid()}"
    place: RecordingTarget = RotatingFolder(recordings_folder(settings.recording), run, settings.recording)
    with contextlib.ExitStack() as stack:
        ring_log: RingLogWriter | None = None
        if record is not None and Path(record).suffix.lower() == RING_LOG:
            on, ring_log = False, stack.enter_context(RingLogWriter(Path(record)))
        elif record is not None:
            on, place = True, SingleFile(Path(record))
        else:
            on = settings.recording.enabled and not no_record
        recorder = stack.enter_context(Recorder(settings, place, clock, emulated=emulated, on=on))
        yield RunRecording(recorder, ring_log, asked_for=record is not None)
