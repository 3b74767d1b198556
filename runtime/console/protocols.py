"""Protocols of what the console needs from the rest of the run: the robot's process, recording and replay.

Recording, replay and files are optional: commands that need a part which this run does not have are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, Protocol

from config.settings import Settings
from config.toml_edit import TomlValue
from perception.edits import Edit, Evidence
from runtime.console.clients.client import Frame
from runtime.console.frames.frame_encoder import RecordingStatus
from runtime.console.sent_messages import (
    JobMessage,
    ListedRecording,
    OpenedRecording,
    SettingsCheck,
    SettingsRow,
    SettingsText,
)
from runtime.cycle.drive_requests import DriveInput
from runtime.cycle.inputs import Request
from runtime.cycle.live_settings import LiveSettings
from runtime.cycle.step import State
from runtime.support.health import Health
from runtime.support.kernel_loader import InThread
from runtime.timing.time_control import TimeControl
from runtime.timing.timing_monitor import TimingMonitor

NOT_AVAILABLE: Final = "not available in this run"


class Robot(Protocol):
    """The robot's process, as far as commands act on it."""

    @property
    def state(self) -> State:
        """The state after the last cycle."""

    def request(self, request: Request, is_valid: Callable[[], bool] = ..., /) -> None:
        """Pass a change of mode to the next cycle, which drops it if it is no longer valid; HALT is sent at once."""

    def drive_request(self, drive_request: DriveInput, is_valid: Callable[[], bool] = ..., /) -> bool:
        """Pass a drive request to the next cycle, which drops it if it is not valid any more; the newest counts.

        Return False, and pass none, if too many changes of a mission wait.
        """

    def edit(self, *edits: Edit) -> bool:
        """Pass edits of the map to the next cycles; return False, and pass none, if too many are queued."""

    def evidence(self, number: int) -> Evidence | None:
        """Return what supports and opposes an object, None if there is no such object."""


class Run(Robot, Protocol):
    """The robot's process, as far as the console shows it."""

    health: Health
    live_settings: LiveSettings

    def stop(self) -> None:
        """End the run in order: the robot halts first."""

    @property
    def in_thread(self) -> InThread:
        """Calls a function in a thread that rests while a cycle is due."""

    @property
    def timing_monitor(self) -> TimingMonitor:
        """Measures the cycle's phases and the loop's callbacks."""

    @property
    def name(self) -> str | None:
        """The robot's name as it reports it, None until it has answered."""


class Viewer(Protocol):
    """A client to whom a recording is shown."""

    @property
    def is_gone(self) -> bool:
        """Whether it has disconnected."""

    def switch(self, *, live: bool) -> None:
        """Show the run itself from now on, or only the frames given to `show`."""

    def show(self, frame: Frame) -> None:
        """Send a frame, in place of one that has not been sent yet."""

    def send(self, message: Mapping[str, Any]) -> None:
        """Queue a message."""


class RecordingControl(Protocol):
    """Starts, stops and marks the recording of the run; each call returns None, or why it cannot be done."""

    @property
    def now(self) -> RecordingStatus | None:
        """The recording in progress, None while nothing is recorded."""

    async def record(self, *, on: bool) -> str | None:
        """Start or stop recording."""

    async def bookmark(self, text: str) -> str | None:
        """Add a bookmark."""

    async def undo_bookmark(self) -> str:
        """Withdraw the last bookmark and return its text; a UserError says why that is impossible."""


class ReplayControl(Protocol):
    """Shows recordings, to each client its own; a UserError of any call is the client's answer."""

    async def recordings(self) -> list[ListedRecording]:
        """Return the recordings that can be opened."""

    async def open(self, viewer: Viewer, file: str) -> OpenedRecording:
        """Show a recording to a client from now on; return its description."""

    async def seek(self, viewer: Viewer, s: float) -> None:
        """Go to a time in the recording, s after its first cycle."""

    async def play(self, viewer: Viewer, speed: float) -> None:
        """Play the recording `speed` times as fast as it was made; 0 pauses it."""

    async def step(self, viewer: Viewer, cycles: int) -> None:
        """Go forward by this many cycles; backward where negative."""

    def show_grid(self, viewer: Viewer) -> None:
        """Send the viewer the evidence grid at the moment of its recording."""

    async def close_recording(self, viewer: Viewer) -> None:
        """Show the client the run itself again."""

    def leave(self, viewer: Viewer) -> None:
        """End the recording shown to a disconnected client."""

    async def close(self) -> None:
        """End all recordings that are shown."""


class JobControl(Protocol):
    """Makes reports and maps of recordings, one at a time; a UserError of any call is the client's answer."""

    broadcast: Callable[[JobMessage], None]
    """Sends every client how far a job is."""

    def listed(self) -> list[JobMessage]:
        """Return the jobs of which progress or files can be had, the newest first."""

    def cancel(self, number: int, /) -> None:
        """End a job."""

    def path_of(self, number: int, name: str, /) -> Path | None:
        """Return the path of a file that a job made, None if it made none of this name."""


class SettingsFileControl(Protocol):
    """The files of this run's settings; a UserError of any call is the client's answer."""

    def listed(self) -> list[SettingsRow]:
        """Return the files."""

    async def read(self, number: int, /) -> SettingsText:
        """Return text and digest of a file, by its number in the list."""

    async def check(self, number: int, text: str, /) -> SettingsCheck:
        """Return problems and warnings of a text in place of a file, and its difference from the file."""

    async def changed(self, number: int, text: str, path: str, value: TomlValue, /) -> str:
        """Return a text in place of a file with another value of a field of its form."""

    async def save(self, number: int, text: str, digest: str, /) -> SettingsText:
        """Write a text in place of a file, if that still has the digest; return it as `read` would."""

    async def keep_places(self, settings: Settings) -> None:
        """Write the places of a run into the map file that it was started with, if it was."""

    async def restart(self) -> None:
        """End the run and start it again with the same command."""


class FileControl(Protocol):
    """The recordings as files; a UserError of any call is the client's answer."""

    @property
    def jobs(self) -> JobControl:
        """What is made of them."""

    async def find(self, file: str) -> Path:
        """Return the path of a recording as listed."""

    async def rename(self, file: str, to: str) -> str:
        """Give a recording another name, and return that."""

    async def pin(self, file: str, *, pinned: bool) -> None:
        """Keep a recording when the folder is full, or no longer."""

    async def undo(self) -> str:
        """Take back the last new name or pin; return what is as before."""

    async def delete(self, file: str) -> None:
        """Delete a recording."""

    async def make(self, kind: Literal["report", "map"], file: str) -> int:
        """Begin to make something of a recording, and return the job's number."""


class Controls(NamedTuple):
    """What the console can do beside driving; None what it cannot."""

    time: TimeControl | None = None
    """Pauses and steps the run."""
    recording: RecordingControl | None = None
    """Starts and stops recording the run."""
    replay: ReplayControl | None = None
    """Shows recordings."""
    files: FileControl | None = None
    """Names, keeps and deletes recordings, and makes files of them."""
    settings_files: SettingsFileControl | None = None
    """Reads and writes the settings files of the run, and starts it again."""


NO_CONTROLS: Final = Controls()
