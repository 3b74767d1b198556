"""P25: the base is not believed on its word; motion is judged by what the emulator truly did."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.driver import LineState
from drivers.emulator.faults import BlockedWheels, Bumper, Deadman, Fault, IgnoredHalt, Runaway
from drivers.messages import Twist
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.step import Order
from tests.runtime.emulated_run import Run, hallway

pytestmark = [pytest.mark.compiled, pytest.mark.promise("P25")]


HALTS_AT_S = (2.0, 3.35, 4.15)
SPEED_M_S = 0.3


def driving(*faults: Fault, until_s: float = 2.0, arms: bool = True) -> Run:
    """Return a run on the hallway's robot after some time; from then on it is armed by requests only."""
    run = hallway(1, *faults, method="paper", arms=arms)
    run.until(until_s)
    assert run.mode is (Mode.DRIVE if arms else Mode.READY)
    run.arms = False
    return run


def halts(run: Run, since: int) -> int:
    """Return how many HALTs have been commanded since a cycle."""
    return sum(record.command is Order.HALT for record in run.records[since:])


def ignored_halt(at_s: float = 0.0) -> IgnoredHalt:
    return IgnoredHalt(kind="ignored_halt", at_s=at_s, duration_s=1e3)


def blocked(at_s: float, duration_s: float = 1e3) -> BlockedWheels:
    return BlockedWheels(kind="blocked_wheels", at_s=at_s, duration_s=duration_s)


def runaway(at_s: float, v_m_s: float, duration_s: float = 1e3) -> Runaway:
    return Runaway(kind="runaway", at_s=at_s, duration_s=duration_s, v_m_s=v_m_s)


def is_standing(run: Run) -> bool:
    """Return whether the true base has never moved."""
    return all(truth.twist == Twist(0.0, 0.0) and truth.pose == run.truths[0].pose for truth in run.truths)


@pytest.mark.parametrize("deadman_ms", [0, 1, 65_535])
def test_a_base_with_a_useless_deadman_is_not_driven(deadman_ms: int, measured: Callable[[str], None]) -> None:
    run = hallway(1, Deadman(kind="deadman", at_s=0.0, deadman_ms=deadman_ms), method="paper")
    run.until(3.0)
    assert run.driver.state is LineState.DOWN
    assert run.mode is Mode.CONNECTING
    assert "correct the deadman" in (run.state.mode.reason or "")
    assert is_standing(run)
    measured(f"a deadman of {deadman_ms:,} ms: refused, not driven")


@pytest.mark.parametrize("at_s", HALTS_AT_S)
def test_a_base_that_ignores_halt_is_in_fault_and_halted_again_and_again(
    at_s: float, measured: Callable[[str], None]
) -> None:
    """It acknowledges HALT, reports its latch, and drives on."""
    run = driving(ignored_halt(), until_s=at_s)
    before, began_s = len(run.records), run.run_s
    run.until_true(lambda: run.mode is Mode.FAULT, 1.2, Request.HALT)
    after_s = run.run_s - began_s
    assert "does not obey HALT" in (run.state.mode.reason or "")
    run.until(run.run_s + 3.0)
    assert run.truths[-1].twist.v == pytest.approx(SPEED_M_S), "it truly drives on"
    assert halts(run, before) >= 6
    for _ in range(40):
        run.cycle(Request.ARM)
    assert run.mode is Mode.FAULT
    assert not any(isinstance(record.command, Twist) for record in run.records[before:])
    measured(f"HALT ignored at {SPEED_M_S} m/s: FAULT {after_s:.2f} s after it, HALT again every half second")


def test_a_base_that_brakes_is_halted_once() -> None:
    for at_s in HALTS_AT_S:
        run = driving(until_s=at_s)
        before = len(run.records)
        run.cycle(Request.HALT)
        run.until(run.run_s + 3.0)
        assert (run.mode, halts(run, before)) == (Mode.SAFE_STOP, 1)
        assert "halted by the operator" in (run.state.mode.reason or "")


def test_a_disarmed_base_ramps_down_to_its_standstill() -> None:
    run = driving()
    run.cycle(Request.DISARM)
    run.until(run.run_s + 3.0)
    assert run.mode is Mode.READY
    assert run.truths[-1].twist == Twist(0.0, 0.0)


def test_a_base_that_is_pushed_while_it_is_halted_is_not_in_fault() -> None:
    """By 2 m, and it can be armed again afterwards."""
    run = driving(ignored_halt(4.0), runaway(4.0, 0.5, 4.0))
    run.cycle(Request.HALT)
    run.until(9.0)
    assert run.mode is Mode.SAFE_STOP
    assert "moves without a command" in (run.state.mode.reason or "")
    run.until_true(lambda: run.mode is Mode.DRIVE, 1.0, Request.ARM)


def test_a_base_that_runs_away_while_it_is_ready_is_halted(measured: Callable[[str], None]) -> None:
    run = driving(runaway(3.0, 0.3), arms=False)
    run.until_true(lambda: run.mode is Mode.SAFE_STOP, 3.0)
    assert "moves without a command" in (run.state.mode.reason or "")
    run.until(run.run_s + 1.0)
    assert run.truths[-1].twist == Twist(0.0, 0.0)
    way_m = run.truths[-1].pose.x - run.truths[0].pose.x
    assert 0.0 < way_m <= 0.35
    measured(f"a base that starts by itself is halted {way_m:.2f} m from where it stood")


@pytest.mark.parametrize("v_m_s", [0.5, -0.3])
def test_a_base_that_drives_otherwise_than_commanded_is_stopped(v_m_s: float) -> None:
    run = driving(runaway(2.0, v_m_s))
    run.until_true(lambda: run.mode is not Mode.DRIVE, 2.5)
    assert run.mode is Mode.SAFE_STOP
    assert "than commanded" in (run.state.mode.reason or "")
    run.until(run.run_s + 1.0)
    assert run.truths[-1].twist == Twist(0.0, 0.0)
    assert run.mode is Mode.SAFE_STOP, "it obeys HALT"


def test_a_runaway_that_ignores_halt_ends_in_fault() -> None:
    run = driving(runaway(2.0, 0.5), ignored_halt(2.0))
    run.until_true(lambda: run.mode is Mode.FAULT, 4.0)


def test_a_base_that_does_not_move_is_stopped_after_a_second(measured: Callable[[str], None]) -> None:
    run = driving(blocked(2.0))
    began_s = run.run_s
    run.until_true(lambda: run.mode is not Mode.DRIVE, 1.5)
    after_s = run.run_s - began_s
    assert after_s >= 1.0
    assert run.mode is Mode.SAFE_STOP
    assert "does not move although it is commanded to" in (run.state.mode.reason or "")
    measured(f"blocked wheels: SAFE_STOP {after_s:.2f} s later")


def test_a_base_that_is_held_for_a_moment_drives_on() -> None:
    run = driving(blocked(2.0, 0.85))
    run.until(5.0)
    assert run.mode is Mode.DRIVE
    assert run.truths[-1].twist.v > 0.0


def test_a_base_that_touches_something_names_the_contact() -> None:
    run = driving(Bumper(kind="bumper", at_s=2.0, duration_s=9.0))
    run.until(6.0)
    assert run.mode is Mode.SAFE_STOP
    assert "bumper contact" in (run.state.mode.reason or "")
    assert halts(run, 0) == 1
