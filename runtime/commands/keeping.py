"""What a run leaves behind: a recording where nothing else is said, and a ring log where that is asked for."""

from __future__ import annotations

import contextlib
import os
import queue
import threading
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
    from drivers.messages import Firing
    from runtime.books import Books
    from runtime.process import Observers
    from runtime.recording.recorder import Recorder
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
        None where nothing is recorded.
    on_firing : callable, optional
        Gets every firing, for a ring log.
    asked_for : bool
        Whether the user named the file: then trouble with it is the command's failure.
    """

    def __init__(
        self, recorder: Recorder | None, on_firing: Callable[[Firing], None] | None, *, asked_for: bool
    ) -> None:
        self._recorder = recorder
        self._on_firing = on_firing
        self._asked_for = asked_for
        self._told: str | None = None

    def on_log(self, event: Mapping[str, Any]) -> None:
        """Take a line of the log."""
        if self._recorder is not None:
            self._recorder.on_log(event)

    def observers(self, view: OnCycle | None, log: FilteringBoundLogger) -> Observers:
        """Return who watches the run: the recorder and the view."""
        from runtime.process import Observers

        recorder = self._recorder
        if recorder is None:
            return Observers(view, self._on_firing)

        def on_cycle(record: CycleRecord, state: State, books: Books, driver: RobotDriver) -> None:
            recorder.on_cycle(record, state)
            if recorder.standing.trouble != self._told:
                self._told = recorder.standing.trouble
                log.warning("the recording has trouble", reason=self._told, dropped=recorder.standing.dropped)
            if view is not None:
                view(record, state, books, driver)

        return Observers(on_cycle, self._on_firing, recorder.on_bytes, recorder.on_settings)

    def on_summary(self, summary: Mapping[str, Any]) -> None:
        """Take what the run says of itself at its end."""
        if self._recorder is not None:
            self._recorder.on_summary(summary)

    def probe(self) -> str | None:
        """Say how the recorder ended; None while it runs, or where there is none. See `runtime.health`."""
        return None if self._recorder is None else self._recorder.probe()

    @property
    def standing(self) -> RecordingRow | None:
        """How the recording stands, for the summary; None where there is none."""
        if self._recorder is None:
            return None
        standing = asdict(self._recorder.standing)
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
        now = None if self._recorder is None else self._recorder.standing
        if self._asked_for and now is not None and (now.trouble is not None or now.dropped):
            raise Complaint(
                f"--record: the recording is not whole: {now.trouble or 'the disk was too slow'}; {now.dropped} "
                "messages are missing; make room or choose another disk (`echolocate recover` reads what is there)",
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

    Raises
    ------
    Complaint
        The ring log cannot be written.
    """
    with contextlib.ExitStack() as stack:
        if record is not None and Path(record).suffix.lower() == RING_LOG:
            yield Keeping(None, stack.enter_context(ring_log(record)), asked_for=True)
            return
        if record is None and (no_record or not settings.recording.enabled):
            yield Keeping(None, None, asked_for=False)
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
        yield Keeping(recorder, None, asked_for=record is not None)


@contextlib.contextmanager
def ring_log(path: str) -> Iterator[Callable[[Firing], None]]:
    """Write the run's firings to a ring log, in a thread: a slow disk delays no cycle.

    Raises
    ------
    Complaint
        The file cannot be written.
    """
    from runtime.ringlog import RingLogError, write_ring_log

    waiting: queue.SimpleQueue[Firing | None] = queue.SimpleQueue()
    failures: list[RingLogError] = []

    def work() -> None:
        try:
            write_ring_log(Path(path), iter(waiting.get, None))
        except RingLogError as error:
            failures.append(error)

    writer = threading.Thread(target=work, name="ring log")
    writer.start()
    try:
        yield waiting.put
    finally:
        waiting.put(None)
        writer.join()
    if failures:
        raise Complaint(str(failures[0]), FAILED)
