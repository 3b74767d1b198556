"""Ports on which no robot answers as it should, and the halt at the end of a run, in virtual time."""

from __future__ import annotations

import asyncio
import itertools
import random
from collections.abc import Awaitable, Callable, MutableMapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NoReturn

import pytest
import structlog

from config.errors import FAILED, UserError
from config.load import load_settings
from drivers.base_model import stop_s
from drivers.emulator.faults import Deaf, Fault, Garbage, Mute
from drivers.link import Link
from drivers.messages import Flags, LinkCounts, Twist
from drivers.registry import make_driver
from drivers.serial_port import LinkError
from drivers.tcp_port import explain_hang_up
from runtime.cycle.connection import ANSWER_TIMEOUT_S, CONNECT_MAX_S, POLL_S, Connection, why_ended
from runtime.cycle.process import Observers, RobotProcess
from tests.runtime.virtual_time import STEP_S, MemoryLink, in_virtual_time

LONG_S = 600.0
FASTEST = Twist(0.32, 0.0)
"""What a drive of the hallway does not exceed."""


def _drop(*_: object) -> dict[str, object]:
    raise structlog.DropEvent


LOG = structlog.wrap_logger(None, processors=[_drop])


def refusal(
    monkeypatch: pytest.MonkeyPatch, *faults: Fault, disturb: Callable[[MemoryLink], None] | None = None
) -> str:
    """Run on a robot with these faults; return the error, having checked when it came."""
    with in_virtual_time(monkeypatch, faults=faults) as (loop, settings, _robot, links):
        process = RobotProcess(settings, LOG, clock=loop.time)
        begin_s = loop.time()
        if disturb is not None:
            loop.call_later(0.1, lambda: disturb(links[0]))
        with pytest.raises(UserError) as caught:
            loop.run_until_complete(process.run(arm=True, seconds=LONG_S))
        assert loop.time() - begin_s <= CONNECT_MAX_S + 2.0 * POLL_S
        assert caught.value.exit_code == FAILED
        assert not links[0].is_open, "the line is closed"
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_a_robot_that_is_deaf(monkeypatch: pytest.MonkeyPatch) -> None:
    text = refusal(monkeypatch, Deaf(kind="deaf", at_s=0.0, duration_s=LONG_S))
    assert "HELLO" in text
    assert "although the robot sends other frames" in text


def test_a_port_that_is_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    text = refusal(monkeypatch, Mute(kind="mute", at_s=0.0, duration_s=LONG_S))
    assert "HELLO" in text
    assert "nothing is received" in text


def test_a_port_that_sends_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    noise, rng = Garbage(kind="garbage", at_s=0.0, duration_s=LONG_S, bytes_per_s=5000.0), random.Random(1)

    def only_noise(link: MemoryLink) -> None:
        live = link.live

        def noisy() -> bytes:
            return rng.randbytes(len(live()))

        link.live = noisy  # type: ignore[method-assign]

    text = refusal(monkeypatch, noise, disturb=only_noise)
    assert "or the line has another speed" in text


def test_a_line_that_is_lost_before_the_handshake(monkeypatch: pytest.MonkeyPatch) -> None:
    silent = Mute(kind="mute", at_s=0.0, duration_s=LONG_S)
    assert refusal(monkeypatch, silent, disturb=MemoryLink.pull) == "pulled out"


@pytest.mark.parametrize(
    ("sent", "said"),
    [
        (
            b"HTTP/1.1 400 Bad Request\r\n\r\n",
            "a device sends text, as 'HTTP/1.1 400 Bad Request'; it is not the robot",
        ),
        (b"", ": its other end ends the connection before a robot answers; likely it is another program's port"),
    ],
)
async def test_another_programs_port_that_answers_and_hangs_up_is_no_cable(sent: bytes, said: str) -> None:
    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1)
        writer.write(sent)
        await writer.drain()
        writer.close()

    assert said in await refused_over_tcp(answer)


async def refused_over_tcp(
    answer: Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]],
) -> str:
    """Connect to a server; return the error that this ends with."""
    server = await asyncio.start_server(answer, "127.0.0.1", 0)
    port = f"socket://127.0.0.1:{server.sockets[0].getsockname()[1]}"
    settings = load_settings("hallway", [f"link.port={port}"])
    driver, now_s = (
        make_driver(settings),
        itertools.count(0.0, 0.001),
    )  # counts the polls: a busy machine may take long

    def send() -> None:
        link.send(driver.outgoing(writable=link.writable))

    link = Link(
        settings.link, lambda: driver.line_opened(0.0), lambda data: driver.receive(data, next(now_s)),
        lambda _reason: driver.line_closed(),
    )  # fmt: skip
    with pytest.raises(UserError) as refused:
        await Connection(link, driver, send, lambda: next(now_s), settings.body).connect(lambda: False)
    server.close()
    assert refused.value.exit_code == FAILED
    return str(refused.value)


async def test_a_program_error_on_a_network_line_is_not_taken_for_another_programs_port(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def answer(_reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(bytes(9))

    def fail(*_: object) -> None:
        raise KeyError("planted")

    monkeypatch.setattr("drivers.denning.driver.DenningDriver.receive", fail)
    text = await refused_over_tcp(answer)
    assert "the handler of received data failed with KeyError: 'planted'" in text


@pytest.mark.parametrize(
    ("port", "has_hung_up", "frames", "is_stranger"),
    [
        ("socket://robot:1", True, 0, True),
        ("socket://robot:1", True, 1, False),  # the robot has answered
        ("socket://robot:1", False, 0, False),  # its system confirms nothing
        ("/dev/ttyUSB0", True, 0, False),
    ],
)
def test_only_a_connection_that_its_other_end_ends_before_any_frame_may_be_another_programs(
    port: str, has_hung_up: bool, frames: int, is_stranger: bool
) -> None:
    link: Any = SimpleNamespace(last_error="lost", has_hung_up=has_hung_up, config=SimpleNamespace(port=port))
    driver: Any = SimpleNamespace(counts=LinkCounts(frames, 0, 0))
    assert why_ended(link, driver, None) == (explain_hang_up(port) if is_stranger else "lost")


async def test_a_port_that_is_missing_is_refused_as_its_opening_would_be(tmp_path: Path) -> None:
    settings = load_settings("hallway", [f"link.port={tmp_path / 'none'}"])
    link = Link(settings.link, lambda: None, lambda _data: None, lambda _reason: None)
    connection = Connection(link, make_driver(settings), lambda: None, lambda: 0.0, settings.body)
    with pytest.raises(LinkError, match="no such port") as refused:
        connection.refuse_missing()
    with pytest.raises(LinkError) as opened:
        await connection.connect(lambda: False)
    assert (str(refused.value), refused.value.exit_code) == (str(opened.value), opened.value.exit_code)
    (tmp_path / "none").touch()
    connection.refuse_missing()
    assert not link.is_open


@pytest.mark.parametrize(("robot_file", "farewell"), [("denning", ""), ("p3dx", "fafb06023b0100033b"), ("b21r", "")])
def test_the_base_has_stopped_and_its_session_has_ended_before_the_line_is_closed(
    monkeypatch: pytest.MonkeyPatch, robot_file: str, farewell: str
) -> None:
    with in_virtual_time(monkeypatch, robot_file=robot_file) as (loop, settings, robot, links):
        sent = bytearray()

        def on_bytes(direction: str, _run_s: float, _host_s: float, data: bytes) -> None:
            if direction == "out":
                sent.extend(data)

        process = RobotProcess(settings, LOG, Observers(on_bytes=on_bytes), clock=loop.time)
        ends = list[tuple[float, float]]()
        stop = MemoryLink.stop

        async def noted(link: MemoryLink) -> None:
            ends.append((loop.time(), robot.truth.twist.v))
            await stop(link)

        monkeypatch.setattr(MemoryLink, "stop", noted)

        def end() -> None:
            ends.append((loop.time(), robot.truth.twist.v))
            process.stop()

        loop.call_later(5.0, end)
        loop.run_until_complete(process.run(arm=True, seconds=None))
        (asked_s, driven_m_s), (closed_s, v), *_ = ends
        assert driven_m_s > 0.2, "it drove"
        assert v == 0.0
        assert robot.truth.flags & Flags.LATCHED
        assert closed_s - asked_s < settings.link.answer_max_s, "it was confirmed"
        assert sent.endswith(bytes.fromhex(farewell))
        assert not links[0].is_open


@pytest.mark.parametrize("deceleration_m_s2", [0.2, 0.35, 0.5, 1.0, 3.0])
def test_a_base_that_brakes_as_its_file_says_has_confirmed_its_halt(
    monkeypatch: pytest.MonkeyPatch, deceleration_m_s2: float
) -> None:
    monkeypatch.setattr("drivers.denning.device.BRAKE_S", None)  # a halt brakes no harder than any command
    body = f"body.acceleration_max_m_s2={deceleration_m_s2}"
    with in_virtual_time(monkeypatch, body) as (loop, settings, robot, _links):
        warnings, driven_m_s = list[str](), list[float]()

        def keep(_logger: object, method: str, event: MutableMapping[str, Any]) -> NoReturn:
            warnings.extend([str(event["event"])] if method == "warning" else [])
            raise structlog.DropEvent

        def end() -> None:
            driven_m_s.append(robot.truth.twist.v)
            process.stop()

        process = RobotProcess(settings, structlog.wrap_logger(None, processors=[keep]), clock=loop.time)
        loop.call_later(5.0, end)
        loop.run_until_complete(process.run(arm=True, seconds=None))
    assert driven_m_s[0] > 0.2
    assert robot.truth.twist.v == 0.0
    assert not [text for text in warnings if "halt" in text]


def test_a_base_that_does_not_confirm_its_halt_is_left_after_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its deadman stops it."""
    silent = Mute(kind="mute", at_s=4.0 - STEP_S, duration_s=LONG_S)
    with in_virtual_time(monkeypatch, faults=(silent,)) as (loop, settings, _robot, _links):
        process = RobotProcess(settings, LOG, clock=loop.time)
        loop.call_later(4.0, process.stop)
        begin_s = loop.time()
        loop.run_until_complete(process.run(arm=True, seconds=None))
        waited_s = loop.time() - begin_s - 4.0
        assert settings.link.answer_max_s <= waited_s <= settings.link.answer_max_s + stop_s(FASTEST, settings.body)


def test_a_robot_that_answers_late_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """It starts, or runs on a busy machine: the usual number of tries is over after a third of a second."""
    late = Mute(kind="mute", at_s=0.0, duration_s=ANSWER_TIMEOUT_S - 0.5)
    with in_virtual_time(monkeypatch, faults=(late,)) as (loop, settings, *_):
        process = RobotProcess(settings, LOG, clock=loop.time)
        summary = loop.run_until_complete(process.run(arm=True, seconds=1.0))
    assert summary["mode"] == "DRIVE"
