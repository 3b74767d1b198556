"""A fake server for tests of the page: it speaks the console's protocol and keeps the messages received."""

from __future__ import annotations

import asyncio
import cmath
import contextlib
import itertools
import json
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from aiohttp import WSMsgType, web

from tests.browser.synthetic_run import Hall, greeting
from tests.hil.machine import TIMEOUT_S
from tests.page_types import shape_error

PAGE: Final = Path(__file__).parents[2] / "runtime" / "console" / "page"
POLICY: Final = "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'"
TOKEN: Final = "right-token"
TOML: Final = "[cycle]\nperception_budget_s = 0.005\n"
SYNC: Final = "sync"
"""A request of the tests, see `Opened.sync`; it is answered and not kept."""
LOOK_S: Final = 0.05
HEARTBEAT_S: Final = 1.0
KINDS: Final = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}

RECORDED: Final[dict[str, Any]] = {"mode": "DRIVE", "reason": None, "link": None, "late": None,
                                   "missed": None, "clients": 0, "phases": {}, "cycle_us": None, "late_us": None,
                                   "recording": None, "paused": False, "speed": 1.0}  # fmt: skip
"""Fields of a frame of a recording, in which the robot drove."""
HALTED: Final = "halted by the operator; re-arm to continue"


@dataclass
class Client:
    """A connected page."""

    socket: web.WebSocketResponse
    number: int
    sent_segments: int = 0
    gone: set[int] = field(default_factory=set)
    whole: bool = True
    last: dict[str, Any] | None = None
    """The last state sent to it."""


@dataclass
class FakeServer:
    """The robot's process as the page sees it.

    The robot moves only when a test calls `advance`. A state is sent when it has changed, after each message, and
    otherwise once a second.
    """

    hall: Hall
    mode: str = "DRIVE"
    reason: str | None = None
    paused: bool = False
    speed: float = 1.0
    recording: dict[str, Any] | None = None
    playback: dict[str, Any] | None = None
    drive_request: dict[str, Any] = field(default_factory=lambda: {"kind": "legs"})
    controller: int | None = 1
    deleted: set[int] = field(default_factory=set)
    pinned: set[int] = field(default_factory=set)
    refusals: dict[str, tuple[str, str | None]] = field(default_factory=dict)
    received: list[dict[str, Any]] = field(default_factory=list)
    clients: list[Client] = field(default_factory=list)
    cycle: int = 40
    session: dict[str, Any] = field(default_factory=dict)
    changed: list[tuple[str, Any]] = field(default_factory=list)
    areas: list[list[float]] = field(default_factory=list)
    canyons: list[dict[str, Any]] = field(default_factory=list)
    polylines: list[dict[str, Any]] = field(default_factory=list)
    known_way: dict[str, Any] = field(default_factory=lambda: {"path": [], "maps": [], "loops": []})
    cross_paths: list[dict[str, Any]] = field(default_factory=list)
    flags: list[str] = field(default_factory=list)
    data: dict[str, Any] = field(default_factory=dict)
    """What commands of other kinds are answered with, by kind."""
    silent: bool = False
    """Send no state, like a process that hangs."""
    refusing: bool = False
    """Accept no connection."""
    deaf: bool = False
    """Answer nothing, like a connection that died without being closed."""
    holds: set[str] = field(default_factory=set)
    """Kinds of commands that are answered only by `release`."""
    held: list[tuple[Client, dict[str, Any]]] = field(default_factory=list)
    connections: int = 0
    """Connections so far, with those that were refused."""
    port: int = 0
    _changed: asyncio.Event = field(default_factory=asyncio.Event)
    _counted: int = 0

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/?token={TOKEN}"

    async def wait(self, kind: str, count: int = 1) -> dict[str, Any]:
        """Wait for the `count`-th message of a kind, and return it without its id."""
        try:
            async with asyncio.timeout(TIMEOUT_S):
                while len(self.of(kind)) < count:
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError:
            raise AssertionError(f"no {kind} came, only {[m['type'] for m in self.received]}") from None
        return {
            key: value for key, value in self.of(kind)[count - 1].items() if key not in {"id", "type", "challenge"}
        }

    def of(self, kind: str) -> list[dict[str, Any]]:
        """Return the messages of a kind received so far."""
        return [m for m in self.received if m["type"] == kind]

    async def wait_for_clients(self, count: int) -> None:
        """Wait until this many pages are connected."""
        try:
            async with asyncio.timeout(TIMEOUT_S):
                while len(self.clients) != count:
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError:
            raise AssertionError(f"{len(self.clients)} pages are connected, not {count}") from None

    async def advance(self, cycles: int = 1) -> None:
        """Let the robot drive on, and send the state of each cycle."""
        for _ in range(cycles):
            self.cycle += 1
            await self.send_states()

    async def send(self, message: dict[str, Any]) -> None:
        """Send a message to every page."""
        assert shape_error(message) is None
        for client in list(self.clients):
            with contextlib.suppress(ConnectionError):
                await client.socket.send_str(json.dumps(message))

    async def release(self, *still: str) -> None:
        """Answer the commands that were held back; hold back commands of these kinds from now on."""
        self.holds = set(still)
        held, self.held = self.held, []
        for client, answer in held:
            await client.socket.send_str(json.dumps(answer))

    async def drop(self) -> None:
        """Close every connection."""
        for client in list(self.clients):
            await client.socket.close()

    def frame(self, client: Client) -> dict[str, Any]:
        """Return the next state for a page."""
        known = self.hall.known(self.cycle)
        t = self.cycle * 0.05
        numbers = range(1 if client.whole else client.sent_segments + 1, known + 1)
        removed = sorted(self.deleted - client.gone)
        segments = {
            "added": [self.hall.segment(n, t - 0.4 * (known - n)) for n in numbers if n not in self.deleted],
            "removed": removed, "pinned": sorted(self.pinned), "whole": client.whole,
        }  # fmt: skip
        client.sent_segments, client.whole = known, False
        client.gone |= set(removed)
        stopped = {} if self.mode == "DRIVE" else {"twist": [0.0, 0.0]}
        frame = self.hall.frame(self.cycle) | stopped | self.robot() | {
            "type": "state", "flags": self.flags, "areas": self.areas, "canyons": self.canyons, "segments": segments,
            "cross_paths": self.cross_paths, "polylines": self.polylines, "known_way": self.known_way,
            "drive_request": self.drive_request, "dropped": 0,
            "controller": self.controller == client.number, "playback": self.playback,
        }  # fmt: skip
        return frame if self.playback is None else frame | RECORDED

    def robot(self) -> dict[str, Any]:
        """Return the state of the robot itself."""
        return {"mode": self.mode, "reason": self.reason, "hold_reason": None, "arming": False, "paused": self.paused,
                "clients": len(self.clients), "recording": self.recording, "speed": self.speed}  # fmt: skip

    async def send_states(self) -> None:
        """Send the present state to every page."""
        for client in list(self.clients):
            await self._send_state(client, self.frame(client))

    async def _send_state(self, client: Client, frame: dict[str, Any]) -> None:
        if self.silent:
            return
        assert shape_error(frame) is None
        client.last = frame
        with contextlib.suppress(ConnectionError):
            await client.socket.send_str(json.dumps(frame))
            if self.playback is not None:
                await client.socket.send_str(json.dumps({"type": "robot", **self.robot()}))

    async def run(self) -> None:
        """Send states that have changed, and one as a heartbeat."""
        turns = round(HEARTBEAT_S / LOOK_S)
        for turn in itertools.count():
            for client in [] if self.silent else list(self.clients):
                frame = self.frame(client)
                if frame != client.last or turn % turns == 0:
                    await self._send_state(client, frame)
            await asyncio.sleep(LOOK_S)

    async def index(self, _request: web.Request) -> web.StreamResponse:
        return _file(PAGE / "index.html")

    async def file(self, request: web.Request) -> web.StreamResponse:
        return _file(PAGE / request.match_info["file"])

    async def talk(self, request: web.Request) -> web.StreamResponse:
        if "upgrade" in request.headers:
            self.connections += 1
        if self.refusing:
            raise web.HTTPServiceUnavailable
        if request.query.get("token") != TOKEN:
            raise web.HTTPForbidden(text="wrong token")
        socket = web.WebSocketResponse(max_msg_size=1 << 16)
        await socket.prepare(request)
        self._counted += 1
        client = Client(socket, self._counted)
        role = "control" if self.controller == client.number else "watch"
        await socket.send_str(json.dumps((self.session or greeting()) | {"role": role, "client": client.number}))
        self.clients.append(client)
        self._changed.set()
        await self._send_state(client, self.frame(client))
        try:
            async for message in socket:
                if message.type is WSMsgType.TEXT:
                    await self._hear(client, json.loads(message.data))
        finally:
            self.clients.remove(client)
            self._changed.set()
        return socket

    async def _hear(self, client: Client, message: dict[str, Any]) -> None:
        kind = message["type"]
        if kind != SYNC:
            self.received.append(message)
            self._changed.set()
        if self.deaf:
            return
        error, at = self.refusals.get(kind, (None, None))
        data = None
        if error is None:
            data = self._heed(client, kind, message)
        answer = {
            "type": "answer",
            "id": message["id"],
            "ok": error is None,
            "error": error,
            "field": at,
            "data": data,
        }
        if kind in self.holds:
            self.held.append((client, answer))
            return
        if kind == SYNC:
            await self.send_states()
        await client.socket.send_str(json.dumps(answer))
        if kind != SYNC:
            await self.send_states()

    def _heed(self, client: Client, kind: str, message: dict[str, Any]) -> Any:
        match kind:
            case "halt":
                self.mode, self.reason = "SAFE_STOP", HALTED
            case "arm":
                self.mode, self.reason = "DRIVE", None
            case "disarm":
                self.mode, self.reason = "READY", None
            case "take_control" if self.controller is None:
                self.controller = client.number
            case "release_control":
                self.controller = None
            case "legs" | "goal":
                self.drive_request = {"kind": kind, **{k: message[k] for k in message.keys() & {"x", "y"}}}
            case "pause" | "resume":
                self.paused = kind == "pause"
            case "single_step":
                self.cycle += 1
            case "set_speed":
                self.speed = message["factor"]
            case "record":
                self.recording = {"file": "runs/now.mcap", "bytes": 120_000, "dropped": 0} if message["on"] else None
            case "delete_segments":
                self.deleted |= set(message["numbers"])
            case "pin_segments":
                self.pinned = self.pinned | set(message["numbers"]) if message["pinned"] else (
                    self.pinned - set(message["numbers"]))  # fmt: skip
            case "evidence":
                return self._evidence(message["object"])
            case "set_parameter":
                self.changed.append((message["path"], message["value"]))
            case "undo_edit":
                return "reject_object"
            case "undo_parameter":
                return {"path": self.changed.pop()[0], "value": 1.0} if self.changed else None
            case "save_toml":
                return TOML
            case "list_jobs" if kind not in self.data:
                return []
            case "list_recordings" if kind not in self.data:
                return [
                    {
                        "file": "now.mcap",
                        "bytes": None,
                        "modified_s": None,
                        "duration_s": None,
                        "state": "live",
                        "pinned": False,
                        "live": True,
                    },
                    {
                        "file": "2026-01-02-first.mcap",
                        "bytes": 1_500_000,
                        "modified_s": 1.0,
                        "duration_s": 3725.0,
                        "state": "complete",
                        "pinned": False,
                        "live": False,
                    },
                ]
            case "open_recording":
                self.playback = {"s": 0.0, "is_playing": False, "speed": 1.0}
                about = {key: value for key, value in greeting(name="older").items() if key not in {"type", "role"}}
                return {
                    "file": message["file"],
                    "duration_s": 21.5,
                    "cycles": 430,
                    "bookmarks": [[4.5, "the corner"]],
                    "modes": [[0.0, "DRIVE", None], [9.0, "SAFE_STOP", "bumper contact"]],
                    "about": about,
                }
            case "seek_recording" if self.playback is not None:
                self.playback["s"] = message["s"]
            case "play_recording" if self.playback is not None:
                self.playback["is_playing"] = message["speed"] > 0
            case "close_recording":
                self.playback = None
        return self.data.get(kind)

    def _evidence(self, number: int) -> dict[str, Any]:
        x, y = self.hall.places[number - 1]
        readings: list[list[float | None]] = [[0.0, 0.0, None, 0.0, -0.4]]
        for i in range(11):
            px, py = 0.25 * i, 0.0
            angle, away = _polar(x - px, y - py)
            readings.append([px, py, away - 0.3 + (0.4 if i % 5 == 4 else 0.0), angle, -1.2 if i % 5 == 4 else 2.1])
        return {"object": number, "model": "drum", "for": 21.4, "against": 2.4, "readings": readings, "lines": [],
                "rivals": [["wall", -12.5], ["post", 1.5]]}  # fmt: skip


def _polar(x: float, y: float) -> tuple[float, float]:
    away, angle = cmath.polar(complex(x, y))
    return angle, away


def _file(path: Path) -> web.Response:
    if not path.is_file():
        raise web.HTTPNotFound
    caching = "no-store" if path.suffix == ".html" else "max-age=3600, immutable"  # no test changes them
    headers = {"Content-Security-Policy": POLICY, "Cache-Control": caching}
    return web.Response(body=path.read_bytes(), content_type=KINDS[path.suffix], charset="utf-8", headers=headers)


@contextlib.asynccontextmanager
async def serving(hall: Hall, port: int = 0) -> AsyncIterator[FakeServer]:
    """Serve a page of a hall on a port, or on a free one where that has been taken meanwhile."""
    server = FakeServer(hall)
    app = web.Application()
    app.add_routes([
        web.get("/", server.index), web.get("/page/{file}", server.file),
        web.get("/ws", server.talk),
    ])  # fmt: skip
    runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0)
    await runner.setup()
    try:
        await web.TCPSite(runner, "127.0.0.1", port, reuse_address=True).start()
    except OSError:
        await web.TCPSite(runner, "127.0.0.1", 0).start()
    server.port = runner.addresses[0][1]
    task = asyncio.create_task(server.run())
    try:
        yield server
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
        await server.drop()
        await runner.cleanup()
