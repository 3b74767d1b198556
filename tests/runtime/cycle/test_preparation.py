"""A process whose recognition is not ready yet: the robot drives without it, and what needs it waits."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest
import structlog
from structlog.testing import LogCapture

from behaviors.missions.mission import Mission
from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from config.errors import FAILED, UserError
from config.load import load_mission, load_settings
from config.settings import Settings
from drivers.driver import LineState, Received, RobotDriver
from drivers.emulator.faults import Mute
from runtime.cycle.drive_requests import NO_MAP, DriveRequest
from runtime.cycle.inputs import Inputs, Request
from runtime.cycle.modes import Mode
from runtime.cycle.preparation import RECOGNITION_READY, RunningPreparation, fresh_state
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, Refused, State, step
from runtime.support.kernel_loader import InThread
from runtime.timing.cycle_stats import CycleStats
from tests.runtime.virtual_time import in_virtual_time

PREPARING_S = 2.0
SETTINGS = load_settings("hallway")


class Preparation:
    """Takes a fixed time, or fails after it."""

    progress = "recognition is being prepared: 3 of 10 kernels, about 7 s left"

    def __init__(self, seconds: float = PREPARING_S, error: UserError | None = None, ring_s: float = 0.0) -> None:
        self._seconds = seconds
        self._ring_s = ring_s
        self._error = error
        self.is_cancelled = False
        self.is_over = asyncio.Event()

    async def ring(self, settings: Settings) -> None:
        await asyncio.sleep(self._ring_s)
        self.has_ring = settings.ring == SETTINGS.ring

    async def __call__(self, settings: Settings, _in_thread: InThread) -> None:
        assert self.has_ring
        assert settings.ring == SETTINGS.ring
        try:
            await asyncio.sleep(self._seconds)
        except asyncio.CancelledError:
            self.is_cancelled = True
            raise
        if self._error is not None:
            raise self._error


class Port:
    """A port to which a robot is plugged in, or that is missing."""

    def __init__(self, *, is_missing: bool = False) -> None:
        self._is_missing = is_missing

    def refuse_missing(self) -> None:
        if self._is_missing:
            raise UserError("no such port")

    async def connect(self, is_stopping: Callable[[], bool]) -> None:
        assert not is_stopping()
        assert not self._is_missing


class Run:
    """A run in virtual time whose recognition is ready later than the robot."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, preparation: Preparation, request: DriveRequest | None = None,
        seconds: float | None = None,
    ) -> None:  # fmt: skip
        self._monkeypatch = monkeypatch
        self._preparation = preparation
        self._request = request
        self._seconds = seconds
        self.cycles: list[CycleRecord] = []
        self.holds: list[str | None] = []
        self.speeds: list[float] = []
        self.log = LogCapture()
        self.shown: list[str] = []

    @property
    def unprepared(self) -> list[CycleRecord]:
        """The cycles before recognition began."""
        return [record for record in self.cycles if record.inputs.preparing is not None]

    def drive(self, seconds: float, at: dict[float, Callable[[RobotProcess], object]] | None = None) -> None:
        """Run for this long, seen from the start; call each function at its time after that."""

        def on_cycle(record: CycleRecord, state: State, *_: CycleStats | RobotDriver) -> None:
            assert state.perception.recognises is (record.inputs.preparing is None)
            if not state.perception.recognises:
                assert state.perception.labelled_objects() == ()
            self.cycles.append(record)
            self.holds.append(state.hold_reason)
            self.speeds.append(robot.truth.twist.v)

        with in_virtual_time(self._monkeypatch) as (loop, settings, robot, _links):
            process = RobotProcess(
                settings,
                structlog.wrap_logger(None, processors=[self.log]),
                Observers(on_cycle, on_starting=self.shown.append),
                loop.time,
                preparation=self._preparation,
            )
            if self._request is not None:
                process.drive_request(self._request)
            loop.call_later(seconds, process.stop)
            for moment_s, act in (at or {}).items():
                loop.call_later(moment_s, act, process)
            self.summary = loop.run_until_complete(process.run(arm=True, seconds=self._seconds))
            self.last_speed = robot.truth.twist.v


@pytest.mark.usefixtures("warm_kernels")  # it counts compilations
def test_the_robot_drives_before_recognition_is_ready_and_goes_on_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    preparation = Preparation()
    run = Run(monkeypatch, preparation)
    run.drive(6.0)
    before = run.unprepared
    assert before == run.cycles[: len(before)], "recognition begins once"
    assert 0.8 * PREPARING_S * SETTINGS.cycle.rate_hz <= len(before) <= 1.2 * PREPARING_S * SETTINGS.cycle.rate_hz
    assert sum(len(record.inputs.received.firings) for record in before) >= 0.8 * len(before)
    assert run.speeds[len(before) - 1] > 0.1
    assert {record.inputs.preparing for record in before} == {Preparation.progress}
    events = [entry["event"] for entry in run.log.entries]
    assert events.count(Preparation.progress) == events.count(RECOGNITION_READY) == 1
    assert events.index(Preparation.progress) < events.index(RECOGNITION_READY)
    assert [record.cycle for record in run.cycles] == list(range(1, len(run.cycles) + 1))
    assert {record.segments for record in before} == {0}
    assert run.cycles[-1].segments > 0
    assert preparation.is_over.is_set(), "what else is to be loaded has waited for it"
    assert (run.summary["mode"], run.summary["preparing"]) == ("DRIVE", None)
    assert run.summary["process"]["compilations"] == 0


async def test_what_begins_with_recognition_is_measured_between_two_cycles() -> None:
    seen: list[bool] = []

    running = RunningPreparation(Preparation(0.0), structlog.get_logger(), lambda: seen.append(running.is_running))
    await running.start(SETTINGS, Port(), lambda: False)
    while not seen:
        assert running.progress(0.0) is not None
        await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert running.progress(0.0) is None, "the cycle with which recognition begins"
    assert seen == [True], "before that cycle, and once"


def test_a_long_wait_for_the_ring_is_reported_every_few_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a machine with much else to do it lasts minutes."""
    run = Run(monkeypatch, Preparation(ring_s=12.0))
    run.drive(16.0)
    assert len(run.shown) == len(set(run.shown)) == 2, "each says something new"
    assert run.shown == [entry["event"] for entry in run.log.entries if entry["event"] in run.shown]
    assert max(run.speeds) > 0.1


def test_a_run_that_ends_while_the_ring_is_prepared_ends_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Run(monkeypatch, Preparation(ring_s=1e6))
    run.drive(3.0)
    assert (run.summary["mode"], run.summary["cycles"], run.log.entries) == ("CONNECTING", 0, [])


async def test_a_port_that_is_missing_is_named_before_the_ring_is_prepared() -> None:
    running = RunningPreparation(Preparation(ring_s=1e6), structlog.get_logger(), lambda: None)
    with pytest.raises(UserError, match="no such port"):
        await running.start(SETTINGS, Port(is_missing=True), lambda: False)


@pytest.mark.usefixtures("warm_kernels")
def test_a_goal_waits_for_recognition_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Run(monkeypatch, Preparation(), Goal(2.0, 0.0))
    run.drive(6.0)
    count = len(run.unprepared)
    assert set(run.speeds[:count]) == {0.0}
    modes = [record.mode.mode for record in run.unprepared]
    assert {hold for hold, mode in zip(run.holds, modes, strict=False) if mode is Mode.DRIVE} == {
        Preparation.progress
    }
    assert max(run.speeds) > 0.1


def test_a_mission_that_needs_no_map_does_not_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    wander = Mission(load_mission("wander"))
    run = Run(monkeypatch, Preparation(1e6), wander)
    run.drive(4.0)
    assert max(run.speeds) > 0.1
    assert run.summary["preparing"] == Preparation.progress


def test_a_goal_in_the_map_is_refused_only_where_there_will_be_no_map() -> None:
    corrected = load_settings("hallway", ["perception.localization.correct_drift=true"])
    goal = Goal(1.0, 0.0, frame="map")
    inputs = Inputs(
        0.0, LineState.DOWN, None, Received((), None, rebooted=False), drive_request=goal, preparing="3 of 10"
    )
    for settings, why in ((corrected, ()), (SETTINGS, (Refused(None, NO_MAP),))):
        record = step(
            fresh_state(settings, recognises=False), inputs, settings, lambda _command: None, lambda _done: False
        )
        assert record.refused == why


def test_the_length_of_a_run_counts_from_recognition(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else a short run would recognise nothing on the first start."""
    run = Run(monkeypatch, Preparation(), seconds=1.0)
    run.drive(9.0)
    assert len(run.cycles) - len(run.unprepared) == pytest.approx(SETTINGS.cycle.rate_hz, abs=2)


def test_an_operator_steers_before_recognition_is_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Run(monkeypatch, Preparation(1e6))
    steer = Teleoperate(0.2, 0.0, 0.4)
    run.drive(4.0, {0.2 * k: lambda process: process.drive_request(steer) for k in range(20)})
    assert max(run.speeds) > 0.15
    assert run.summary["preparing"] == Preparation.progress


def test_safety_is_in_force_before_recognition_is_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Run(monkeypatch, Preparation(1e6))
    run.drive(6.0, {2.0: lambda process: process.request(Request.HALT)})
    assert run.cycles[-1].mode.mode is Mode.SAFE_STOP
    assert run.last_speed == 0.0
    assert max(run.speeds) > 0.1


def test_a_halt_before_the_first_cycle_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Run(monkeypatch, Preparation())
    run.drive(4.0, {0.0: lambda process: process.request(Request.HALT)})
    assert run.cycles[-1].mode.mode is Mode.SAFE_STOP, "it was armed although it was halted"
    assert set(run.speeds) == {0.0}


def test_a_run_can_end_before_recognition_is_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    preparation = Preparation(seconds=1e6)
    run = Run(monkeypatch, preparation)
    run.drive(3.0, {1.0: RobotProcess.stop})
    assert preparation.is_cancelled
    assert run.summary["preparing"] == Preparation.progress


def test_a_robot_that_does_not_answer_ends_the_preparation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the loop ends with a task that it destroys, which is said on the terminal below the reason."""
    preparation = Preparation(seconds=1e6)
    mute = Mute(kind="mute", at_s=0.0, duration_s=1e6)
    with in_virtual_time(monkeypatch, faults=(mute,)) as (loop, settings, _robot, _links):
        process = RobotProcess(settings, structlog.get_logger(), clock=loop.time, preparation=preparation)
        with pytest.raises(UserError, match="nothing is received"):
            loop.run_until_complete(process.run(arm=True, seconds=None))
    assert preparation.is_cancelled


def test_a_preparation_that_fails_halts_and_ends_the_run_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Run(monkeypatch, Preparation(error=UserError("no room", FAILED)))
    run.drive(6.0)
    assert run.last_speed == 0.0
    assert (run.summary["mode"], run.summary["stop_reasons"]) == ("FAULT", ["no room"])
    assert [entry["event"] for entry in run.log.entries if entry["log_level"] == "error"] == ["mode"], "no traceback"
