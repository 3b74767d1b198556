"""Devices at the other end of a line that are no robot: named within five seconds, by the driver of every family."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable

import pytest

from config.load import load_robot
from config.robot import RobotConfig
from config.world import WorldConfig
from drivers.driver import LineState
from drivers.emulator.memory_transport import MemoryLine
from drivers.registry import make_device, make_driver
from drivers.rflex.codec import Status, encode, frame_of

NAMED_S = 5.0
STEP_S = 0.01
FAMILIES = ("p3dx", "denning", "b21r")
Device = Callable[[float, bytes], bytes]
"""Gets the time since the line was opened and the bytes sent to it; returns what it sends."""


def robot_at(name: str, port: str) -> RobotConfig:
    config = load_robot(name)
    return config.model_copy(update={"link": config.link.model_copy(update={"port": port})})


def said_of(device: Device, config: RobotConfig, baud: int | None = None) -> list[tuple[float, LineState, str]]:
    """Return each problem with its time and state; `baud` is the only speed at which the device is understood."""
    driver, said = make_driver(config), list[tuple[float, LineState, str]]()
    driver.line_opened(100.0)
    noise = random.Random(1)
    for k in range(1, round(8.0 / STEP_S)):
        at_s = k * STEP_S
        driver.tick(100.0 + at_s)
        answer = device(at_s, driver.outgoing(writable=True))
        if baud is not None and (driver.line_baud or config.link.baud) != baud:
            answer = noise.randbytes(len(answer))
        if answer:
            driver.receive(answer, 100.0 + at_s)
        problem = driver.problem
        if problem is not None and (not said or said[-1][2] != problem):
            said.append((at_s, driver.state, problem))
        assert driver.state is not LineState.READY
    return said


def sketch(period_s: float, line: bytes) -> Device:
    """Return a device that sends a line of text again and again, whatever it gets."""
    state = {"next": 0.3}

    def device(at_s: float, _sent: bytes) -> bytes:
        if at_s < state["next"]:
            return b""
        state["next"] += period_s
        return line

    return device


TEXTS = (
    b"Distance: 42 cm\r\n",
    b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n",
    b"rst:0x1 (POWERON_RESET),boot:0x13 (SPI_FAST_FLASH_BOOT)\r\n",
    b"\x1b[0;32mI (31) boot: ESP-IDF v4.4.1 2nd stage bootloader\x1b[0m\r\n",
    b"Traceback (most recent call last):\r\n  File \"main.py\", line 3\r\n>>> ",
    b"login: \r\n",
    b"SSH-2.0-OpenSSH_9.2p1 Debian-2+deb12u2\r\n",
    b"\xff\xfd\x18\xff\xfd\x20\xff\xfb\x01\r\nWelcome to the terminal server\r\n\r\nlogin: ",  # telnet
)  # fmt: skip


@pytest.mark.parametrize("port", ["/dev/ttyUSB0", "socket://robot:8101"])
@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("text", TEXTS)
def test_a_device_that_sends_text_is_quoted(text: bytes, name: str, port: str) -> None:
    said = said_of(sketch(0.2, text), robot_at(name, port))
    at_s, state, problem = next(each for each in said if "a device sends text, as '" in each[2])
    assert at_s <= NAMED_S
    assert state is LineState.DOWN
    assert problem.isprintable()
    assert len(problem) < 400


ANSWERS = (
    b"ERROR\r\n",  # a modem
    b"HTTP/1.1 400 Bad Request\r\nContent-Type: text/html\r\n\r\n<html>Bad Request</html>",
    b"?SYNTAX\r\n> ",
)


@pytest.mark.parametrize("port", ["/dev/ttyUSB0", "socket://robot:8101"])
@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("answer", ANSWERS)
def test_a_device_that_answers_in_text_is_named(answer: bytes, name: str, port: str) -> None:
    """It says nothing until it is called, as a modem or a server of pages."""
    said = said_of(lambda _at_s, sent: answer if sent else b"", robot_at(name, port))
    assert any("a device sends text, as '" in text or "another device is on this port" in text for _, _, text in said)
    assert said[0][0] <= NAMED_S
    assert not any("nothing is received" in text for _, _, text in said)


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("text", TEXTS[:2])
def test_text_at_a_speed_that_is_never_tried_is_not_called_silence(text: bytes, name: str) -> None:
    said = said_of(sketch(0.2, text), robot_at(name, "/dev/ttyUSB0"), baud=1200)
    assert said[0][0] <= NAMED_S
    assert not any("nothing is received" in problem for at_s, _, problem in said if at_s > 2.0)


@pytest.mark.parametrize("name", FAMILIES)
def test_a_boot_message_that_comes_once_and_late_is_quoted(name: str) -> None:
    """A board that opening the port resets prints once it has started; by then the robot has been called in vain."""

    def board(at_s: float, _sent: bytes) -> bytes:
        return b"Ready. Type help for help.\r\n" if 1.695 < at_s < 1.705 else b""

    said = said_of(board, robot_at(name, "socket://robot:8101"))
    assert "as 'Ready. Type help for help.'" in said[-1][2]


def test_text_is_found_at_the_speed_at_which_it_is_text() -> None:
    said = said_of(sketch(0.1, b"temperature 21.5\r\n"), robot_at("p3dx", "/dev/ttyUSB0"), baud=115200)
    assert "as 'temperature 21.5'" in said[-1][2]
    assert said[-1][0] <= NAMED_S


@pytest.mark.parametrize("port", ["/dev/ttyUSB0", "socket://robot:8101"])
@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("delay", [0, 3])
def test_a_device_that_sends_back_what_it_gets_is_named(name: str, port: str, delay: int) -> None:
    waiting = [b""] * delay

    def echo(_at_s: float, sent: bytes) -> bytes:
        waiting.append(sent)
        return waiting.pop(0)

    said = said_of(echo, robot_at(name, port))
    assert any("what this program sends comes back" in problem for _, _, problem in said)
    assert next(at_s for at_s, _, problem in said if "comes back" in problem) <= NAMED_S


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(k, marks=pytest.mark.soak) for k in (2, 3))])
def test_noise_is_not_called_text(name: str, seed: int) -> None:
    source = random.Random(seed)
    said = said_of(lambda _at_s, _sent: source.randbytes(source.randrange(40)), robot_at(name, "/dev/ttyUSB0"))
    assert said
    assert not any("text" in problem or "comes back" in problem for _, _, problem in said)
    assert not any("nothing is received" in problem for _, _, problem in said), "it is not true"


@pytest.mark.parametrize("name", FAMILIES)
def test_of_a_silent_line_it_is_said_that_nothing_is_received(name: str) -> None:
    said = said_of(lambda _at_s, _sent: b"", robot_at(name, "/dev/ttyUSB0"))
    assert "nothing is received" in said[0][2]
    assert said[0][0] <= NAMED_S


def in_session(name: str) -> Device:
    """Return an emulated robot that an earlier client left in its session: it sends without being asked."""
    config = load_robot(name)
    robot, driver = make_device(config, WorldConfig(), 1), make_driver(config)
    MemoryLine(driver, robot).exchange(begin_s := 6.0)
    assert driver.state is LineState.READY

    def device(at_s: float, sent: bytes) -> bytes:
        data = robot.advance(begin_s + at_s)
        robot.receive(sent)
        return data

    return device


SENDERS = {"p3dx": "frames of a Pioneer", "denning": "frames of a Denning", "b21r": "frames of a robot with an rFLEX"}


@pytest.mark.parametrize(
    ("name", "other"),
    [pytest.param(*pair, marks=[pytest.mark.soak] if k % 2 else []) for k, pair in
     enumerate(itertools.permutations(FAMILIES, 2))],
)  # fmt: skip
def test_a_robot_of_another_family_is_named(name: str, other: str) -> None:
    said = said_of(in_session(other), robot_at(name, "socket://robot:8101"))
    assert SENDERS[other] in said[-1][2]
    assert next(at_s for at_s, _, problem in said if SENDERS[other] in problem) <= NAMED_S
    assert not any(whose in problem for _, _, problem in said for one, whose in SENDERS.items() if one != other)


@pytest.mark.parametrize("name", FAMILIES)
def test_frames_that_have_ended_are_not_said_to_come(name: str) -> None:
    """A robot of the family that is switched off just after the line was opened."""
    robot = in_session(name) if name != "b21r" else lambda _at_s, _sent: encode(frame_of(Status(1, 2400, 1)))

    def device(at_s: float, _sent: bytes) -> bytes:
        return robot(at_s, b"") if at_s < 0.3 else b""

    said = said_of(device, robot_at(name, "socket://robot:8101"))
    assert "although the robot sends other frames" not in said[-1][2]
    assert "other frames are received" not in said[-1][2]
