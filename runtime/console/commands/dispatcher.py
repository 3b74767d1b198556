"""From a message to what is done about it: may it be said, by this client, now; then it goes to whom it concerns.

Everything that moves or changes becomes an input of the next cycle. Only a HALT does not wait for one, and nobody
needs the control for it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, Final, NamedTuple, Protocol

from behaviors.move_to_goal import Goal
from behaviors.teleoperation import TELEOPERATION_ENDED, Teleoperate
from config.reload import Difference
from runtime.console.clients.client import Client
from runtime.console.clients.client_hub import Hub
from runtime.console.commands import messages as forms
from runtime.console.commands.async_commands import AsyncCommands, Work
from runtime.console.commands.command_error import CommandError
from runtime.console.commands.edit_messages import EditForm, edit_in
from runtime.console.commands.messages import MalformedMessage, Message, Right, read_message
from runtime.console.commands.tuning import Tuning
from runtime.console.http.client_limits import ConsoleLog
from runtime.console.protocols import Robot
from runtime.cycle.drive_requests import DriveRequest, Legs
from runtime.cycle.inputs import Request

FORBIDDEN: Final = "this page only watches: open the start URL with its token to do more"
NOT_IN_CONTROL: Final = "another client has the control: ask for it first"


LATER: Final = object()
"""The answer comes when the thing is done."""


class Asked(NamedTuple):
    """An edit on its way through a cycle, and who waits for what comes of it."""

    client: Client
    number: int


class Spawn(Protocol):
    """Has work done by a task that is looked after."""

    def __call__(self, client: Client, work: Callable[[], Awaitable[None]], /) -> None:
        """Begin it."""


class CommandDispatcher:
    """Takes what clients say.

    Parameters
    ----------
    robot : Robot
        The robot's process.
    hub : Hub
        All clients.
    tuning : Tuning
        The settings.
    async_commands : AsyncCommands
        Does what takes its time.
    notes : ConsoleLog
        Told of who asks the robot for something, and of whatever is refused.
    spawn : Spawn
        Has that done.
    clock : callable
        Monotonic, s.
    """

    def __init__(
        self, robot: Robot, hub: Hub, tuning: Tuning, async_commands: AsyncCommands, notes: ConsoleLog, spawn: Spawn,
        clock: Callable[[], float],
    ) -> None:  # fmt: skip
        self._robot = robot
        self._hub = hub
        self._tuning = tuning
        self._overtime = async_commands
        self._notes = notes
        self._spawn = spawn
        self._clock = clock
        self._asked: deque[Asked] = deque()
        self._is_by_hand = False

    def take(self, client: Client, text: str | bytes) -> None:
        """Do what a message says, or answer why not; never raises for what a client can cause."""
        number: int | None = None
        try:
            message = read_message(text)
            number = message.id
            self._allow(client, message)
            data = self._do(client, message)
        except MalformedMessage as bad:
            self._refuse(client, bad.number, CommandError(str(bad), bad.field))
        except CommandError as refusal:
            self._refuse(client, number, refusal)
        else:
            if data is not LATER:
                _answer(client, message.id, data)

    def edited(self, outcomes: Sequence[str | None]) -> None:
        """Take what came of the edits of a cycle, in the order in which they were asked for."""
        for validate in outcomes:
            if not self._asked:
                return
            asked = self._asked.popleft()
            if validate is None:
                _answer(asked.client, asked.number, None)
            else:
                self._refuse(asked.client, asked.number, CommandError(validate))

    def release_teleoperation(self) -> None:
        """Let nobody's hand be on the stick any more: whoever had the control has it no longer."""
        if self._is_by_hand:
            self._is_by_hand = False
            self._robot.drive_request(TELEOPERATION_ENDED)

    def _allow(self, client: Client, message: Message) -> None:
        if not client.has_token:
            raise CommandError(FORBIDDEN)
        if message.right is Right.CONTROL:
            if not self._hub.control.has(client):
                raise CommandError(NOT_IN_CONTROL)
            self._hub.control.used(client, self._clock())

    def _do(self, client: Client, message: Message) -> Any:  # noqa: ANN401 - whatever the page is to have
        match message:
            case forms.Halt() | forms.Arm() | forms.Disarm():
                self._robot.request(Request(message.type))
                self._notes.tell(f"the console asks to {message.type}", client.name)
            case forms.RequestLegs() | forms.RequestGoal() | forms.Teleoperate():
                self._drive_request(message)
            case forms.TakeControl() | forms.GiveControl() | forms.Grant():
                self._hand_over(client, message)
            case forms.Set() | forms.Undo() | forms.SaveToml():
                return self._tune(message)
            case forms.LoadModel(toml=toml):
                return self._begin(client, message.id, lambda: self._load(toml))
            case forms.Evidence(object=number):
                return self._evidence(number)
            case (
                forms.ClearMap() | forms.DeleteSegments() | forms.PinSegments() | forms.PlaceModel()
                | forms.MoveObject() | forms.RejectObject() | forms.ConfirmObject()
            ):  # fmt: skip
                return self._edit(client, message)
            case _:
                return self._begin(client, message.id, self._overtime.of(client, message))
        return None

    def _drive_request(self, message: forms.RequestLegs | forms.RequestGoal | forms.Teleoperate) -> None:
        match message:
            case forms.RequestLegs():
                drive_request: DriveRequest = Legs()
            case forms.RequestGoal(x=x, y=y):
                drive_request = Goal(x, y)
            case forms.Teleoperate(v=v, w=w):
                drive_request = Teleoperate(v, w, self._tuning.current.behaviors.teleoperation.message_age_max_s)
        self._is_by_hand = isinstance(drive_request, Teleoperate)
        self._robot.drive_request(drive_request)

    def _hand_over(self, client: Client, message: forms.TakeControl | forms.GiveControl | forms.Grant) -> None:
        control, validate = self._hub.control, None
        match message:
            case forms.TakeControl():
                validate = control.take(client, self._clock())
            case forms.GiveControl():
                control.give()
            case forms.Grant(client=number):
                validate = control.grant(number)
        if validate is not None:
            raise CommandError(validate)

    def _tune(self, message: forms.Set | forms.Undo | forms.SaveToml) -> Any:  # noqa: ANN401
        match message:
            case forms.Set(path=path, value=value):
                return _rows(self._tuning.set(path, value))
            case forms.Undo():
                rows = _rows(self._tuning.undo())
                return rows[0] if len(rows) == 1 else rows
            case forms.SaveToml():
                return self._tuning.saved()

    async def _load(self, toml: str) -> dict[str, str]:
        return {"name": (await self._tuning.add_model(toml)).name}

    def _evidence(self, number: int) -> dict[str, Any]:
        found = self._robot.evidence(number)
        if found is None:
            raise CommandError(f"object {number} is not there any more")
        return {
            "object": found.object,
            "model": found.model,
            "for": found.supporting,
            "against": -found.opposing,
            "readings": [[a.x, a.y, a.range_m, a.direction, a.nats] for a in found.arcs],
            "lines": [[line.number, line.x1, line.y1, line.x2, line.y2, line.supports] for line in found.lines],
            "rivals": found.rivals,
        }

    def _edit(self, client: Client, message: EditForm) -> object:
        if not self._robot.edit(edit_in(message)):
            raise CommandError("too many changes wait for the next cycle: try again")
        self._asked.append(Asked(client, message.id))
        return LATER

    def _begin(self, client: Client, number: int, work: Work) -> object:
        if client.is_busy:
            raise CommandError("what was asked for before is still under way")

        async def done() -> None:
            try:
                data = await work()
            except CommandError as refusal:
                self._refuse(client, number, refusal)
            else:
                _answer(client, number, data)

        self._spawn(client, done)
        return LATER

    def _refuse(self, client: Client, number: int | None, refusal: CommandError) -> None:
        self._notes.refuse(str(refusal), client.name)
        _say(client, number, None, refusal)


def _rows(changed: Sequence[Difference]) -> list[dict[str, Any]]:
    """Return changes of plain values as the page shows them."""
    plain = (bool, int, float, str, type(None))
    return [{"path": d.path, "value": d.after} for d in changed if isinstance(d.after, plain)]


def _answer(client: Client, number: int, data: Any) -> None:  # noqa: ANN401 - whatever the page is to have
    _say(client, number, data, None)


def _say(client: Client, number: int | None, data: Any, refusal: CommandError | None) -> None:  # noqa: ANN401
    client.say(
        {
            "type": "answer",
            "id": number,
            "ok": refusal is None,
            "error": None if refusal is None else str(refusal),
            "field": None if refusal is None else refusal.field,
            "data": data,
        }
    )
