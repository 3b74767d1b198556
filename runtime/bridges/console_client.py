"""A client of the console's protocol: the messages of a run, and commands to it, as a page has them.

docs/console-protocol.md describes the protocol. A client connects with the start URL that a run prints, and takes the
messages one by one::

    async with connect(url) as console:
        async for message in console.messages():
            if message["type"] == "state":
                print(message["mode"], message["pose"])

It keeps the newest challenge and sends it with every command. Messages that are not taken are kept up to a bound;
beyond it the oldest states are dropped, never a line of the log. Segments arrive as changes; the client itself keeps
the list.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from types import MappingProxyType
from typing import Any, Final, TypeAlias

import aiohttp
import orjson
from yarl import URL

from config.errors import WRONG_CALL, UserError

Message: TypeAlias = dict[str, Any]

ANSWER_MAX_S: Final = 10.0
"""Longest wait for the answer to a command."""
SILENCE_MAX_S: Final = 10.0
"""A run sends something at least every second; after this long without it the connection is lost."""
CONNECT_MAX_S: Final = 5.0
KEPT_MAX: Final = 256
"""Messages that may wait to be taken."""
RUN_OVER: Final = "the run is over"
"""How a connection ends that the run itself has closed."""
RETRY_FIRST_S: Final = 0.25
RETRY_MAX_S: Final = 2.0
"""Waits between attempts to connect; each is twice the one before."""

_REFUSED: Final = MappingProxyType(
    {
        403: "the run refuses the token: it changes with every run, so copy the start URL that this run printed",
        421: "the run does not know itself by this name: use the address that it printed",
        503: "too many pages are open: close some, or raise console.clients_max",
    }
)


class ConsoleError(UserError):
    """A run cannot be reached, refuses a command, or has gone: what happened, the likely cause, the next action."""


class ConsoleClient:
    """One connection to a run; `connect` makes it."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.session: Message = {}
        """The newest session message: the robot, its ring, models, settings. Empty before the first one."""
        self.segments: dict[int, list[float]] = {}
        """The outline segments of the map by number: x1, y1, x2, y2 (m), direction of the normal (rad), time (s)."""
        self.archived: list[Message] = []
        """The objects left behind, as in a state's `objects`."""
        self.polylines: list[Message] = []
        """The outlines of what is not straight, as in a state's `polylines`."""
        self.has_control = False
        """Whether this client may move the robot."""
        self.asked_by: int | None = None
        """The number of the client that asks this one for control."""
        self.dropped = 0
        """States that were not taken in time."""
        self._socket = socket
        self._challenge: int | None = None
        """The newest challenge; None before the first."""
        self._id = 0
        """Number of the last command."""
        self._answers: dict[int, asyncio.Future[Any]] = {}
        """Commands that wait for their answer, by number."""
        self._kept: deque[Message] = deque()
        """Messages that `messages` has yet to yield."""
        self._arrived = asyncio.Event()
        """Set when one is kept, or the connection has ended."""
        self._end: ConsoleError | None = None
        """Why the connection ended; None while it lasts."""

    async def messages(self) -> AsyncIterator[Message]:
        """Yield every message but answers and challenges, in order, until the connection ends.

        Raises
        ------
        ConsoleError
            The connection ended; it says how.
        """
        while True:
            while self._kept:
                yield self._kept.popleft()
            if self._end is not None:
                raise self._end
            self._arrived.clear()
            await self._arrived.wait()

    async def request(self, command: str, **arguments: object) -> Any:  # noqa: ANN401 - the data of any answer
        """Send a command with the newest challenge, wait for its answer and return the answer's data.

        docs/console-protocol.md lists commands, as `halt`, with their arguments.

        Raises
        ------
        ConsoleError
            The run refuses it, or no answer came.
        """
        if self._end is not None:
            raise self._end
        self._id += 1
        number = self._id
        answer = self._answers[number] = asyncio.get_running_loop().create_future()
        challenge = {} if self._challenge is None else {"challenge": self._challenge}
        try:
            async with asyncio.timeout(ANSWER_MAX_S):
                text = orjson.dumps({"id": number, "type": command, **challenge, **arguments}).decode()
                await self._socket.send_str(text)
                return await answer
        except TimeoutError:
            raise ConsoleError(f"{command}: no answer in {ANSWER_MAX_S:g} s; the run hangs or is paused") from None
        except (ConnectionError, aiohttp.ClientError) as error:
            raise ConsoleError(f"{command}: the connection is lost ({error}); it may not have arrived") from error
        finally:
            del self._answers[number]

    async def receive(self) -> None:
        """Receive until the connection ends; `connect` runs this as a task."""
        reason = "the run has ended or dropped this client; look at its log"
        try:
            while True:
                message = await self._socket.receive(timeout=SILENCE_MAX_S)
                if message.type is not aiohttp.WSMsgType.TEXT:
                    if self._socket.close_code == aiohttp.WSCloseCode.GOING_AWAY:
                        reason = RUN_OVER
                    return
                self._take(orjson.loads(message.data))
        except TimeoutError:
            reason = f"nothing came from the run for {SILENCE_MAX_S:g} s; it hangs, or the network is cut"
        except (ValueError, KeyError, TypeError) as error:
            reason = f"the run sends what this client does not understand ({error!r}); install the same version"
        finally:
            self._finish(ConsoleError(reason))

    def _take(self, message: Message) -> None:
        """Take in a message: update what this client knows by it, and keep it for `messages`."""
        match message["type"]:
            case "answer":
                self._answer(message)
                return
            case "challenge":
                self._challenge = message["number"]
                return
            case "session":
                self.session = message
                self.has_control = message["role"] == "control"
            case "parameters":
                self.session["parameters"] = message["parameters"]
            case "role":
                self.has_control, self.asked_by = message["role"] == "control", message["client"]
            case "state":
                self.has_control = message["controller"]
                self._take_map(message)
        self._keep(message)

    def _take_map(self, state: Message) -> None:
        """Update segments, archived objects and polylines by what a state changes."""
        changes = state["segments"]
        if changes["whole"]:
            self.segments.clear()
        for number in changes["removed"]:
            self.segments.pop(number, None)
        for number, *row in changes["added"]:
            self.segments[number] = row
        self.archived = state.get("archived", self.archived)
        self.polylines = state.get("polylines", self.polylines)

    def _answer(self, message: Message) -> None:
        """Give an answer to the command that waits for it; one that no longer waits gets none."""
        waiting = self._answers.get(message["id"])
        if waiting is None or waiting.done():
            return
        if message["ok"]:
            waiting.set_result(message["data"])
        else:
            waiting.set_exception(ConsoleError(str(message["error"])))

    def _keep(self, message: Message) -> None:
        """Keep a message until it is taken; if there are too many, drop the oldest state, or else the oldest."""
        if len(self._kept) >= KEPT_MAX:
            oldest = next((one for one in self._kept if one["type"] == "state"), self._kept[0])
            self._kept.remove(oldest)
            self.dropped += 1
        self._kept.append(message)
        self._arrived.set()

    def _finish(self, reason: ConsoleError) -> None:
        """End the connection for a reason: whatever waits for a message or an answer gets it as its error."""
        self._end = reason
        for waiting in self._answers.values():
            if not waiting.done():
                waiting.set_exception(ConsoleError(f"{reason}; the command may not have been carried out"))
        self._arrived.set()


def _why(error: Exception) -> str:
    """Return why there is no connection, as the system says it."""
    cause = error.os_error if isinstance(error, aiohttp.ClientConnectorError) else error
    if isinstance(cause, OSError) and cause.errno is not None and cause.errno > 0:
        return os.strerror(cause.errno)  # asyncio's own text repeats the address
    return getattr(cause, "strerror", None) or str(error) or "no answer"


@asynccontextmanager
async def connect(url: str) -> AsyncIterator[ConsoleClient]:
    """Connect to a run and yield the client; disconnect at the end.

    The URL is the start URL that the run printed, with its token.

    Raises
    ------
    ConsoleError
        The URL is wrong, no run answers there, or it refuses the client.
    """
    address = _address(url)
    timeout = aiohttp.ClientTimeout(total=None, sock_connect=CONNECT_MAX_S, sock_read=None)
    async with aiohttp.ClientSession(timeout=timeout) as http:
        try:
            socket = await http.ws_connect(
                address.with_path("/ws").with_query(address.query),
                headers={"Origin": str(address.origin())},
                max_msg_size=0,
            )
        except aiohttp.WSServerHandshakeError as error:
            text = _REFUSED.get(error.status, f"it answers with HTTP status {error.status}; is it echolocate?")
            raise ConsoleError(f"{address.origin()}: {text}") from error
        except (aiohttp.ClientError, OSError, TimeoutError) as error:
            why = f"no run answers on {address.origin()} ({_why(error)})"
            raise ConsoleError(f"{why}; start `echolocate run`, or correct the address") from error
        client = ConsoleClient(socket)
        receiving = asyncio.create_task(client.receive(), name="console client")
        try:
            yield client
        finally:
            receiving.cancel()
            await asyncio.gather(receiving, return_exceptions=True)
            with contextlib.suppress(ConnectionError, aiohttp.ClientError):
                await socket.close()


async def stay_connected(
    find: Callable[[], str], serve: Callable[[ConsoleClient], Awaitable[None]], report: Callable[[str], None]
) -> None:
    """Connect, serve until the connection ends, and connect again, until cancelled.

    `find` returns the start URL for each attempt, as the next run has another token; `report` gets one line for each
    different problem.
    """
    wait_s, reported = RETRY_FIRST_S, ""
    while True:
        try:
            async with connect(find()) as client:
                wait_s, reported = RETRY_FIRST_S, ""
                await serve(client)
        except UserError as error:
            if str(error) != reported:
                reported = str(error)
                report(f"{reported}; connecting again")
        await asyncio.sleep(wait_s)
        wait_s = min(2.0 * wait_s, RETRY_MAX_S)


def _address(url: str) -> URL:
    """Return a start URL.

    Raises
    ------
    ConsoleError
        It is none.
    """
    try:
        address = URL(url)
        if address.scheme == "http" and address.host and address.port:
            return address
    except ValueError:
        pass
    raise ConsoleError(
        f"{url.partition('?')[0][:80]!a} is no address of a run: give the start URL that it printed", WRONG_CALL
    )
