"""A run on the local network: when it is announced, what is said of it, and two runs that find each other."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from contextlib import AsyncExitStack
from types import SimpleNamespace
from typing import Any

import pytest
import structlog

from config.settings import ConsoleConfig
from runtime.cli.commands.run import network_presence
from runtime.cli.commands.run.network_presence import UNSENT_MAX, NetworkPresence, is_announced, on_the_network
from runtime.cycle.modes import Mode
from tests.hil.machine import TIMEOUT_S
from tests.runtime.bridges.test_local_network import _multicast

__all__ = ["_multicast"]

TOKEN = "the-token-of-this-run"


class Page:
    """A console that keeps what it is to show."""

    def __init__(self, port: int, host: str = "127.0.0.1") -> None:
        self.listening, self.url = (host, port), f"http://{host}:{port}/?token={TOKEN}"
        self.robots: list[dict[str, Any]] = []
        self.shown = asyncio.Event()

    def show_robots(self, robots: Sequence[Mapping[str, Any]]) -> None:
        self.robots = [dict(one) for one in robots]
        self.shown.set()

    async def wait_for(self, is_good: Callable[[dict[int, dict[str, Any]]], bool]) -> None:
        async with asyncio.timeout(TIMEOUT_S):
            while not is_good({one["port"]: one for one in self.robots}):
                self.shown.clear()
                await self.shown.wait()


class Run:
    """A run with a name and a mode."""

    def __init__(self, name: str | None, mode: Mode) -> None:
        self.name = name
        self.mode = mode

    @property
    def state(self) -> Any:
        return SimpleNamespace(mode=SimpleNamespace(mode=self.mode))


class Pipe:
    """Standard input of a process that takes nothing."""

    def __init__(self) -> None:
        self.lines: list[dict[str, str]] = []
        self.unsent = 0
        self.transport = SimpleNamespace(get_write_buffer_size=lambda: self.unsent)

    def write(self, data: bytes) -> None:
        self.lines.append(json.loads(data))


def quiet(events: list[str]) -> Any:
    def keep(_logger: object, _name: str, event: MutableMapping[str, Any]) -> Mapping[str, Any]:
        events.append(f"{event['event']}: {event.get('reason')}")
        raise structlog.DropEvent

    return structlog.wrap_logger(None, processors=[keep])


@pytest.mark.promise("P35")
@pytest.mark.parametrize(
    ("announce", "address", "expected"),
    [
        ("when_open", "127.0.0.1", False), ("when_open", "::1", False), ("when_open", "0.0.0.0", True),
        ("when_open", "192.168.0.7", True), ("when_open", "::", True), ("when_open", "fd00::7", False),
        ("always", "127.0.0.1", True), ("never", "0.0.0.0", False),
    ],
)  # fmt: skip
def test_a_run_is_announced_only_where_others_can_reach_it(announce: Any, address: str, expected: bool) -> None:
    assert is_announced(ConsoleConfig(announce=announce), address) is expected


async def test_where_it_is_not_announced_no_process_is_started(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(network_presence, "start_child", None)
    page: Any = Page(1)
    async with on_the_network(page, Run("a", Mode.READY), ConsoleConfig(), quiet([])) as presence:  # type: ignore[arg-type]
        assert presence is None


def test_changes_are_sent_once_and_nothing_waits_for_a_process_that_takes_nothing() -> None:
    pipe, run = Pipe(), Run(None, Mode.READY)
    presence = NetworkPresence(pipe, run)  # type: ignore[arg-type]
    state: Any = run.state
    for _ in range(3):
        presence.on_cycle(None, state, None, None)  # type: ignore[arg-type]
    run.name, pipe.unsent = "alpha", UNSENT_MAX + 1
    presence.on_cycle(None, state, None, None)  # type: ignore[arg-type]
    pipe.unsent = 0
    run.mode = Mode.DRIVE
    presence.on_cycle(None, run.state, None, None)  # type: ignore[arg-type]
    assert pipe.lines == [
        {"name": "a robot without a name", "mode": "READY"}, {"name": "alpha", "mode": "DRIVE"},
    ]  # fmt: skip


@pytest.mark.promise("P35")
@pytest.mark.usefixtures("_multicast")
async def test_two_runs_find_each_other_and_no_token_is_announced(measured: Callable[[str], None]) -> None:
    config, events = ConsoleConfig(announce="always"), list[str]()
    pages = [Page(49_152), Page(49_153)]
    runs = [Run("alpha", Mode.READY), Run("beta", Mode.DRIVE)]
    async with AsyncExitStack() as first:
        async with AsyncExitStack() as second:
            await first.enter_async_context(on_the_network(pages[0], runs[0], config, quiet(events)))  # type: ignore[arg-type]
            presence = await second.enter_async_context(on_the_network(pages[1], runs[1], config, quiet(events)))  # type: ignore[arg-type]
            assert presence is not None
            await pages[0].wait_for(lambda robots: 49_153 in robots)
            await pages[1].wait_for(lambda robots: 49_152 in robots)
            (other,) = (one for one in pages[0].robots if one["port"] == 49_153)
            assert other.pop("version")
            assert other == {"name": "beta", "mode": "DRIVE", "address": "127.0.0.1", "port": 49_153,
                             "url": "http://127.0.0.1:49153/"}  # fmt: skip
            runs[1].mode = Mode.SAFE_STOP
            presence.say(runs[1].mode.name)
            await pages[0].wait_for(lambda robots: robots.get(49_153, {}).get("mode") == "SAFE_STOP")
        await pages[0].wait_for(lambda robots: 49_153 not in robots)
    assert TOKEN not in json.dumps([page.robots for page in pages])
    assert events == []
    measured("two runs found each other, saw a change of mode and an end; announced: name, mode, address, version")


async def test_a_process_that_ends_is_said_and_its_robots_are_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    events: list[str] = []
    page: Any = Page(1)
    monkeypatch.setattr(network_presence, "PROGRAM", "no_such_module")
    async with on_the_network(page, Run("a", Mode.READY), ConsoleConfig(announce="always"), quiet(events)):  # type: ignore[arg-type]
        await page.wait_for(lambda _: bool(events) or page.shown.is_set())
        async with asyncio.timeout(TIMEOUT_S):
            while not events:
                await asyncio.sleep(0)
    assert "not announced on the network any more: " in events[0]
    assert "no_such_module" in events[0]
