"""What the console asks of others, as protocols: the robot's process, and whoever records and plays.

A part that is not there answers so: a robot on a port has no time that could be held, and a run without a recording
nothing to mark.
"""

from __future__ import annotations

from typing import Any, Final, Protocol

from config.settings import Settings
from perception.edits import Edit, Evidence
from runtime.console.clients.client import Frame
from runtime.console.frames.frame_encoder import RecordingStatus
from runtime.cycle.drive_requests import DriveRequest
from runtime.cycle.inputs import Request
from runtime.cycle.step import State
from runtime.support.health import Health
from runtime.timing.timing_monitor import TimingMonitor

NOT_HERE: Final = "not available here"


class Robot(Protocol):
    """The robot's process, as far as an operator reaches it."""

    def request(self, request: Request) -> None:
        """Take a request into the next cycle; a HALT goes out at once."""

    def drive_request(self, drive_request: DriveRequest) -> None:
        """Take what is to be driven into the next cycle; the newest counts."""

    def edit(self, edit: Edit) -> bool:
        """Take a change of the map into the next cycle; False where too many wait already."""

    def evidence(self, number: int) -> Evidence | None:
        """Return what speaks for and against an object, None where there is no such object."""

    def reconfigure(self, settings: Settings) -> None:
        """Go on with other settings from the next cycle on."""


class Run(Robot, Protocol):
    """The same, as far as the console follows it."""

    health: Health

    @property
    def state(self) -> State:
        """What the last cycle left."""

    @property
    def timing_monitor(self) -> TimingMonitor:
        """The books of time."""

    @property
    def name(self) -> str | None:
        """What the robot calls itself, None until it has."""


class Viewer(Protocol):
    """A client, to whoever shows it something else than the run itself."""

    @property
    def is_gone(self) -> bool:
        """Whether it has left: nothing needs to be shown any more."""

    def switch(self, *, live: bool) -> None:
        """Have it shown the run itself, or only what `show` gives it."""

    def show(self, frame: Frame) -> None:
        """Have a frame ready for it."""

    def say(self, message: dict[str, Any]) -> None:
        """Send it a message of its own."""


class RecordingControl(Protocol):
    """Begins, ends and marks the recording of the run; every call returns None, or why it cannot be done."""

    @property
    def now(self) -> RecordingStatus | None:
        """The recording under way, None where there is none."""

    async def record(self, *, on: bool) -> str | None:
        """Begin or end a recording."""

    async def bookmark(self, text: str) -> str | None:
        """Put a mark into it."""


class ReplayControl(Protocol):
    """Shows recordings, to each client its own; a `CommandError` that is raised is told to who asked."""

    async def recordings(self) -> list[dict[str, Any]]:
        """Return which recordings there are."""

    async def open(self, viewer: Viewer, file: str) -> dict[str, Any]:
        """Show a recording to a client from now on; return what there is to know of it."""

    async def scrub(self, viewer: Viewer, s: float) -> None:
        """Go to a time in it."""

    async def play(self, viewer: Viewer, speed: float) -> None:
        """Let it go by."""

    async def step(self, viewer: Viewer, cycles: int) -> None:
        """Go so many cycles on, or back."""

    async def live(self, viewer: Viewer) -> None:
        """Go back to the run itself."""

    def leave(self, viewer: Viewer) -> None:
        """Take note that a client is gone."""

    async def report(self) -> bytes:
        """Return the run up to now as a page of its own."""

    async def close(self) -> None:
        """End whatever is shown: the run is over."""
