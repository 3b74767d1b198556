"""The recorder of a run: by default it writes into the folder of recordings, on request a file or a ring log.

Every run has a recorder, even if it is switched off: the operator may switch it on during the run.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from config.errors import FAILED, UserError
from config.settings import Settings

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

    from drivers.driver import RobotDriver
    from runtime.console.frames.frame_encoder import RecordingStatus
    from runtime.cycle.process import Observers, OnCycle
    from runtime.cycle.step import CycleRecord, State
    from runtime.cycle.summary import RecordingRow
    from runtime.recording.recorder import Recorder
    from runtime.recording.ring_log_writer import RingLogWriter
    from runtime.timing.cycle_stats import CycleStats

RING_LOG: Final = ".csv"
"""Suffix of a file that is written as a ring log."""


class RunRecording:
    """The recorder and the ring log of a run: what they observe, and how they are.

    Parameters
    ----------
    recorder : Recorder
        Switched on or off.
    ring_log : RingLogWriter, optional
        None without a ring log.
    is_requested : bool
        Whether the user named the file: then an incomplete file is an error of the command.
    """

    def __init__(
        self, recorder: Recorder, ring_log: RingLogWriter | None = None, *, is_requested: bool = False
    ) -> None:
        self._recorder = recorder
        self._ring_log = ring_log
        self._is_requested = is_requested
        self._notice: str | None = None
        self._reported: dict[Recorder | RingLogWriter, str | None] = {}

    def on_log(self, event: Mapping[str, Any]) -> None:
        """Record a line of the log."""
        self._recorder.on_log(event)

    def observers(self, view: OnCycle | None, log: FilteringBoundLogger) -> Observers:
        """Return the observers of the run: recorder, ring log and view; errors of the disk go to the log."""
        from runtime.cycle.process import Observers

        recorder, ring_log = self._recorder, self._ring_log
        writers = (recorder,) if ring_log is None else (ring_log, recorder)

        def on_cycle(record: CycleRecord, state: State, stats: CycleStats, driver: RobotDriver) -> None:
            recorder.on_cycle(record, state)
            for writer in writers:
                error = writer.last_error
                if error != self._reported.get(writer):
                    self._reported[writer] = error
                    log.warning("the recording is incomplete", reason=error, dropped=writer.status.dropped)
            notice = recorder.notice
            if notice is not None and notice != self._notice:
                self._notice = notice
                log.warning(notice)
            if view is not None:
                view(record, state, stats, driver)

        on_firing = None if ring_log is None else ring_log.put
        return Observers(on_cycle, on_firing, recorder.on_bytes, recorder.on_settings)

    def on_summary(self, summary: Mapping[str, Any]) -> None:
        """Record the summary of the run."""
        self._recorder.on_summary(summary)

    @property
    def now(self) -> RecordingStatus | None:
        """The recording being written; None while nothing is recorded."""
        from runtime.console.frames.frame_encoder import RecordingStatus

        status = self._recorder.status
        if not status.is_writing or not self._recorder.is_enabled:
            return None
        return RecordingStatus(status.file, status.bytes, status.dropped)

    async def record(self, *, on: bool) -> str | None:
        """Start a recording with the next cycle, or end the current one; return None, or why that is impossible."""
        self._recorder.set_enabled(on=on)
        return None

    async def bookmark(self, text: str) -> str | None:
        """Add a bookmark to the recording; return None, or why that is impossible."""
        return self._recorder.bookmark(text)

    async def undo_bookmark(self) -> str:
        """Withdraw the last bookmark of this run; return its text."""
        return self._recorder.undo_bookmark()

    def probe(self) -> str | None:
        """Return how the thread of recorder or ring log ended; None while they run. See `runtime.support.health`."""
        return self._recorder.probe() or (None if self._ring_log is None else self._ring_log.probe())

    @property
    def _main_writer(self) -> Recorder | RingLogWriter:
        """The ring log if there is one, otherwise the recorder."""
        return self._recorder if self._ring_log is None else self._ring_log

    @property
    def summary_row(self) -> RecordingRow | None:
        """The state of the ring log or the recording, for the summary of the run; None if there was none."""
        status = self._main_writer.status
        if not status.files and status.last_error is None:
            return None
        return {
            "file": status.file,
            "files": status.files,
            "bytes": status.bytes,
            "dropped": status.dropped,
            "last_error": status.last_error,
            "sync_max_s": round(status.sync_max_s, 4),
        }

    def raise_if_incomplete(self) -> None:
        """Raise an error if the file that the user named is incomplete.

        Raises
        ------
        UserError
            The disk refused, or something was dropped.
        """
        status = self._main_writer.status
        if self._is_requested and (status.last_error is not None or status.dropped):
            what, hint = "recording", " (`echolocate recover` restores what is there)"
            if self._ring_log is not None:
                what, hint = "ring log", ""
            raise UserError(
                f"--record: the {what} is incomplete: {status.last_error or 'the disk was too slow'}; "
                f"{status.dropped} messages are missing; make room or choose another disk{hint}",
                FAILED,
            )


@contextlib.contextmanager
def open_run_recording(
    settings: Settings,
    record: str | None,
    *,
    no_record: bool,
    emulated: bool,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[RunRecording]:
    """Yield the recording of a run, and complete its files at the end.

    Parameters
    ----------
    settings : Settings
        Of the run.
    record : str, optional
        File to record into: a ring log if its name ends in ``.csv``, otherwise a recording.
    no_record : bool
        Whether the recording in the folder of recordings is switched off at the start.
    emulated : bool
        Whether the robot drives in the world of the settings.
    clock : callable
        The run's clock, s.
    """
    from drivers.firing_pattern import pattern_pairs
    from runtime.recording.recorder import Recorder
    from runtime.recording.ring_log_writer import RingLogWriter
    from runtime.recording.servo_columns import ServoColumns
    from runtime.recording.storage import RecordingTarget, RotatingFolder, SingleFile, recordings_folder

    run = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{os.getpid()}"
    target: RecordingTarget = RotatingFolder(recordings_folder(settings.recording), run, settings.recording)
    with contextlib.ExitStack() as stack:
        ring_log: RingLogWriter | None = None
        if record is not None and Path(record).suffix.lower() == RING_LOG:
            columns = pattern_pairs(settings.ring), ServoColumns(settings.ring)
            on, ring_log = False, stack.enter_context(RingLogWriter(Path(record), *columns))
        elif record is not None:
            on, target = True, SingleFile(Path(record))
        else:
            on = settings.recording.enabled and not no_record
        recorder = stack.enter_context(Recorder(settings, target, clock, emulated=emulated, on=on))
        yield RunRecording(recorder, ring_log, is_requested=record is not None)
