"""What a run leaves behind: a recording where nothing else is said, and a ring log where that is asked for.

There is a recorder in every run, be it one that is switched off: an operator may want to record from now on.
"""

from __future__ import annotations

import contextlib
import os
import queue
import threading
import time
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
    from runtime.recording.writer import Standing
    from runtime.step import CycleRecord, State
    from runtime.summary import RecordingRow

    OnCycle = Callable[[CycleRecord, State, Books, RobotDriver], None]

RING_LOG: Final = ".csv"
"""A file to record into that ends so becomes a ring log."""


class Keeping:
    """The recorder of a run, and what is told about it.

    Parameters
    ----------
    recorder : Recorder
        On or off.
    on_firing : callable, optional
        Gets every firing, for a ring log.
    asked_for : bool
        Whether the user named the file: then trouble with it is the command's failure.
    """

    def __init__(self, recorder: Recorder, on_firing: Callable[[Firing], None] | None, *, asked_for: bool) -> None:
        self._recorder = recorder
        self._on_firing = on_firing
        self._asked_for = asked_for
        self._told: str | None = None

    def on_log(self, event: Mapping[str, Any]) -> None:
        """Take a line of the log."""
        self._recorder.on_log(event)

    def observers(self, view: OnCycle | None, log: FilteringBoundLogger) -> Observers:
        """Return who watches the run: the recorder and the view."""
        from runtime.process import Observers

        recorder = self._recorder

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
        self._recorder.on_summary(summary)

    @property
    def now(self) -> Standing | None:
        """The recording under way; None where there is none."""
        standing = self._recorder.standing
        return standing if standing.under_way and self._recorder.is_on else None

    async def record(self, *, on: bool) -> str | None:
        """Begin another recording with the next cycle, or end the one under way; returns why not."""
        self._recorder.switch(on=on)
        return None

    async def bookmark(self, text: str) -> str | None:
        """Put a mark into the recording; returns why not."""
        return self._recorder.bookmark(text)

    def probe(self) -> str | None:
        """Say how the recorder ended; None while it runs. See `runtime.health`."""
        return self._recorder.probe()

    @property
    def standing(self) -> RecordingRow | None:
        """How the recording stands, for the summary; None where there was none."""
        standing = asdict(self._recorder.standing)
        if not standing["files"] and standing["trouble"] is None:
            return None
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
        now = self._recorder.standing
        if self._asked_for and (now.trouble is not None or now.dropped):
            raise Complaint(
                f"--record: the recording is not whole: {now.trouble or 'the disk was too slow'}; {now.dropped} "
                "messages are missing; make room or choose another disk (`echolocate recover` reads what is there)",
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
) -> Iterator[Keeping]:
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

    Raises
    ------
    Complaint
        The ring log cannot be written.
    """
    from runtime.recording.folder import OneFile, Place, Rotating, recordings_folder
    from runtime.recording.recorder import Recorder

    run = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{os.getpid()}"
    place: Place = Rotating(recordings_folder(settings.recording), run, settings.recording)
    with contextlib.ExitStack() as stack:
        on_firing = None
        if record is not None and Path(record).suffix.lower() == RING_LOG:
            on, on_firing = False, stack.enter_context(ring_log(record))
        elif record is not None:
            on, place = True, OneFile(Path(record))
        else:
            on = settings.recording.enabled and not no_record
        recorder = stack.enter_context(Recorder(settings, place, clock, emulated=emulated, on=on))
        yield Keeping(recorder, on_firing, asked_for=record is not None and on)


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
