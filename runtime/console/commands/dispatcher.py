"""The command dispatcher: reads a client's message, checks its permission and age, runs the handler, and answers."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from inspect import iscoroutinefunction
from typing import Any, Final, Protocol

from behaviors.teleoperation import TELEOPERATION_ENDED
from config.errors import UserError
from perception.undo import Undo
from runtime.console.clients.client import Client
from runtime.console.commands.command import ANSWERED_LATER, Call, Command, CommandContext, Permission
from runtime.console.commands.command_error import CommandError
from runtime.console.commands.messages import MalformedMessage, Message
from runtime.console.commands.registry import COMMANDS, reader
from runtime.console.http.client_limits import ConsoleLog
from runtime.console.sent_messages import AnswerMessage

NO_TOKEN: Final = "this page may only watch: open the start URL with its token to do more"  # noqa: S105 - a text
NOT_IN_CONTROL: Final = "another client has control: ask for it first"
BUSY: Final = "the previous command of this page is still running: wait for it"
LOGGED: Final = frozenset({"halt", "arm", "disarm"})
"""Commands that the log names when they are given."""


class StartTask(Protocol):
    """Starts a task for a client, which the console watches and ends."""

    def __call__(self, client: Client, work: Callable[[], Awaitable[None]], /) -> None:
        """Start it."""


class CommandDispatcher:
    """Carries out the commands of all clients.

    `log` gets requests to the robot, and whatever is refused; `start_task` runs the handlers that are coroutines.
    """

    def __init__(self, context: CommandContext, log: ConsoleLog, start_task: StartTask) -> None:
        self._context = context
        self._log = log
        self._start_task = start_task

    def receive(self, client: Client, text: str | bytes) -> None:
        """Carry out a message, or answer why not; never raises for what a client can cause."""
        try:
            message = reader().read(text)
        except MalformedMessage as error:
            self._refuse(client, error.id, CommandError(str(error), error.field))
            return
        try:
            data = self._run(client, message)
        except UserError as error:
            self._refuse(client, message.id, error)
        else:
            if data is not ANSWERED_LATER:
                _answer(client, message.id, data)

    def edits_done(self, outcomes: Sequence[tuple[str | None, Undo]]) -> None:
        """Answer the edits that a cycle carried out.

        In the order in which they were queued, an outcome is why the edit failed, None if it is done, and what takes
        back what was done of it.
        """
        for reason, undo in outcomes:
            if not self._context.pending_edits:
                return
            done = self._context.pending_edits.popleft()
            if not done.is_undo:
                self._context.history.add(done.edit, undo)
            if reason is not None:
                self._refuse(done.client, done.id, CommandError(reason))
                continue
            if done.id is not None:
                _answer(done.client, done.id, done.data)

    def end_teleoperation(self) -> None:
        """End teleoperation, if it is under way: the client that had control has lost it."""
        if self._context.is_teleoperated:
            self._context.is_teleoperated = False
            self._context.robot.drive_request(TELEOPERATION_ENDED)

    def _run(self, client: Client, message: Message) -> Any:  # noqa: ANN401 - the data of any answer
        """Carry out a command and return the data of its answer; `ANSWERED_LATER` if it goes on as a task.

        Raises
        ------
        CommandError
            It is refused.
        """
        command = COMMANDS[message.name]
        self._check_permission(client, command)
        if command.can_begin_motion(message.arguments):
            reason = self._context.hub.challenges.refusal_reason(
                message.challenge, survives_stop=command.survives_stop
            )
            if reason is not None:
                raise CommandError(f"{message.name}: {reason}")
        call = Call(self._context, client, message.id, message.name)
        if iscoroutinefunction(command.handler):
            return self._start(call, command, message)
        data = command.handler(call, message.arguments)
        if message.name in LOGGED:
            self._log.note(f"console command: {message.name}", client=client.name)
        return data

    def _check_permission(self, client: Client, command: Command[Any]) -> None:
        """Check that a client may give a command; one that needs control counts as a use of it.

        Raises
        ------
        CommandError
            It may not.
        """
        if not client.has_token:
            raise CommandError(NO_TOKEN)
        if command.permission is Permission.CONTROL:
            if not self._context.hub.control.is_held_by(client):
                raise CommandError(NOT_IN_CONTROL)
            self._context.hub.control.note_use(client, self._context.clock())

    def _start(self, call: Call, command: Command[Any], message: Message) -> object:
        """Start the task that runs a handler and answers.

        Raises
        ------
        CommandError
            A command of this client is still under way.
        """
        if call.client.is_busy:
            raise CommandError(BUSY)

        async def run() -> None:
            try:
                data = await command.handler(call, message.arguments)
            except UserError as error:
                self._refuse(call.client, call.id, error)
            else:
                _answer(call.client, call.id, data)

        self._start_task(call.client, run)
        return ANSWERED_LATER

    def _refuse(self, client: Client, number: int | None, error: UserError) -> None:
        self._log.answer_refusal(str(error), client.name)
        _send_answer(client, number, None, error)


def _answer(client: Client, number: int, data: object) -> None:
    _send_answer(client, number, data, None)


def _send_answer(client: Client, number: int | None, data: object, error: UserError | None) -> None:
    """Send the answer to the command of this number: its data, or the error for which it was refused.

    A `CommandError` also names the field of the page that is wrong.
    """
    answer: AnswerMessage = {
        "type": "answer",
        "id": number,
        "ok": error is None,
        "error": None if error is None else str(error),
        "field": error.field if isinstance(error, CommandError) else None,
        "data": data,
    }
    client.send(answer)
