"""The robot's main process in virtual time: a whole drive, when its cycles begin, and its own failures."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping, MutableMapping

import pytest
import structlog

from behaviors.move_to_goal import Goal
from drivers.denning.codec import Decoder
from drivers.denning.frames import Echo
from drivers.driver import LineState, RobotDriver
from drivers.messages import Flags
from perception.edits import Edit, PlaceModel
from runtime.cycle.drive_requests import Legs
from runtime.cycle.inputs import Request
from runtime.cycle.modes import ARMING_MIN_S, Mode
from runtime.cycle.process import EDITS_MAX, EDITS_PER_CYCLE, Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.footprint import Footprint, FootprintRow
from runtime.timing.stall_sampler import StackSample, StallSampler
from tests.runtime.virtual_time import in_virtual_time

pytestmark = pytest.mark.compiled

FT = 0.3048
DRIVE_S = 26.0
"""Down the hallway and out of it; the drums are all known by then."""


class Log:
    """A structured log that keeps its events."""

    def __init__(self) -> None:
        self.events: list[dict[str, object]] = []
        self.log = structlog.wrap_logger(None, processors=[self._keep])

    def _keep(self, _logger: object, _name: str, event: MutableMapping[str, object]) -> Mapping[str, object]:
        self.events.append(dict(event))
        raise structlog.DropEvent


@pytest.mark.promise("P18")
def test_a_request_that_is_void_when_the_cycle_takes_it_does_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """As of a page that has left, or of one that asked before a HALT."""
    modes: set[Mode] = set()
    valid = False

    def on_cycle(record: CycleRecord, state: State, _stats: CycleStats, _driver: RobotDriver) -> None:
        nonlocal valid
        modes.add(state.mode.mode)
        if record.cycle == 40:
            assert Mode.DRIVE not in modes
            assert state.drive_request == Legs()
            valid = True
        process.request(Request.ARM, lambda: valid)
        process.drive_request(Goal(1.0, 0.0), lambda: valid)

    with in_virtual_time(monkeypatch, "perception.method=paper") as (loop, settings, _robot, _links):
        process = RobotProcess(settings, Log().log, Observers(on_cycle), loop.time)
        loop.run_until_complete(process.run(arm=False, seconds=4.0))
    assert Mode.DRIVE in modes
    assert process.state.drive_request != Legs()


@pytest.mark.promise("P19")
def test_a_halt_before_the_first_cycle_keeps_the_robot_from_being_armed(monkeypatch: pytest.MonkeyPatch) -> None:
    """As of a SIGUSR2 during the start of a run that arms the robot by itself."""
    with in_virtual_time(monkeypatch, "perception.method=paper") as (loop, settings, robot, _links):
        process = RobotProcess(settings, Log().log, Observers(), loop.time)
        process.request(Request.HALT)
        start = robot.truth.pose
        summary = loop.run_until_complete(process.run(arm=True, seconds=3.0))
    assert summary["mode"] == "SAFE_STOP"
    assert robot.truth.flags & Flags.LATCHED
    assert robot.truth.pose == start


@pytest.mark.promise("P22")
def test_a_flood_of_edits_is_spread_over_cycles(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the order in which they came; what is too much is refused."""
    taken: list[tuple[Edit, ...]] = []
    accepted: list[bool] = []
    flood = [PlaceModel("drum", 0.01 * k, 1.0, 0.0) for k in range(100)]

    def on_cycle(record: CycleRecord, _state: State, _stats: CycleStats, _driver: RobotDriver) -> None:
        taken.append(record.inputs.edits)
        if record.cycle == 10:
            accepted.extend(process.edit(edit) for edit in flood)

    with in_virtual_time(monkeypatch, "perception.method=paper") as (loop, settings, _robot, _links):
        process = RobotProcess(settings, Log().log, Observers(on_cycle), loop.time)
        loop.run_until_complete(process.run(arm=False, seconds=4.0))
    assert accepted == [True] * EDITS_MAX + [False] * (100 - EDITS_MAX)
    assert [edit for edits in taken for edit in edits] == flood[:EDITS_MAX]
    assert max(map(len, taken)) == EDITS_PER_CYCLE


def test_six_drums(monkeypatch: pytest.MonkeyPatch) -> None:
    """From serial bytes to the drums of the summary."""
    with in_virtual_time(monkeypatch) as (loop, settings, _robot, _links):
        process = RobotProcess(settings, Log().log, clock=loop.time)
        summary = loop.run_until_complete(process.run(arm=True, seconds=DRIVE_S))
    world = settings.world
    assert world is not None
    drums = [(d.x_m - world.start.x_m, d.y_m - world.start.y_m) for d in world.drum]
    seen = [(o["x"], o["y"]) for o in summary["objects"]]
    assert len(seen) == len(drums) == 6
    errors = [min(math.dist(drum, place) for place in seen) for drum in drums]
    assert len({min(range(6), key=lambda k, d=drum: math.dist(d, seen[k])) for drum in drums}) == 6  # type: ignore[misc]
    assert sum(errors) / 6 <= 0.25 * FT
    assert max(errors) <= 0.35 * FT
    assert summary["link"]["frames"] > 50 * DRIVE_S
    assert (summary["link"]["bad"], summary["link"]["lost"]) == (0, 0)
    assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])
    assert summary["cycles"] == pytest.approx(DRIVE_S * settings.cycle.rate_hz, abs=2)
    assert (summary["late"], summary["missed"], summary["timing"]["overruns"]) == (0, 0, 0)


def test_an_echo_waits_for_no_timer(monkeypatch: pytest.MonkeyPatch) -> None:
    """The cycle that takes an echo begins at the moment at which the echo's last byte was read from the line."""
    decoder, arrived, waits_s = Decoder("robot"), dict[int, float](), list[float]()

    def on_bytes(way: str, at_s: float, _host_s: float, data: bytes) -> None:
        if way == "in":
            arrived.update((frame.t_us, at_s) for frame in decoder.feed(data) if isinstance(frame, Echo))

    def on_cycle(record: CycleRecord, *_: State | CycleStats | RobotDriver) -> None:
        for firing in record.inputs.received.firings:
            waits_s.append(record.inputs.run_s - arrived[round(firing.robot_s * 1e6)])
        if len(waits_s) >= 100:
            process.stop()

    with in_virtual_time(monkeypatch) as (loop, settings, _robot, _links):
        process = RobotProcess(settings, Log().log, Observers(on_cycle, on_bytes=on_bytes), loop.time)
        summary = loop.run_until_complete(process.run(arm=True, seconds=None))
    # The first echoes find the phase of the cycles.
    assert max(waits_s[10:]) == pytest.approx(0.0, abs=1e-6)
    assert summary["timing"]["following"] > 0.8
    assert summary["timing"]["echo_wait"]["p50"] == pytest.approx(0.0, abs=1.0)


def test_a_robot_that_an_earlier_run_left_latched_is_released_and_driven(monkeypatch: pytest.MonkeyPatch) -> None:
    log, moving = Log(), list[float]()
    with in_virtual_time(monkeypatch) as (loop, settings, robot, links):
        for run in range(2):
            process = RobotProcess(settings, log.log, clock=loop.time)
            links[run]._begin_s = links[0]._begin_s  # it is the same robot
            loop.call_later(2.5, lambda: moving.append(robot.truth.twist.v))
            summary = loop.run_until_complete(process.run(arm=True, seconds=3.0))
            assert moving.pop() > 0.2
            assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])
            assert (summary["link"]["bad"], summary["link"]["lost"]) == (0, 0)
            assert robot.truth.flags & Flags.LATCHED
            assert robot.truth.twist.v == 0.0
    assert [event["mode"] for event in log.events if event["event"] == "mode"] == 2 * ["READY", "DRIVE"]


def test_the_first_cycle_arms_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each cycle that passes before is a twentieth of a second of every start."""
    begins_s, modes = list[float](), list[Mode]()

    def on_cycle(record: CycleRecord, *_: State | CycleStats | RobotDriver) -> None:
        begins_s.append(record.inputs.run_s)
        modes.append(record.mode.mode)

    with in_virtual_time(monkeypatch) as (loop, settings, _robot, _links):
        process = RobotProcess(settings, Log().log, Observers(on_cycle), loop.time)
        loop.run_until_complete(process.run(arm=True, seconds=0.5))
    assert modes[0] is Mode.READY
    period_s = 1.0 / settings.cycle.rate_hz
    assert begins_s[modes.index(Mode.DRIVE)] - begins_s[0] <= ARMING_MIN_S + period_s + 1e-6


def test_a_line_that_the_first_cycle_finds_lost_is_armed_once_it_is_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """The driver finds it in its tick, after a look at its state that found it ready."""
    lines = list[LineState]()
    with in_virtual_time(monkeypatch) as (loop, settings, _robot, links):

        def on_cycle(record: CycleRecord, *_: State | CycleStats | RobotDriver) -> None:
            lines.append(record.inputs.line)

        def lose(run_s: float) -> None:
            monkeypatch.setattr(process._driver, "tick", tick)
            links[0].pull()
            links[0].plug()
            tick(run_s)

        def before_cycles(_realtime: object) -> tuple[str, ...]:
            monkeypatch.setattr(process._driver, "tick", lose)
            return ()

        process = RobotProcess(settings, Log().log, Observers(on_cycle), loop.time)
        tick = process._driver.tick
        monkeypatch.setattr("runtime.cycle.process.apply_realtime", before_cycles)
        summary = loop.run_until_complete(process.run(arm=True, seconds=2.0))
    assert lines[0] is not LineState.READY
    assert summary["mode"] == "DRIVE"


def test_a_halt_before_the_first_cycle_counts_more_than_arming(monkeypatch: pytest.MonkeyPatch) -> None:
    with in_virtual_time(monkeypatch) as (loop, settings, _robot, _links):
        process = RobotProcess(settings, Log().log, clock=loop.time)
        process.request(Request.HALT)
        summary = loop.run_until_complete(process.run(arm=True, seconds=0.5))
    assert summary["mode"] == "SAFE_STOP"


def test_without_an_arm_it_stays_in_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    log = Log()
    with in_virtual_time(monkeypatch) as (loop, settings, robot, _links):

        def on_cycle(record: CycleRecord, *_: State | CycleStats | RobotDriver) -> None:
            speeds.append(robot.truth.twist.v)
            modes.append(record.mode.mode)

        speeds, modes = list[float](), list[Mode]()
        process = RobotProcess(settings, log.log, Observers(on_cycle), loop.time)
        loop.call_later(3.0, lambda: process.request(Request.ARM))
        loop.run_until_complete(process.run(arm=False, seconds=5.0))
    first = modes.index(Mode.DRIVE)
    assert first > 50
    assert set(modes[:first]) == {Mode.READY}
    assert max(speeds[:first]) == 0.0, "it moved without being armed"
    assert speeds[-1] > 0.2


def test_a_cycle_that_fails_halts_the_base_and_ends_in_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    log, speeds = Log(), list[float]()

    def fail(record: CycleRecord, *_: State | CycleStats | RobotDriver) -> None:
        speeds.append(robot.truth.twist.v)
        if record.cycle == 40:
            raise ZeroDivisionError("planted")

    with in_virtual_time(monkeypatch) as (loop, settings, robot, _links):
        process = RobotProcess(settings, log.log, Observers(on_cycle=fail), loop.time)
        summary = loop.run_until_complete(process.run(arm=True, seconds=60.0))
        assert speeds[-1] > 0.1
        assert robot.truth.twist.v == 0.0
        assert robot.truth.flags & Flags.LATCHED
    assert summary["mode"] == "FAULT"
    assert summary["cycles"] == 39
    assert "ZeroDivisionError: planted" in summary["stop_reasons"][-1]
    (error,) = [event for event in log.events if event["event"] == "the cycle failed"]
    assert str(error["exc_info"]) == "planted"


def test_a_base_is_halted_whatever_fails_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_footprint: Footprint) -> FootprintRow:
        raise ValueError("planted")

    monkeypatch.setattr(Footprint, "close", fail)
    with in_virtual_time(monkeypatch, "perception.method=paper") as (loop, settings, robot, _links):
        process = RobotProcess(settings, Log().log, clock=loop.time)
        with pytest.raises(ValueError, match="planted"):
            loop.run_until_complete(process.run(arm=True, seconds=2.0))
        assert robot.truth.twist.v == 0.0
        assert robot.truth.flags & Flags.LATCHED


def test_overruns_in_a_row_end_in_a_safe_stop_that_names_the_callback(monkeypatch: pytest.MonkeyPatch) -> None:
    """The sampled stack is scripted: the sampler itself needs a real timer, see tests/runtime/timing."""
    planted_from = 40

    class Scripted(StallSampler):
        def sample_after(self, delay_s: float) -> None:  # noqa: ARG002
            self.sample = StackSample("hold_the_loop", "hold_the_loop")

    monkeypatch.setattr("runtime.timing.cycle_scheduler.StallSampler", Scripted)
    with in_virtual_time(monkeypatch, "cycle.overruns_max=5") as (loop, settings, robot, _links):

        def hold_the_loop() -> None:
            loop.spend(0.09)

        def plant(record: CycleRecord, *_: State | CycleStats | RobotDriver) -> None:
            if record.cycle > planted_from:
                asyncio.get_running_loop().call_later(0.002, hold_the_loop)
            if record.mode.mode is Mode.SAFE_STOP:
                process.stop()

        process = RobotProcess(settings, Log().log, Observers(on_cycle=plant), loop.time)
        summary = loop.run_until_complete(process.run(arm=True, seconds=60.0))
        assert robot.truth.flags & Flags.LATCHED
    assert summary["mode"] == "SAFE_STOP"
    (reason,) = summary["stop_reasons"]
    assert reason.startswith("5 cycles in a row left no time for the next one, mostly through callback hold_the_loop")
    # A cycle that keeps its time begins the count anew.
    assert planted_from + 5 <= summary["cycles"] <= planted_from + 20
    assert summary["timing"]["overruns"] >= 5
    assert summary["timing"]["faults"]["callback hold_the_loop"] >= 5
