"""What a run leaves behind: a recording where nothing else is said, and a ring log where that is asked for."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from config.settings import Settings
from runtime.complaint import FAILED, Complaint

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

    from drivers.driver import RobotDriver
    from runtime.books import Books
    from runtime.process import Observers
    from runtime.recording.recorder import Recorder
    from runtime.recording.ringlog_writer import RingLogWriter
    from runtime.step import CycleRecord, State
    from runtime.summary import RecordingRow

    OnCycle = Callable[[CycleRecord, State, Books, RobotDriver], None]

RING_LOG: Final = ".csv"
"""A file to record into that ends so becomes a ring log."""


class Keeping:
    """The recorder of a run, and what is told about it.

    Parameters
    ----------
    recorder : Recorder, optional
        None where there is no recording.
    ring_log : RingLogWriter, optional
        None where there is no ring log.
    asked_for : bool
        Whether the user named the file: then trouble with it is the command's failure.
    """

    def __init__(
        self, recorder: Recorder | None = None, ring_log: RingLogWriter | None = None, *, asked_for: bool = False
    ) -> None:
        self._recorder = recorder
        self._ring_log = ring_log
        self._asked_for = asked_for
        self._told: str | None = None

    def on_log(self, event: Mapping[str, Any]) -> None:
        """Take a line of the log."""
        if self._recorder is not None:
            self._recorder.on_log(event)

    def observers(self, view: OnCycle | None, log: FilteringBoundLogger) -> Observers:
        """Return who watches the run: the recorder and the view."""
        from runtime.process import Observers

        recorder, ring_log, kept = self._recorder, self._ring_log, self._kept
        if kept is None:
            return Observers(view)

        def on_cycle(record: CycleRecord, state: State, books: Books, driver: RobotDriver) -> None:
            if recorder is not None:
                recorder.on_cycle(record, state)
            if kept.standing.trouble != self._told:
                self._told = kept.standing.trouble
                log.warning("the recording has trouble", reason=self._told, dropped=kept.standing.dropped)
            if view is not None:
                view(record, state, books, driver)

        if recorder is None:
            return Observers(on_cycle, None if ring_log is None else ring_log.put)
        return Observers(on_cycle, None, recorder.on_bytes, recorder.on_settings)

    def on_summary(self, summary: Mapping[str, Any]) -> None:
        """Take what the run says of itself at its end."""
        if self._recorder is not None:
            self._recorder.on_summary(summary)

    def probe(self) -> str | None:
        """Say how the recorder ended; None while it runs, or where there is none. See `runtime.health`."""
        return None if self._kept is None else self._kept.probe()

    @property
    def _kept(self) -> Recorder | RingLogWriter | None:
        return self._recorder if self._ring_log is None else self._ring_log

    @property
    def standing(self) -> RecordingRow | None:
        """How the recording stands, for the summary; None where there is none."""
        if self._kept is None:
            return None
        standing = asdict(self._kept.standing)
        return {
            "file": standing["file"],
            "files": standing["files"],
            "bytes": standing["bytes"],
            "dropped": standing["dropped"],
            "trouble": standing["trouble"],
            "sync_max_s": round(standing["sync_max_s"], 4),
        }

    def complain(self) -> None:
        """Complain where the file that was asked for is not whole.

        Raises
        ------
        Complaint
            The disk refused, or something was dropped.
        """
        now = None if self._kept is None else self._kept.standing
        if self._asked_for and now is not None and (now.trouble is not None or now.dropped):
            what, salvage = "recording", " (`echolocate recover` reads what is there)"
            if self._ring_log is not None:
                what, salvage = "ring log", ""
            raise Complaint(
                f"--record: the {what} is not whole: {now.trouble or 'the disk was too slow'}; {now.dropped} "
                f"messages are missing; make room or choose another disk{salvage}",
                FAILED,
            )


@contextlib.contextmanager
def kept(settings: Settings, record: str | None, *, no_record: bool, emulated: bool) -> Iterator[Keeping]:
    """Keep what is to be kept while the run lasts.

    Parameters
    ----------
    settings : Settings
        The run's, with the section `recording`.
    record : str, optional
        A file by name: a recording, or a ring log where it ends in ``.csv``.
    no_record : bool
        Keep no recording in the folder either.
    emulated : bool
        Whether the settings' world is what the robot meets.
    """
    with contextlib.ExitStack() as stack:
        if record is not None and Path(record).suffix.lower() == RING_LOG:
            from runtime.recording.ringlog_writer import RingLogWriter

            yield Keeping(ring_log=stack.enter_context(RingLogWriter(Path(record))), asked_for=True)
            return
        if record is None and (no_record or not settings.recording.enabled):
            yield Keeping()
            return
        from runtime.recording.folder import OneFile, Place, Rotating, recordings_folder
        from runtime.recording.recorder import Recorder

        run = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{os.getpid()}"
        place: Place
        if record is not None:
            place = OneFile(Path(record))
        else:
            place = Rotating(recordings_folder(settings.recording), run, settings.recording)
        recorder = stack.enter_context(Recorder(settings, place, emulated=emulated))
        yield Keeping(recorder, asked_for=record is not None)
