"""Serve the operator console of `run`, with its time control, its recording and the replay of earlier recordings."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Final

from config.files import documents_read
from config.settings import Settings
from runtime.console.console import Console
from runtime.console.files.jobs import Jobs
from runtime.console.files.recording_files import RecordingFiles
from runtime.console.files.settings_files import SettingsFiles
from runtime.console.playback.replay_client import ReplayClient
from runtime.console.protocols import Controls
from runtime.cycle.live_settings import PrepareSettings
from runtime.recording.storage import recordings_folder
from runtime.support.length_format import Units
from runtime.support.restart import ConsoleBefore, Restart

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

    from runtime.cli.commands.run.run_recording import RunRecording
    from runtime.console.protocols import Run
    from runtime.timing.time_control import TimeControl

REPLAY_PROGRAM: Final = "runtime.console.playback.replay_frames"
"""The module that replays a recording, as a program."""


@asynccontextmanager
async def serve_console(
    process: Run,
    log: FilteringBoundLogger,
    prepare: PrepareSettings,
    recording: RunRecording,
    control: TimeControl,
    *,
    emulated: bool,
    units: Units,
    reload: Callable[[], Settings],
    restart: Restart,
) -> AsyncIterator[Console]:
    """Serve the console while the run lasts; its child processes end with it.

    Parameters
    ----------
    process, log, prepare, emulated, units
        As of `Console`.
    recording : RunRecording
        Of the run.
    control : TimeControl
        Of the run.
    reload : callable
        Reads the settings again.
    restart : Restart
        Is asked to start the run again.

    Raises
    ------
    UserError
        The console cannot listen on its address.
    """

    def current_file() -> str | None:
        return None if recording.now is None else recording.now.file

    def end_and_restart() -> str | None:
        if restart.refusal is None and console.listening is not None:
            restart.request(ConsoleBefore(console.listening[1], console.token))
            process.stop()
        return restart.refusal

    folder, jobs = recordings_folder(process.live_settings.current.recording), Jobs(units)
    replays = ReplayClient(folder, REPLAY_PROGRAM, current_file)
    console = Console(
        process,
        log,
        prepare,
        emulated=emulated,
        units=units,
        controls=Controls(
            time=control,
            recording=recording,
            replay=replays,
            files=RecordingFiles(folder, current_file, jobs),
            settings_files=SettingsFiles(documents_read(), process.live_settings.current, reload, end_and_restart),
        ),
    )
    try:
        async with console.open():
            yield console
    finally:
        await jobs.close()
        await replays.close()
