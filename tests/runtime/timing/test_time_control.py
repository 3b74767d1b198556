"""Tests of the control of time: in a pause nothing stops, is lost or moves, and one step is one cycle."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

import pytest
import structlog

from config.settings import Settings
from drivers.driver import RobotDriver
from drivers.emulator.robot_device import RobotDevice
from drivers.messages import Flags
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.cycle.summary import RunSummary
from runtime.timing.cycle_stats import CycleStats
from runtime.timing.time_control import ENDED, HANGS, LEAD_S, NO_CYCLE, REAL_ROBOT, EmulatorTimeControl, NoTimeControl
from tests.runtime.paused_time import PausableRun, pausable_run

pytestmark = pytest.mark.compiled

CYCLE_S = 0.05
LONG_S = 30.0
"""Sixty times the base's deadman, and far beyond any timeout of the line."""


@dataclass
class Watched:
    """A run as its observer sees it."""

    records: list[CycleRecord] = field(default_factory=list)
    pieces: list[tuple[str, float]] = field(default_factory=list)
    busy_s: float = 0.0
    """What a cycle takes."""
    spend: Callable[[float], None] = lambda _s: None

    def on_cycle(self, record: CycleRecord, _state: State, _stats: CycleStats, _driver: RobotDriver) -> None:
        self.records.append(record)
        self.spend(self.busy_s)

    def on_bytes(self, way: str, _run_s: float, host_s: float, _data: bytes) -> None:
        self.pieces.append((way, host_s))

    @property
    def modes(self) -> list[Mode]:
        """Each mode that was entered, in order."""
        return [mode for mode, _ in itertools.groupby(record.mode.mode for record in self.records)]


Act = Callable[[RobotProcess, Watched], Awaitable[None]]


def run(it: PausableRun, act: Act) -> tuple[RunSummary, Watched]:
    """Drive, do something to it, and end."""
    watched = Watched(spend=it.loop.spend)
    process = RobotProcess(
        it.settings, structlog.get_logger(), Observers(watched.on_cycle, on_bytes=watched.on_bytes), it.control.clock
    )

    async def whole() -> RunSummary:
        running = asyncio.create_task(process.run(arm=True, seconds=None))
        try:
            await until(lambda: len(watched.records) >= 60)
            assert watched.records[-1].mode.mode is Mode.DRIVE
            await act(process, watched)
        finally:
            process.stop()
            summary = await asyncio.wait_for(running, 20.0)
        return summary

    return it.loop.run_until_complete(whole()), watched


async def until(done: Callable[[], bool], timeout_s: float = 60.0) -> None:
    async with asyncio.timeout(timeout_s):
        while not done():
            await asyncio.sleep(0.001)


def emulated_s(robot: RobotDevice) -> float:
    return robot.truth.emulated_s


def test_a_pause_of_any_length_is_invisible_to_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    with pausable_run(monkeypatch) as it:

        async def act(_process: RobotProcess, watched: Watched) -> None:
            for pause_s in (0.0, 0.4, LONG_S):
                assert await it.control.pause() is None
                assert it.control.is_paused
                cycles, pieces_in, here_s = len(watched.records), len(watched.pieces), it.control.clock()
                where, robot_s = it.robot.truth, emulated_s(it.robot)
                await asyncio.sleep(pause_s)
                assert (len(watched.records), it.control.clock()) == (cycles, here_s)
                assert (it.robot.truth, emulated_s(it.robot)) == (where, robot_s)
                assert len(watched.pieces) <= pieces_in + 2, "what was on its way may come"
                assert await it.control.resume() is None
                await until(lambda before=cycles: len(watched.records) >= before + 40)  # type: ignore[misc]

        summary, watched = run(it, act)
    assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])
    assert (summary["link"]["bad"], summary["link"]["lost"]) == (0, 0)
    assert watched.modes[-1] is Mode.DRIVE
    assert Mode.SAFE_STOP not in watched.modes
    times = [record.inputs.run_s for record in watched.records]
    gaps = [b - a for a, b in itertools.pairwise(times)]
    assert max(gaps) < 1.8 * CYCLE_S, "the run's time knows of no pause"
    firings = [f.robot_s for record in watched.records for f in record.inputs.received.firings]
    step_s = it.settings.ring.firing.step_period_s
    assert max(b - a for a, b in itertools.pairwise(firings)) < 1.5 * step_s, "no firing is missing"


def test_a_pause_is_invisible_to_the_base_and_nothing_moves_in_it(monkeypatch: pytest.MonkeyPatch) -> None:
    with pausable_run(monkeypatch) as it:

        async def act(process: RobotProcess, watched: Watched) -> None:
            assert await it.control.pause() is None
            before = it.robot.truth
            assert before.twist.v > 0.1
            await asyncio.sleep(LONG_S)
            process.request(Request.HALT)
            await asyncio.sleep(LONG_S)
            assert it.robot.truth.flags & Flags.LATCHED, "a HALT takes effect in a pause"
            assert it.robot.truth.pose == before.pose
            assert await it.control.resume() is None
            await until(lambda: watched.records[-1].mode.mode is Mode.SAFE_STOP)
            await asyncio.sleep(1.0)
            after = it.robot.truth
            assert (after.twist.v, after.twist.w) == (0.0, 0.0)
            assert after.pose.x - before.pose.x < 0.05, "it brakes and does not drive on"

        summary, _ = run(it, act)
    assert summary["stop_reasons"] == ["halted by the operator; re-arm to continue"]


def test_one_step_is_one_cycle_and_one_period(monkeypatch: pytest.MonkeyPatch) -> None:
    with pausable_run(monkeypatch) as it:

        async def act(_process: RobotProcess, watched: Watched) -> None:
            assert await it.control.pause() is None
            for _ in range(30):
                cycles, before_s, robot_s = len(watched.records), it.control.clock(), emulated_s(it.robot)
                assert await it.control.single_step() is None
                assert it.control.is_paused
                assert len(watched.records) == cycles + 1
                went_s = it.control.clock() - before_s
                assert went_s <= 1.8 * CYCLE_S
                assert emulated_s(it.robot) - robot_s <= went_s + 0.02
                await asyncio.sleep(1.0)
                assert len(watched.records) == cycles + 1
            first, last = watched.records[-30], watched.records[-1]
            assert last.inputs.run_s - first.inputs.run_s == pytest.approx(29 * CYCLE_S, rel=0.05)
            assert sum(len(record.inputs.received.firings) for record in watched.records[-30:]) >= 28
            assert await it.control.resume() is None
            await until(lambda: len(watched.records) >= 110)

        summary, _watched = run(it, act)
    assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])
    assert (summary["link"]["bad"], summary["link"]["lost"]) == (0, 0)


def test_a_step_pauses_a_run_that_is_not_paused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pausable_run(monkeypatch) as it:

        async def act(_process: RobotProcess, watched: Watched) -> None:
            assert await it.control.single_step() is None
            assert it.control.is_paused
            cycles = len(watched.records)
            await asyncio.sleep(3.0)
            assert len(watched.records) == cycles

        summary, _ = run(it, act)
    assert summary["stop_reasons"] == []


@pytest.mark.parametrize(
    ("factor", "count"),
    [pytest.param(0.1, 40, marks=pytest.mark.soak), pytest.param(3.0, 100, marks=pytest.mark.soak), (10.0, 60)],
)
def test_another_speed_changes_nothing_else(monkeypatch: pytest.MonkeyPatch, factor: float, count: int) -> None:
    with pausable_run(monkeypatch) as it:

        async def act(_process: RobotProcess, watched: Watched) -> None:
            assert await it.control.set_speed(factor) is None
            assert it.control.speed == factor
            start_s, run_s, robot_s = it.loop.time(), it.control.clock(), emulated_s(it.robot)
            cycles = len(watched.records)
            await until(lambda: len(watched.records) >= cycles + count, 200.0)
            took_s = it.loop.time() - start_s
            assert (it.control.clock() - run_s) / took_s == pytest.approx(factor, rel=0.1)
            assert (emulated_s(it.robot) - robot_s) / took_s == pytest.approx(factor, rel=0.1)
            assert await it.control.set_speed(1.0) is None
            assert await it.control.set_speed(1.0) is None
            await until(lambda: len(watched.records) >= cycles + count + 40)

        summary, watched = run(it, act)
    assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])
    assert (summary["link"]["bad"], summary["link"]["lost"]) == (0, 0)
    gaps = [b.inputs.run_s - a.inputs.run_s for a, b in itertools.pairwise(watched.records)]
    assert sum(gaps) / len(gaps) == pytest.approx(CYCLE_S, rel=0.05)


@pytest.mark.parametrize("hold_s", [pytest.param(0.01, marks=pytest.mark.soak), 3.0])
def test_fast_motion_waits_for_a_slow_process(monkeypatch: pytest.MonkeyPatch, hold_s: float) -> None:
    """A machine that cannot keep up with ten times real time is slower, and no reason to stop."""
    with pausable_run(monkeypatch) as it:

        async def act(_process: RobotProcess, watched: Watched) -> None:
            assert await it.control.set_speed(10.0) is None
            for _ in range(20):
                cycles = len(watched.records)
                await until(lambda before=cycles: len(watched.records) > before)  # type: ignore[misc]
                it.loop.spend(hold_s)

        summary, watched = run(it, act)
    assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])
    gaps = [b.inputs.run_s - a.inputs.run_s for a, b in itertools.pairwise(watched.records)]
    assert max(gaps) < 2.5 * CYCLE_S


def test_fast_motion_waits_for_slow_cycles(monkeypatch: pytest.MonkeyPatch) -> None:
    with pausable_run(monkeypatch) as it:

        async def act(_process: RobotProcess, watched: Watched) -> None:
            assert await it.control.set_speed(10.0) is None
            watched.busy_s, cycles = 0.08, len(watched.records)
            await until(lambda: len(watched.records) > cycles + 40)
            watched.busy_s = 0.0

        summary, _ = run(it, act)
    assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])


def test_a_pause_in_fast_motion_keeps_its_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    with pausable_run(monkeypatch) as it:

        async def act(_process: RobotProcess, watched: Watched) -> None:
            assert await it.control.set_speed(4.0) is None
            for _ in range(10):
                assert await it.control.pause() is None
                cycles = len(watched.records)
                assert await it.control.single_step() is None
                assert len(watched.records) == cycles + 1
                await asyncio.sleep(2.0)
                assert len(watched.records) == cycles + 1
                assert await it.control.resume() is None
                assert it.control.speed == 4.0
                await until(lambda before=cycles: len(watched.records) > before + 7)  # type: ignore[misc]
            assert await it.control.pause() is None
            assert await it.control.set_speed(0.5) is None
            assert it.control.is_paused
            assert await it.control.resume() is None
            assert it.control.speed == 0.5

        summary, _ = run(it, act)
    assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])


def test_a_paused_run_ends_in_good_order(monkeypatch: pytest.MonkeyPatch) -> None:
    with pausable_run(monkeypatch) as it:

        async def act(_process: RobotProcess, _watched: Watched) -> None:
            assert await it.control.pause() is None

        summary, _ = run(it, act)
        assert it.robot.truth.flags & Flags.LATCHED
        assert it.robot.truth.twist.v == 0.0
    assert summary["mode"] == "DRIVE"


def test_a_hanging_emulator_is_reported_and_the_run_stops_for_its_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    with pausable_run(monkeypatch) as it:

        async def act(_process: RobotProcess, watched: Watched) -> None:
            it.links[0].is_hung = True
            asked_s = it.loop.time()
            assert await it.control.pause() == HANGS
            assert it.loop.time() - asked_s < 2.5
            assert not it.control.is_paused
            await until(lambda: watched.records[-1].mode.mode is Mode.SAFE_STOP)
            it.links[0].is_hung = False

        summary, _ = run(it, act)
    assert "nothing received for" in summary["stop_reasons"][0]


@pytest.mark.parametrize("when", ["running", "pausing", pytest.param("paused", marks=pytest.mark.soak)])
def test_an_emulator_that_ends_is_reported_and_the_run_goes_on_to_its_stop(
    monkeypatch: pytest.MonkeyPatch, when: str
) -> None:
    with pausable_run(monkeypatch) as it:

        async def act(_process: RobotProcess, watched: Watched) -> None:
            asked: asyncio.Task[str | None] | None = None
            if when == "paused":
                assert await it.control.pause() is None
            if when == "pausing":
                asked = asyncio.create_task(it.control.pause())
                await asyncio.sleep(0.5 * LEAD_S)
            it.links[0].pull()
            it.control.emulator_ended()
            assert asked is None or await asked == ENDED
            for call in (it.control.pause, it.control.resume, it.control.single_step):
                assert await call() == ENDED
            assert await it.control.set_speed(2.0) == ENDED
            await until(lambda: watched.records[-1].mode.mode is Mode.SAFE_STOP)

        summary, _ = run(it, act)
    assert summary["stop_reasons"]


@pytest.mark.parametrize("rounds", [25, pytest.param(250, marks=pytest.mark.soak)])
def test_random_commands(monkeypatch: pytest.MonkeyPatch, rounds: int) -> None:
    """Four requests at once in any order: the robot drives on and no echo is lost."""
    import random

    rng = random.Random(7)
    with pausable_run(monkeypatch, "perception.method=paper", "behaviors.move_ahead.at_end=turn_back") as it:

        async def act(_process: RobotProcess, watched: Watched) -> None:
            calls: list[Callable[[], Awaitable[str | None]]] = [
                it.control.pause, it.control.resume, it.control.single_step,
                lambda: it.control.set_speed(rng.choice([0.1, 0.5, 1.0, 2.0, 10.0])),
            ]  # fmt: skip
            for _ in range(rounds):
                assert await asyncio.gather(*(rng.choice(calls)() for _ in range(4))) == [None] * 4
                await asyncio.sleep(rng.choice([0.0, 0.003, 0.07]))
            assert await it.control.set_speed(1.0) is None
            assert await it.control.resume() is None
            cycles = len(watched.records)
            await until(lambda: len(watched.records) > cycles + 20)

        summary, watched = run(it, act)
    assert (summary["mode"], summary["stop_reasons"]) == ("DRIVE", [])
    assert (summary["link"]["bad"], summary["link"]["lost"]) == (0, 0)
    firings = [f.robot_s for record in watched.records for f in record.inputs.received.firings]
    step_s = it.settings.ring.firing.step_period_s
    assert max(b - a for a, b in itertools.pairwise(firings)) < 1.5 * step_s


def test_invalid_requests_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pausable_run(monkeypatch) as it:

        async def before_the_first_cycle(control: EmulatorTimeControl) -> None:
            assert await control.pause() == NO_CYCLE
            assert await control.single_step() == NO_CYCLE
            for factor in (0.0, -1.0, 0.05, 11.0, float("nan"), float("inf")):
                assert "must be from 0.1 to 10" in str(await control.set_speed(factor))

        it.loop.run_until_complete(before_the_first_cycle(it.control))


async def test_the_time_of_a_real_robot_cannot_be_controlled() -> None:
    control = NoTimeControl()
    for answer in (await control.pause(), await control.resume(), await control.single_step(),
                   await control.set_speed(2.0)):  # fmt: skip
        assert answer == REAL_ROBOT
    assert (control.is_paused, control.speed) == (False, 1.0)


def test_the_settings_are_those_of_the_hall(monkeypatch: pytest.MonkeyPatch) -> None:
    with pausable_run(monkeypatch) as it:
        assert isinstance(it.settings, Settings)
        assert 1.0 / it.settings.cycle.rate_hz == CYCLE_S
