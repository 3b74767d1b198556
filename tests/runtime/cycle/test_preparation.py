"""A process whose recognition is not ready yet: echoes are shown, the robot stands, and then the run begins."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest
import structlog
from structlog.testing import LogCapture

from config.errors import FAILED, UserError
from config.load import load_settings
from config.settings import Settings
from drivers.driver import RobotDriver
from perception.edits import ClearMap
from perception.pipeline import Perception
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.preparation import NOTHING, REFUSED, NoMethod, prepared_state, unprepared_state
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.timing.cycle_stats import CycleStats
from tests.runtime.virtual_time import in_virtual_time

PREPARING_S = 2.0
SETTINGS = load_settings("hallway")


class Preparation:
    """Takes a fixed time, or fails after it."""

    progress = "recognition is being prepared: 3 of 10 kernels, about 7 s left"

    def __init__(self, seconds: float = PREPARING_S, error: UserError | None = None) -> None:
        self._seconds = seconds
        self._error = error
        self.is_cancelled = False

    async def __call__(self, settings: Settings) -> None:
        assert settings.ring == SETTINGS.ring
        try:
            await asyncio.sleep(self._seconds)
        except asyncio.CancelledError:
            self.is_cancelled = True
            raise
        if self._error is not None:
            raise self._error


class Run:
    """A run in virtual time that counts its cycles before and after recognition is ready."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, preparation: Preparation) -> None:
        self._monkeypatch = monkeypatch
        self._preparation = preparation
        self.unprepared: list[CycleRecord] = []
        self.cycles: list[CycleRecord] = []
        self.speeds: list[float] = []
        self.log = LogCapture()

    def drive(self, seconds: float, at: dict[float, Callable[[RobotProcess], None]] | None = None) -> None:
        """Run for this long after recognition is ready; call each function at its time after the start."""

        def on_unprepared(record: CycleRecord, state: State, *_: CycleStats | RobotDriver) -> None:
            assert state.perception.labelled_objects() == ()
            self.unprepared.append(record)
            self.speeds.append(robot.truth.twist.v)

        with in_virtual_time(self._monkeypatch) as (loop, settings, robot, _links):
            process = RobotProcess(
                settings,
                structlog.wrap_logger(None, processors=[self.log]),
                Observers(lambda record, *_: self.cycles.append(record), on_unprepared_cycle=on_unprepared),
                loop.time,
                preparation=self._preparation,
            )
            for moment_s, act in (at or {}).items():
                loop.call_later(moment_s, act, process)
            self.summary = loop.run_until_complete(process.run(arm=True, seconds=seconds))
            self.last_speed = robot.truth.twist.v


@pytest.mark.usefixtures("warm_kernels")  # it counts compilations
def test_echoes_are_shown_and_the_robot_stands_until_recognition_is_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Run(monkeypatch, Preparation())
    run.drive(3.0)
    echoes = sum(len(record.inputs.received.firings) for record in run.unprepared)
    assert len(run.unprepared) >= 0.8 * PREPARING_S * SETTINGS.cycle.rate_hz
    assert echoes >= 0.8 * len(run.unprepared)
    assert {record.mode.mode for record in run.unprepared} == {Mode.CONNECTING}
    assert {record.mode.reason for record in run.unprepared} == {Preparation.progress}
    assert set(run.speeds) == {0.0}
    assert [entry["event"] for entry in run.log.entries].count(Preparation.progress) == 1
    # The run itself begins with an empty map, and is timed and armed from there.
    assert [record.cycle for record in run.cycles] == list(range(1, len(run.cycles) + 1))
    assert run.cycles[0].segments == 0
    assert run.summary["cycles"] == len(run.cycles)
    assert run.summary["mode"] == "DRIVE"
    assert run.summary["process"]["compilations"] == 0


def test_a_halt_before_recognition_is_ready_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Run(monkeypatch, Preparation())
    run.drive(1.0, {1.0: lambda process: process.request(Request.HALT)})
    assert run.unprepared[-1].mode.mode is Mode.SAFE_STOP
    assert {record.mode.mode for record in run.cycles} == {Mode.SAFE_STOP}, "it was armed although it was halted"


def test_it_cannot_be_armed_before_recognition_is_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Run(monkeypatch, Preparation())
    run.drive(0.5, {1.0: lambda process: process.request(Request.ARM)})
    assert {record.mode.mode for record in run.unprepared} == {Mode.CONNECTING}
    assert set(run.speeds) == {0.0}


def test_a_run_can_end_before_recognition_is_ready(monkeypatch: pytest.MonkeyPatch) -> None:
    preparation = Preparation(seconds=1e6)
    run = Run(monkeypatch, preparation)
    run.drive(3.0, {1.0: RobotProcess.stop})
    assert run.cycles == []
    assert preparation.is_cancelled
    assert run.summary["mode"] == "CONNECTING"


def test_a_preparation_that_fails_ends_the_run_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Run(monkeypatch, Preparation(error=UserError("no room", FAILED)))
    run.drive(3.0)
    assert run.cycles == []
    assert (run.summary["mode"], run.summary["stop_reasons"]) == ("FAULT", ["no room"])


def test_a_fault_before_recognition_is_ready_is_a_reason_in_the_summary(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("out of order")

    run = Run(monkeypatch, Preparation())
    run.drive(0.5, {1.0: lambda process: process.health.report("the view", ValueError("no screen"))})
    assert run.summary["mode"] == "SAFE_STOP"
    assert "the view (ValueError: no screen)" in run.summary["stop_reasons"][0]
    run = Run(monkeypatch, Preparation())
    run.drive(0.5, {1.0: lambda process: monkeypatch.setattr(process, "_gather", fail)})
    assert (run.summary["mode"], run.cycles) == ("FAULT", [])
    assert "the cycle failed (RuntimeError: out of order, " in run.summary["stop_reasons"][0]


def test_the_empty_map_refuses_edits_and_changes_with_nothing() -> None:
    state = unprepared_state(SETTINGS)
    perception, before = state.perception, state.perception.segments()
    assert isinstance(perception.method, NoMethod)
    assert perception.edit(ClearMap()) == REFUSED
    perception.apply_settings(SETTINGS.perception)
    perception.set_models(())
    perception.reset()
    perception.method.drop_caches()
    assert perception.segment_geometry().shape == (0, 5)
    assert len(before.numbers) == len(before.times) == len(before.pinned) == 0
    assert (perception.counts, perception.objects(), perception.evidence(1)) == (NOTHING, (), None)
    assert (perception.can_refine, perception.refine(), perception.converged) == (False, 0, True)


def test_the_prepared_state_recognises_with_the_method_of_the_settings() -> None:
    state = prepared_state(SETTINGS)
    assert type(state.perception) is Perception
    assert not isinstance(state.perception.method, NoMethod)
