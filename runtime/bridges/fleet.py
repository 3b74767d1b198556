"""Several runs at a time, as clients of their consoles: what each does, HALT for one and HALT for all.

A HALT counts as confirmed when the run has answered it and then shows a mode other than DRIVE. What is not confirmed
in time is shown so, and sent again on each new connection until it is.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias, TypedDict
from urllib.parse import urlsplit

from config.errors import UserError
from runtime.bridges.console_client import RETRY_MAX_S, RUN_OVER, ConsoleClient, ConsoleError, Message, connect

CONFIRM_MAX_S: Final = 0.7
"""A HALT that is not confirmed after this time is unconfirmed, s: the page, which asks five times a second, shows it
within a second."""
SILENT_S: Final = 1.5
"""A run sends a state every second at least; after this time without one it is shown as silent, s."""
LOOK_S: Final = 1.0
"""Interval at which new runs of this machine are looked for, s."""
NEAR_M: Final = 1.0
"""A robot so near to a named place is shown there, m."""
RUNS_MAX: Final = 64

Halt: TypeAlias = Literal["none", "sent", "confirmed", "unconfirmed"]


class FleetRow(TypedDict):
    """A run as the fleet page shows it."""

    address: str
    url: str
    name: str
    is_local: bool
    problem: str
    mode: str
    reason: str
    battery: str
    place: str
    halt: Halt


@dataclass(slots=True)
class FleetRun:
    """One run: its connection, its newest state, and its HALT."""

    url: str = field(repr=False)
    """The start URL, with the token."""
    is_local: bool
    client: ConsoleClient | None = None
    is_over: bool = False
    """Whether it has said that it ends, and has not been reached since."""
    problem: str = "connecting"
    """Why there is no connection; empty while there is one."""
    state: Message = field(default_factory=dict)
    state_s: float = -math.inf
    """When the newest state arrived, by the fleet's clock."""
    halt: Halt = "none"
    halted_s: float = -math.inf
    """When HALT was asked for."""
    answered_s: float = math.inf
    """When the run answered it; infinite before."""
    task: asyncio.Task[None] | None = None
    halting: asyncio.Task[None] | None = None

    @property
    def address(self) -> str:
        """Host and port, without the token."""
        return urlsplit(self.url).netloc


class Fleet:
    """The runs of one operator.

    The clock is monotonic. `find_local` returns the start URLs of this machine's runs, and raises UserError where
    there is none.
    """

    def __init__(self, clock: Callable[[], float], find_local: Callable[[], Iterable[str]]) -> None:
        self._clock = clock
        self._find_local = find_local
        self.runs: list[FleetRun] = []

    def add(self, url: str, *, is_local: bool = False) -> str | None:
        """Follow a run from now on; return why it is refused, None if it is not."""
        parts = urlsplit(url)
        if parts.scheme != "http" or not parts.netloc or "token=" not in parts.query:
            return "give the start URL that the run printed, with its token: http://HOST:PORT/?token=…"
        known = next((run for run in self.runs if run.address == parts.netloc), None)
        if known is not None:
            if known.url == url:
                return None if is_local else f"{parts.netloc} is in the list already"
            self.remove(known.address)  # another run on the same port
        if len(self.runs) >= RUNS_MAX:
            return f"{RUNS_MAX} runs are in the list, which is the limit: remove one first"
        run = FleetRun(url, is_local)
        run.task = asyncio.get_running_loop().create_task(self._follow(run), name=f"fleet {run.address}")
        self.runs.append(run)
        return None

    def remove(self, address: str) -> None:
        """Follow the run at an address no longer."""
        for run in [run for run in self.runs if run.address == address]:
            self.runs.remove(run)
            for task in (run.task, run.halting):
                if task is not None:
                    task.cancel()

    def halt(self, address: str | None) -> int:
        """Ask for HALT of the run at an address, or of all; return of how many. `rows` says what became of it."""
        asked = [run for run in self.runs if address in {None, run.address}]
        for run in asked:
            run.halt, run.halted_s, run.answered_s = "sent", self._clock(), math.inf
            self._send_halt(run)
        return len(asked)

    def rows(self) -> list[FleetRow]:
        """Return what is known of each run, without tokens."""
        now_s = self._clock()
        for run in self.runs:
            _judge_halt(run, now_s)
        return [_row(run, now_s) for run in self.runs]

    async def watch_local(self) -> None:
        """Follow every run of this machine, until cancelled; one that has ended leaves the list.

        One that is gone without a word, as when it was killed, stays until the operator removes it.
        """
        while True:
            try:
                urls = set(await asyncio.to_thread(lambda: list(self._find_local())))
            except UserError:
                urls = set()
            for url in sorted(urls):
                self.add(url, is_local=True)
            for run in [run for run in self.runs if run.is_local and run.url not in urls and run.client is None]:
                if run.is_over or not run.state:
                    self.remove(run.address)
                run.is_local = False
            await asyncio.sleep(LOOK_S)

    async def close(self) -> None:
        """End all connections."""
        tasks = [task for run in self.runs for task in (run.task, run.halting) if task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _send_halt(self, run: FleetRun) -> None:
        """Begin to send a run HALT, in place of an attempt that still waits."""
        if run.halting is not None:
            run.halting.cancel()
        run.halting = asyncio.get_running_loop().create_task(self._halt(run), name=f"halt {run.address}")

    async def _halt(self, run: FleetRun) -> None:
        """Send HALT if there is a connection, and note when it was answered."""
        if run.client is not None:
            try:
                await run.client.request("halt")
            except ConsoleError:
                return  # `_judge_halt` shows it as unconfirmed
            run.answered_s = self._clock()

    async def _follow(self, run: FleetRun) -> None:
        """Keep a connection to a run, until cancelled."""
        while True:
            try:
                async with connect(run.url) as client:
                    run.client, run.problem, run.is_over = client, "", False
                    if run.halt in {"sent", "unconfirmed"}:
                        self._send_halt(run)
                    async for message in client.messages():
                        if message["type"] == "session" and client.has_control:
                            await client.request("release_control")  # the first client gets it; a page is to have it
                        if message["type"] == "state":
                            run.state, run.state_s = message, self._clock()
            except ConsoleError as error:
                run.problem = str(error)
                run.is_over = run.is_over or run.problem == RUN_OVER
            finally:
                run.client = None
            await asyncio.sleep(RETRY_MAX_S / 2.0)


def _judge_halt(run: FleetRun, now_s: float) -> None:
    """Take a HALT as confirmed once a state after its answer shows that the run does not drive."""
    if run.halt == "confirmed" and run.state.get("mode") == "DRIVE":
        run.halt = "none"  # it was armed again
    if run.halt not in {"sent", "unconfirmed"}:
        return
    if run.state_s >= run.answered_s and run.state.get("mode") != "DRIVE":
        run.halt = "confirmed"
    elif now_s - run.halted_s > CONFIRM_MAX_S:
        run.halt = "unconfirmed"


def _row(run: FleetRun, now_s: float) -> FleetRow:
    """Return what the page shows of a run, at a time of the fleet's clock, s."""
    state, session = run.state, {} if run.client is None else run.client.session
    age_s = now_s - run.state_s
    silent = f"nothing has come for {age_s:.0f} s" if state and age_s > SILENT_S else ""
    return {
        "address": run.address,
        "url": f"http://{run.address}/",
        "name": session.get("name") or "",
        "is_local": run.is_local,
        "problem": run.problem or silent,
        "mode": state.get("mode", ""),
        "reason": state.get("reason") or state.get("hold_reason") or "",
        "battery": "" if not state else "low" if "BATTERY_LOW" in state["flags"] else "no warning",
        "place": _place(state, session) if state else "",
        "halt": run.halt,
    }


def _place(state: Message, session: Message) -> str:
    """Return where the robot is: beside a named place, in the map, or in the odometry of its run."""
    localized: Message | None = state.get("localized")
    places: Message = session.get("places") or {}
    known = localized if localized is not None and localized["status"] == "tracking" else None
    x, y = (state if known is None else known)["pose"][:2]
    in_map = known is not None
    if in_map == (places.get("frame") == "map"):
        near = sorted((math.hypot(x - p["x_m"], y - p["y_m"]), p["name"]) for p in places.get("place", ()))
        if near and near[0][0] <= NEAR_M:
            return f"at {near[0][1]}"
    if localized is not None and not in_map:
        return "place in the map not known"
    return f"{x:z.1f}, {y:z.1f} m{' in the map' if in_map else ' from its start'}"
