"""What the log says about the line: loss and return, another robot, corrupt frames, refused arming."""

from __future__ import annotations

from collections.abc import MutableMapping
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np
import structlog

from config.load import load_settings
from drivers.driver import LineState, Received, RobotDriver
from drivers.emulator.memory_transport import MemoryLine
from drivers.messages import Identity, LinkCounts
from drivers.registry import make_device, make_driver
from runtime.cycle.inputs import Inputs, Request
from runtime.cycle.line_messages import ROBOT_LINE
from runtime.cycle.logs.line_log import LineLog, differences
from runtime.cycle.modes import Mode, ModeState
from runtime.cycle.step import CycleRecord

NAMED = Identity("a", 24, 0.3, 0.5, 0.02, 1)
NOTHING = Received((), None, rebooted=False)
AT_REST = ModeState(Mode.READY)
CYCLE_S = 0.05


@dataclass
class Stub:
    """What the log reads of a driver."""

    identity: Identity | None = NAMED
    counts: LinkCounts = field(default_factory=LinkCounts)


class Case:
    """A log of the line, its driver, and the events that were logged."""

    def __init__(self) -> None:
        self.events = list[dict[str, Any]]()
        self.driver = Stub()
        self.run_s = 10.0
        self.log = LineLog(structlog.wrap_logger(None, processors=[self._keep]), ROBOT_LINE)

    def _keep(self, _logger: object, _name: str, event: MutableMapping[str, Any]) -> dict[str, Any]:
        self.events.append(dict(event))
        raise structlog.DropEvent

    def cycle(
        self, line: LineState = LineState.READY, problem: str | None = None, request: Request | None = None,
        mode: ModeState = AT_REST,
    ) -> None:  # fmt: skip
        self.run_s += CYCLE_S
        inputs = Inputs(self.run_s, line, problem, NOTHING, request)
        record = CycleRecord(0, inputs, mode, None, 0, 0, 0, 0, 0, "nothing")
        self.log.observe(record, cast("RobotDriver", self.driver))

    def said(self, event: str) -> list[dict[str, Any]]:
        return [each for each in self.events if each["event"] == event]


def test_a_replug_is_logged_with_loss_and_return() -> None:
    case = Case()
    case.cycle()
    assert not case.events
    case.log.lost("unplugged", case.run_s)
    for _ in range(20):
        case.cycle(LineState.CLOSED)
    case.cycle(LineState.HANDSHAKE)
    case.cycle()
    case.cycle()
    assert [event["event"] for event in case.events] == ["line lost", "line back"]
    assert case.events[1]["robot"] == "a"


def test_another_robot_under_the_old_name_is_named() -> None:
    case = Case()
    case.cycle()
    case.driver.identity = replace(NAMED, name="b")
    for problem in ("the robot 'b' is a p3at", "the robot 'b' is a p3at"):
        case.cycle(LineState.DOWN, problem)
    case.cycle()
    assert [each["reason"] for each in case.said("line down")] == ["the robot 'b' is a p3at"], "once"
    assert any("another robot answers on this port: name 'b' in place of 'a'; " in str(each) for each in case.events)


def test_another_robot_with_the_same_name_is_named_by_what_else_it_says() -> None:
    case = Case()
    case.driver.identity = replace(NAMED, traits=(("steps of the ranges", "0.03048 m"), ("capabilities", "0")))
    case.cycle()
    for traits, said in (
        (
            (("steps of the ranges", "0.001 m"), ("capabilities", "0")),
            "steps of the ranges 0.001 m in place of 0.03048 m",
        ),
        ((("steps of the ranges", "0.001 m"),), None),
        ((("steps of the ranges", "0.001 m"), ("serial number", "7")), None),
    ):
        case.events.clear()
        case.driver.identity = replace(NAMED, boot_id=2, traits=traits)
        case.cycle(LineState.CLOSED)
        case.cycle()
        warnings = [each["event"] for each in case.events if "another robot" in each["event"]]
        assert len(warnings) == (said is not None)
        assert said is None or f"on this port: {said}; likely" in warnings[0]


def identity(driven: str, answers: str) -> Identity:
    """Return what the driver of a robot file learns of an emulated robot of another one."""
    driver, robot = make_driver(load_settings("room", robot=driven)), load_settings("room", robot=answers)
    assert robot.world is not None
    line = MemoryLine(driver, make_device(robot, robot.world, 1))
    for cycle in range(1, 40):
        line.exchange(0.1 * cycle)
    assert driver.state is LineState.READY
    assert driver.identity is not None
    return driver.identity


def test_a_denning_and_ears_differ_under_one_name() -> None:
    denning, ears = identity("denning", "denning"), identity("denning", "ears")
    assert denning.name == ears.name
    assert "steps of the ranges 0.001 m in place of 0.03048 m" in differences(ears, denning)
    assert not differences(replace(denning, boot_id=denning.boot_id + 1), denning), "it was only restarted"


def test_a_line_that_is_lost_again_and_again_is_counted() -> None:
    case = Case()
    for _ in range(1000):
        case.log.lost("refused", case.run_s)
        for _ in range(10):
            case.cycle(LineState.CLOSED)
    assert len(case.said("line lost")) <= 3 + 500.0 / 60.0 + 1
    assert case.said("line lost")[-1]["suppressed_before"] > 100


def test_a_refused_arming_has_its_reason() -> None:
    case = Case()
    case.cycle(LineState.DOWN, "a p3at", Request.ARM, ModeState(Mode.SAFE_STOP, 1.0, "waiting for the robot: a p3at"))
    case.cycle(LineState.HANDSHAKE, None, Request.ARM, ModeState(Mode.CONNECTING, 1.0))
    assert [each["reason"] for each in case.said("arming refused")] == [
        "waiting for the robot: a p3at", "the robot is not ready",
    ]  # fmt: skip
    case.cycle(request=Request.ARM, mode=ModeState(Mode.READY, 1.0, None, arming_run_s=case.run_s))
    case.cycle(request=Request.ARM, mode=ModeState(Mode.DRIVE, 1.0))
    assert len(case.said("arming refused")) == 2


def run_noisy(case: Case, seconds: float, good: int, bad: int) -> None:
    for _ in range(round(seconds / CYCLE_S)):
        counts = case.driver.counts
        case.driver.counts = LinkCounts(counts.frames + good, counts.bad + bad, 0)
        case.cycle()


def test_a_fifth_of_corrupt_frames_is_one_line_with_the_rate() -> None:
    case = Case()
    run_noisy(case, 60.0, 4, 0)
    assert not case.events
    run_noisy(case, 600.0, 4, 1)
    (line,) = case.events
    assert "20% of the frames are corrupt, 20 a second" in line["event"]
    run_noisy(case, 20.0, 5, 0)
    run_noisy(case, 20.0, 4, 1)
    assert len(case.events) == 2, "once more after it was good"


def test_a_fifth_of_a_pioneers_few_frames_is_one_line() -> None:
    case, rng = Case(), np.random.default_rng(10)
    for bad in rng.random(6000) < 0.2:
        run_noisy(case, 2.0 * CYCLE_S, 0, 0)
        counts = case.driver.counts
        case.driver.counts = LinkCounts(counts.frames + (not bad), counts.bad + bad, 0)
    assert len(case.events) == 1, "in ten minutes"


def test_a_flood_of_valid_frames_that_disturbs_no_cycle_is_one_line_with_the_rate() -> None:
    case = Case()
    run_noisy(case, 60.0, 60, 0)
    assert not case.events, "a full line of 115,200 baud"
    run_noisy(case, 60.0, 300, 0)
    (line,) = case.events
    assert "brings 6000 valid frames a second" in line["event"]
