"""The parts of a console command, and the arguments of its handler."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final, Generic, NamedTuple, TypeVar

from config.places import PlacesConfig
from perception.edits import Edit
from runtime.console.clients.client import Client
from runtime.console.clients.client_hub import ClientHub
from runtime.console.commands.command_error import CommandError
from runtime.console.commands.edit_history import EditHistory
from runtime.console.commands.tuning import Tuning
from runtime.console.protocols import (
    NOT_AVAILABLE,
    FileControl,
    RecordingControl,
    ReplayControl,
    Run,
    SettingsFileControl,
)
from runtime.timing.time_control import TimeControl

Arguments = TypeVar("Arguments")
Part = TypeVar("Part")

PLACES_UNDO_MAX: Final = 50
"""Changes of the places that can be undone."""
Data = TypeVar("Data", covariant=True)


class AnsweredLater(Generic[Data]):
    """A handler returns this if the answer, with data of this type, is sent by others once the outcome is known."""


ANSWERED_LATER: Final[AnsweredLater[Any]] = AnsweredLater()


class Permission(Enum):
    """The permission that a command requires of a client."""

    TOKEN = "token"  # noqa: S105 - the name of a permission, no secret
    """The run's token."""
    CONTROL = "control"
    """The run's token and control of the robot, which one client has at a time."""


class PendingEdit(NamedTuple):
    """An edit that the next cycle carries out, and the message to answer then."""

    edit: Edit
    client: Client
    id: int | None
    """None for the first edits of an undo: its last one is answered."""
    data: object = None
    """Of the answer."""
    is_undo: bool = False
    """Whether it takes another one back, so that it cannot be undone itself."""


@dataclass(slots=True)
class CommandContext:
    """The parts of the run that commands act on."""

    robot: Run
    hub: ClientHub
    tuning: Tuning
    clock: Callable[[], float]
    """Monotonic, s."""
    time: TimeControl | None = None
    recording: RecordingControl | None = None
    replay: ReplayControl | None = None
    files: FileControl | None = None
    settings_files: SettingsFileControl | None = None
    pending_edits: deque[PendingEdit] = field(default_factory=deque)
    """In the order in which the cycle carries them out."""
    history: EditHistory = field(default_factory=EditHistory)
    """The edits that can be undone."""
    places_before: deque[PlacesConfig] = field(default_factory=lambda: deque(maxlen=PLACES_UNDO_MAX))
    """The places that each change replaced, for undo."""
    is_teleoperated: bool = False
    """Whether the last drive request was a velocity from a client's teleoperation."""
    grid: tuple[float, bytes] = (-math.inf, b"")
    """The message of the evidence grid that was made last, and when, by `clock`."""
    armed_by: Client | None = None
    """The client that armed the robot last."""


class Call(NamedTuple):
    """One command given by one client."""

    context: CommandContext
    client: Client
    id: int
    """Of the message."""
    name: str
    """Of the command."""

    def available(self, part: Part | None) -> Part:
        """Return a part of the run.

        Raises
        ------
        CommandError
            This run does not have it.
        """
        if part is None:
            raise CommandError(f"{self.name}: {NOT_AVAILABLE}")
        return part

    def remains_valid(self) -> Callable[[], bool]:
        """Return a function that returns False once the client has lost control or the robot has been stopped."""
        hub, client = self.context.hub, self.client
        stops = hub.challenges.stops
        return lambda: hub.control.is_held_by(client) and not client.is_gone and hub.challenges.stops == stops


def never(_: object) -> bool:
    """Return False: the default of `Command.can_begin_motion`."""
    return False


def always(_: object) -> bool:
    """Return True: `Command.can_begin_motion` of a command that moves the robot with any arguments."""
    return True


@dataclass(frozen=True, slots=True)
class Command(Generic[Arguments]):
    """A command that clients may give."""

    name: str
    """The `type` of its messages."""
    type: type[Arguments]
    """A frozen dataclass of its arguments: an edit or a drive request itself, or one of `messages`."""
    permission: Permission
    handler: Callable[[Call, Arguments], Any]
    """Carries it out and returns the data of the answer; raises a UserError if it cannot. A coroutine function runs
    as a task of its own, one at a time for each client."""
    can_begin_motion: Callable[[Arguments], bool] = never
    """Whether the robot may begin to move by these arguments: the message must then carry a fresh challenge."""
    survives_stop: bool = False
    """Whether it may have been sent before the robot stopped: nothing moves by it before the robot is armed again."""
