"""The operator console of `run`, given whoever holds the run's time, its recording, and the recordings of others."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Final

from config.settings import Settings
from runtime.console.console import Console
from runtime.console.frames.frame_encoder import RecordingStatus
from runtime.console.playback.replay_client import ReplayClient
from runtime.cycle.live_settings import PrepareSettings
from runtime.recording.storage import recordings_folder
from runtime.support.length_format import Units

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

    from runtime.cli.commands.run_recording import RunRecording
    from runtime.console.protocols import Run
    from runtime.timing.time_control import TimeControl

PLAYED: Final = "runtime.console.playback.replay_frames"
"""The program that plays a recording."""


class Recordings:
    """The run's recording, as the console asks about it.

    Parameters
    ----------
    keeping : RunRecording
        Of the run.
    """

    def __init__(self, keeping: RunRecording) -> None:
        self._keeping = keeping

    @property
    def now(self) -> RecordingStatus | None:
        """The recording under way, None where there is none."""
        now = self._keeping.now
        return None if now is None else RecordingStatus(now.file, now.bytes, now.dropped)

    async def record(self, *, on: bool) -> str | None:
        """Begin or end a recording."""
        return await self._keeping.record(on=on)

    async def bookmark(self, text: str) -> str | None:
        """Put a mark into it."""
        return await self._keeping.bookmark(text)


@asynccontextmanager
async def paged(
    process: Run,
    settings: Settings,
    log: FilteringBoundLogger,
    prepare: PrepareSettings,
    keeping: RunRecording,
    control: TimeControl,
    *,
    emulated: bool,
    units: Units,
) -> AsyncIterator[Console]:
    """Serve the console while the run lasts; what it began beside the run ends with it.

    Parameters
    ----------
    process, log, prepare, emulated, units
        As of `Console`.
    settings : Settings
        With which the run is started.
    keeping : RunRecording
        The run's.
    control : TimeControl
        Holds the run's time.

    Raises
    ------
    UserError
        There is nowhere to listen.
    """
    recording = Recordings(keeping)

    def current() -> str | None:
        return None if recording.now is None else recording.now.file

    players = ReplayClient(recordings_folder(settings.recording), PLAYED, current, units)
    console = Console(
        process, log, prepare, emulated=emulated, units=units,
        time=control, recording=recording, replay=players,
    )  # fmt: skip
    try:
        async with console.open():
            yield console
    finally:
        await players.close()
