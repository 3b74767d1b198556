"""Malformed, oversized and unpermitted messages: none raises an error, none moves the robot.

Most go to the dispatcher, where their effect shows at once; others over a websocket, and some to a whole process in
virtual time, whose emulated base shows whether it moved. `make soak` sends a hundred thousand.
"""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from typing import Any

import orjson
import pytest
import structlog

from behaviors.teleoperation import Teleoperate
from drivers.driver import RobotDriver
from runtime.console.commands.messages import MalformedMessage
from runtime.console.commands.registry import reader
from runtime.console.console import Console
from runtime.console.http.client_limits import Limits
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.support.kernel_loader import KernelLoader
from runtime.timing.cycle_stats import CycleStats
from tests.runtime.console.console_case import FREE_PORT, ConsoleCase, open_console
from tests.runtime.console.sample_messages import ALL
from tests.runtime.virtual_time import in_virtual_time

TO_DISPATCHER, SOAK_TO_DISPATCHER = 2000, 70_000
OVER_WEBSOCKET, SOAK_OVER_WEBSOCKET = 400, 30_000
IN_A_RUN = 2000
BOUNDLESS = Limits(messages_per_s=1e9, bytes_burst=1e12, queue_messages=10**9, queue_bytes=10**12)

ODD: list[Any] = [
    None, True, -1, 0, 2**53, 2**70, 1e308, -0.0, "", "x", "\x00", "halt", "arm", "🤖" * 50, [], [[]], {},
    {"type": "arm"}, ["arm"], float("nan"), float("inf"), "NaN", 10**400, "a" * 2000, {"id": 1}, [1.5], "behaviors..",
    ".", "__class__",
]  # fmt: skip


def mutated(rng: random.Random, message: dict[str, Any]) -> dict[str, Any]:
    """Return a message with arguments added, removed or replaced."""
    message = {"id": rng.randrange(1000), **message}
    for _ in range(rng.choice((1, 1, 2, 3))):
        keys = list(message)
        match rng.randrange(5):
            case 0 if keys:
                del message[rng.choice(keys)]
            case 1 if keys:
                message[rng.choice(keys)] = rng.choice(ODD)
            case 2:
                message[rng.choice(["", "now", "v", "x", "object", "type", "kind", "numbers", "__proto__"])] = (
                    rng.choice(ODD)
                )
            case 3:
                message |= rng.choice(ALL)
            case _:
                message[rng.choice(keys) if keys else "id"] = [message.copy()]
    return message


def text_of(value: Any) -> str:
    """Return JSON that may hold NaN and infinities."""
    return json.dumps(value, ensure_ascii=False)


def garbled(rng: random.Random, text: str) -> str:
    """Return a text with parts removed, doubled or replaced."""
    for _ in range(rng.randrange(1, 4)):
        at, length = rng.randrange(len(text) + 1), rng.randrange(1, 8)
        filling = rng.choice(("", text[at : at + length] * 2, chr(rng.randrange(1, 0xD800)), '"', "}", "[[[[", "\\u"))
        text = text[:at] + filling + text[at + length :]
    return text


def messages(rng: random.Random, count: int) -> Iterator[str]:
    for _ in range(count):
        good = rng.choice(ALL)
        match rng.randrange(4):
            case 0:
                yield garbled(rng, text_of({"id": 1, **good}))
            case 1:
                yield "".join(chr(rng.randrange(1, 0xD800)) for _ in range(rng.randrange(60)))
            case _:
                yield text_of(mutated(rng, good))


class NullTransport:
    """A transport that accepts everything."""

    async def send(self, data: bytes) -> None:
        """Accept it."""

    def abort(self) -> None:
        """Fail: the client's queue is not bounded here."""
        raise AssertionError("disconnected by its own queue")


def is_well_formed(text: str) -> bool:
    try:
        reader().read(text)
    except MalformedMessage:
        return False
    return True


async def test_messages_to_the_dispatcher() -> None:
    await check_dispatcher(TO_DISPATCHER, 1)


@pytest.mark.soak
async def test_many_messages_to_the_dispatcher() -> None:
    await check_dispatcher(SOAK_TO_DISPATCHER, 4)


async def check_dispatcher(count: int, seed: int) -> None:
    """Malformed messages have no effect even from the client in control; from other clients only HALT has one."""
    rng = random.Random(seed)
    async with open_console(limits=BOUNDLESS) as case:
        hub = case.console.hub
        controller, watcher = (hub.join(NullTransport(), name, {}, has_token=True) for name in ("first", "second"))
        stranger = hub.join(NullTransport(), "third", {}, has_token=False)
        well_formed = 0
        for k, text in enumerate(messages(rng, count)):
            if k % 5000 == 0:
                for client in (controller, watcher, stranger):
                    client._queue.clear()
            case.console.dispatcher.receive(stranger, text)
            assert case.run.asked == []
            if is_well_formed(text):
                well_formed += 1
                if '"take_control"' not in text:
                    case.console.dispatcher.receive(watcher, text)
                    assert set(case.run.asked) <= {Request.HALT}
            else:
                case.console.dispatcher.receive(controller, text)
                assert case.run.asked == []
                assert orjson.loads(controller._queue[-1])["ok"] is False
            case.run.asked.clear()
        assert hub.control.is_held_by(controller)
        assert well_formed > 0.01 * count, "too few messages are well-formed to test anything"
        for client in (controller, watcher, stranger):
            hub.leave(client)


async def test_messages_over_a_websocket() -> None:
    await check_websocket(OVER_WEBSOCKET, 2)


@pytest.mark.soak
async def test_many_messages_over_a_websocket() -> None:
    await check_websocket(SOAK_OVER_WEBSOCKET, 5)


async def check_websocket(count: int, seed: int) -> None:
    """Malformed messages of the client in control and unpermitted ones of another client have no effect."""
    rng = random.Random(seed)
    async with open_console(limits=BOUNDLESS) as case:
        first, second = await case.page(), await case.page()
        sent = {id(first): 0, id(second): 0}
        for k, text in enumerate(messages(rng, count)):
            page = first if not is_well_formed(text) else second
            if '"take_control"' in text:
                continue
            await page.socket.send_str(text)
            sent[id(page)] += 1
            if k % 200 == 199:
                await answered(case, first, sent[id(first)])
                await answered(case, second, sent[id(second)])
                sent = dict.fromkeys(sent, 0)
                assert set(case.run.asked) <= {Request.HALT}
        assert (await first.ask(type="arm"))["ok"], "its state is unchanged"
        assert case.run.asked[-1] is Request.ARM


async def answered(case: ConsoleCase, page: Any, count: int) -> None:
    """Wait for as many answers as there were messages."""
    for _ in range(count):
        await page.next("answer")
    page.received.clear()
    assert case.run.health.fault() is None


@pytest.mark.compiled
@pytest.mark.parametrize("armed", [False, True])
def test_a_whole_process_does_not_move(monkeypatch: pytest.MonkeyPatch, *, armed: bool) -> None:
    """Neither a watching client's messages nor malformed ones of the client in control move the robot.

    Nor do they if it is armed and teleoperated at zero velocity.
    """
    rng = random.Random(3)
    texts = messages(rng, IN_A_RUN)
    log = structlog.wrap_logger(None, processors=[_drop])
    moved: list[float] = []
    modes: set[Mode] = set()

    def on_cycle(record: CycleRecord, state: State, _stats: CycleStats, _driver: RobotDriver) -> None:
        modes.add(record.mode.mode)
        if armed and record.cycle == 10:
            process.request(Request.ARM)
        if armed:
            process.drive_request(Teleoperate(0.0, 0.0, 1.0))
        if record.cycle > 30:
            if state.odometry is not None:
                moved.append(abs(state.odometry.twist.v) + abs(state.odometry.twist.w))
            for text in (next(texts, None) for _ in range(10)):
                if text is None:
                    process.stop()
                    return
                is_halt = is_well_formed(text) and '"halt"' in text
                if not is_halt and '"take_control"' not in text:
                    console.dispatcher.receive(watcher if is_well_formed(text) else controller, text)
            for client in (watcher, controller):
                client._queue.clear()

    with in_virtual_time(monkeypatch, "perception.method=paper", FREE_PORT) as (loop, settings, robot, _links):
        start = robot.truth.pose
        process = RobotProcess(settings, log, Observers(on_cycle), loop.time)
        console = Console(
            process, log, KernelLoader(log), emulated=True,
            limits=BOUNDLESS, clock=loop.time,
        )  # fmt: skip
        controller, watcher = (
            console.hub.join(NullTransport(), name, {}, has_token=True) for name in ("first", "second")
        )
        summary = loop.run_until_complete(process.run(arm=False, seconds=None))
        assert robot.truth.pose == start
    assert moved
    assert max(moved) == 0.0
    assert summary["stop_reasons"] == []
    assert (Mode.DRIVE in modes) == armed


def _drop(*_: object) -> dict[str, object]:
    raise structlog.DropEvent
