"""What answers on a port: which robot is chosen, and how its battery is described."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from config.files import list_shipped
from config.load import load_robot
from config.robot import CalibrationConfig, RobotConfig
from config.world import WorldConfig
from drivers.calibrated_driver import CalibratedDriver
from drivers.driver import LineState
from drivers.link import Link, LinkError
from drivers.messages import LinkCounts
from drivers.registry import make_device
from runtime.cli.commands.robots import port_probe
from tests.hil.machine import TIMEOUT_S


@pytest.mark.parametrize(
    ("fired", "chosen"),
    [
        ({"atrvjr": 16, "b21r": 24, "b21r-both": 24, "magellan": 8}, "b21r"),
        ({"atrvjr": 13, "b21r": 8, "magellan": 16}, "magellan"),
        ({"atrvjr": 5, "b21r": 20}, "b21r"),
        ({"atrvjr": 3}, "atrvjr"),
    ],
)
async def test_of_robots_that_do_not_name_themselves_the_one_of_which_all_or_most_sensors_fire_is_chosen(
    fired: dict[str, int], chosen: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    robots = {name: load_robot(name) for name in ("atrvjr", "b21r", "b21r-both", "denning", "magellan")}
    asked = list[str]()

    async def answer(_line: port_probe._Line, config: RobotConfig, _answer_max_s: float) -> port_probe._Answer:
        (name,) = (name for name, known in robots.items() if known is config)
        asked.append(name)
        if config.robot.driver != "rflex":
            return port_probe._Answer(has_answered=False)
        count = fired.get(name, 0)
        is_whole = count == len(config.ring.mounts)
        return port_probe._Answer(has_answered=True, text=name, fired=count, is_whole=is_whole)

    monkeypatch.setattr(port_probe, "_try", answer)
    assert await port_probe.probe_port("/dev/ttyUSB0", robots) == port_probe.Finding(chosen, (chosen,))


@pytest.mark.parametrize(
    ("answers", "asked"),
    [
        ({}, ["amigo", "denning", "b21r"]),
        ({"amigo": False}, ["amigo"]),
        ({"amigo": True, "p3at": True, "p3dx": False}, ["amigo", "p3at", "p3dx"]),
        ({"denning": True, "hobby8": False}, ["amigo", "denning", "hobby8"]),
    ],
    ids=["nothing", "a Pioneer that fails", "a p3dx that fails", "a hobby8 that fails"],
)
async def test_what_answers_one_family_is_asked_again_only_if_it_says_what_it_is(
    answers: dict[str, bool], asked: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What answers a call is a robot of this family; another file of it helps only where it is refused as another."""
    robots = {name: load_robot(name) for name in ("amigo", "b21r", "denning", "hobby8", "p3at", "p3dx")}
    tried, waits_s = list[str](), set[float]()

    async def answer(_line: port_probe._Line, config: RobotConfig, answer_max_s: float) -> port_probe._Answer:
        (name,) = (name for name, known in robots.items() if known is config)
        tried.append(name)
        waits_s.add(answer_max_s)
        if name not in answers:
            return port_probe._Answer(has_answered=False)
        return port_probe._Answer(has_answered=True, problem="wrong", is_other=answers[name])

    monkeypatch.setattr(port_probe, "_try", answer)
    said = (f"as {', '.join(answers)}: wrong" if answers else port_probe.NOTHING,)
    assert await port_probe.probe_port("socket://localhost:1", robots) == port_probe.Finding(None, said)
    assert tried == asked
    assert waits_s == {port_probe.SOCKET_MAX_S / 3}, "the three families share the time"
    tried.clear()
    await port_probe.probe_port("/dev/ttyUSB0", robots)
    assert waits_s == {port_probe.SOCKET_MAX_S / 3, port_probe.ANSWER_MAX_S}, "at each speed of a line"


class Answering:
    """A driver whose robot has sent a frame."""

    def __init__(self, state: LineState, problem: str | None, *, is_other_robot: bool) -> None:
        self.state, self.problem, self.is_other_robot = state, problem, is_other_robot
        self.counts, self.line_baud = LinkCounts(frames=1), None

    def outgoing(self, **_: bool) -> bytes:
        return b""

    def line_opened(self, run_s: float) -> None: ...

    def line_closed(self) -> None: ...

    def tick(self, run_s: float) -> None: ...


@pytest.mark.parametrize(
    ("driver", "answer"),
    [
        (Answering(LineState.DOWN, "has 8 sensors", is_other_robot=True), ("has 8 sensors", True)),
        (Answering(LineState.HANDSHAKE, None, is_other_robot=False), (port_probe.UNREADY, False)),
        (Answering(LineState.HANDSHAKE, "no FIRE", is_other_robot=False), ("no FIRE", False)),
    ],
    ids=["another robot", "a robot that falls silent", "a robot that refuses to fire"],
)
async def test_what_has_answered_and_is_not_ready_is_said_also_behind_a_calibrated_driver(
    driver: Any, answer: tuple[str, bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def open_once(_link: Link) -> None: ...

    calibrated = CalibratedDriver(driver, CalibrationConfig(distance_scale=1.01), synchro=False)
    monkeypatch.setattr(port_probe, "make_driver", lambda _config: calibrated)
    monkeypatch.setattr(port_probe, "READY_MAX_S", 0.0)
    monkeypatch.setattr(Link, "open_once", open_once)
    monkeypatch.setattr(Link, "is_open", True)
    found = await port_probe._try(port_probe._Line("socket://localhost:1"), load_robot("p3dx"), 0.0)
    assert found._replace(events=()) == port_probe._Answer(has_answered=True, problem=answer[0], is_other=answer[1])


def test_frames_before_a_board_restarts_are_no_answer_until_it_had_time_to_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Opening its port restarts it: a driver that gave up meanwhile reaches it later on the same line."""
    driver: Any = Answering(LineState.DOWN, "no answer", is_other_robot=False)
    monkeypatch.setattr(port_probe, "make_driver", lambda _config: driver)
    for max_s, early, late in ((port_probe.ANSWER_MAX_S, (1.5, 1.5), (1.0, 3.1)), (1.3, (1.2, 1.2), (1.4, 1.4))):
        listener = port_probe._Listener(load_robot("hobby8"), max_s)
        assert listener.found(*early) is None
        assert listener.found(*late) == port_probe._Answer(has_answered=True, problem="no answer")


async def test_a_socket_has_no_speeds_so_that_its_families_are_those_of_the_drivers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = load_robot("p3dx")
    fast = robot.model_copy(update={"link": robot.link.model_copy(update={"baud": 115200})})
    asked = list[float]()

    async def answer(_line: port_probe._Line, _config: RobotConfig, answer_max_s: float) -> port_probe._Answer:
        asked.append(answer_max_s)
        return port_probe._Answer(has_answered=False)

    monkeypatch.setattr(port_probe, "_try", answer)
    for port, tries in (("socket://localhost:1", 1), ("/dev/ttyUSB0", 2)):
        asked.clear()
        await port_probe.probe_port(port, {"p3dx": robot, "fast": fast})
        assert asked == [port_probe.ANSWER_MAX_S] * tries


async def test_a_port_that_is_still_busy_with_the_robot_tried_before_is_opened_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A bridge of one client refuses the next one until it has seen the last one hang up."""
    opened = list[bool]()

    async def open_once(_link: Link) -> None:
        opened.append(len(opened) % 4 == 0)
        if not opened[-1]:
            raise LinkError("refuses the connection")

    monkeypatch.setattr(Link, "open_once", open_once)
    monkeypatch.setattr(port_probe, "AGAIN_MAX_S", TIMEOUT_S)
    robots = {name: load_robot(name) for name in ("denning", "p3dx", "b21r")}
    assert (await port_probe.probe_port("socket://localhost:1", robots)).robot is None
    assert sum(opened) == len(robots), "each family is tried"
    monkeypatch.setattr(port_probe, "AGAIN_MAX_S", 0.0)
    opened.clear()
    finding = await port_probe.probe_port("socket://localhost:1", robots)
    assert (finding.said, opened) == (("refuses the connection",), [True, False])


def test_a_battery_that_is_low_is_named_with_and_without_its_voltage() -> None:
    assert port_probe._battery(10.94, is_low=True) == "battery 10.9 V, low"
    assert port_probe._battery(None, is_low=True) == "battery low"


class Line:
    """Connections to an emulated robot, one after the other, in virtual time."""

    is_open, writable, last_error = False, True, None

    def __init__(self, robot: str) -> None:
        self.device = make_device(load_robot(robot), WorldConfig(), seed=1)
        self.now_s, self.opened = 0.0, 0

    def __call__(self, config: Any, opened: Any, received: Any, _closed: Any) -> Line:
        self.config, self._when_opened, self._when_received = config, opened, received
        return self

    def set_baud(self, baud: int | None) -> None: ...

    async def open_once(self) -> None:
        self.is_open, self.opened = True, self.opened + 1
        self._when_opened()

    async def stop(self) -> None:
        self.is_open = False

    def send(self, data: bytes) -> None:
        self.device.receive(data)

    async def sleep(self, seconds: float) -> None:
        self.now_s += seconds
        data = self.device.advance(self.now_s)
        if self.is_open and data:
            self._when_received(data)


@pytest.mark.parametrize("robot", list_shipped("robots"))
async def test_a_robot_is_found_within_five_seconds_and_its_family_called_twice_at_most(
    robot: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The time is that of the waits, counted: a busy machine adds its own."""
    robots = {name: load_robot(name) for name in list_shipped("robots")}
    for port, longest_s in (("socket://localhost:1", 4.0), ("/dev/ttyUSB0", 5.0)):
        line = Line(robot)
        monkeypatch.setattr(port_probe, "Link", line)
        monkeypatch.setattr(port_probe, "time", SimpleNamespace(monotonic=lambda of=line: of.now_s))
        monkeypatch.setattr(asyncio, "sleep", line.sleep)
        found = await port_probe.probe_port(port, robots)
        assert found.robot == {"ears": "denning", "b21r-both": "b21r"}.get(robot, robot), "the first that fires whole"
        assert line.now_s <= longest_s
        driver = robots[robot].robot.driver
        assert line.opened <= {"arcos": 2, "denning": 3, "rflex": 3}[driver], f"one of each family before {driver}"


async def test_a_serial_port_on_which_nothing_answers_is_opened_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Opening it restarts some boards, which do not answer until they have started."""
    line = Line("hobby8")
    line.device = SimpleNamespace(advance=lambda _to_s: b"", receive=lambda _data: None)
    monkeypatch.setattr(port_probe, "Link", line)
    monkeypatch.setattr(port_probe, "time", SimpleNamespace(monotonic=lambda: line.now_s))
    monkeypatch.setattr(asyncio, "sleep", line.sleep)
    robots = {name: load_robot(name) for name in list_shipped("robots")}
    assert await port_probe.probe_port("/dev/ttyUSB0", robots) == port_probe.Finding(None, (port_probe.NOTHING,))
    assert (line.opened, line.is_open) == (1, False)
    assert line.now_s <= 5.0
