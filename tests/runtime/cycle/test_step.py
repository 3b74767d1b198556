"""Tests of the step: its commands, and when they are sent."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.driver import LineState
from drivers.messages import Flags, Pose, Twist
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.step import STANDSTILL, Command, Order
from tests.runtime.scripted_step import PERIOD_S, TIMEOUT_S, ScriptedRobot


def test_from_connecting_to_driving() -> None:
    script = ScriptedRobot()
    for line in (LineState.CLOSED, LineState.HANDSHAKE):
        record = script.cycle(line=line, firing=False, odometry=False)
        assert (record.mode.mode, record.command) == (Mode.CONNECTING, None)
    script.driving()
    record = script.cycle()
    assert isinstance(record.command, Twist)
    assert (record.command.v, record.command.w) == pytest.approx((0.3, 0.0))
    assert record.cycle == script.state.cycle


def test_ready_keeps_the_base_at_a_standstill_and_arming_releases_once() -> None:
    script = ScriptedRobot()
    commands = [script.cycle().command for _ in range(5)]
    assert commands == [STANDSTILL] * 5
    commands = [script.cycle(request=Request.ARM, flags=Flags.LATCHED).command]
    while script.state.mode.mode is Mode.READY and len(commands) < 100:
        commands.append(script.cycle(flags=Flags.LATCHED).command)
    assert commands[0] is Order.RELEASE
    assert set(commands[1:-1]) == {STANDSTILL}
    assert commands[-1] is Order.HALT, "a latch that does not clear is set again on purpose"
    assert script.state.mode.reason is not None


REASONS: list[tuple[str, dict[str, object], str]] = [
    ("halt", {"request": Request.HALT}, "operator"),
    ("line lost", {"line": LineState.DOWN, "trouble": "the cable"}, "the cable"),
    ("bumper", {"flags": Flags.BUMPER | Flags.LATCHED}, "bumper"),
    ("motor", {"flags": Flags.MOTOR_FAULT | Flags.LATCHED}, "motor"),
    ("latched", {"flags": Flags.LATCHED}, "latched"),
    ("bumper for one sample", {"earlier_flags": Flags.BUMPER}, "bumper"),
    ("reboot", {"rebooted": True}, "restarted"),
]


@pytest.mark.parametrize(("found", "reason"), [row[1:] for row in REASONS], ids=[row[0] for row in REASONS])
def test_halt_is_sent_exactly_on_entering_safe_stop(found: dict[str, object], reason: str) -> None:
    script = ScriptedRobot().driving()
    record = script.cycle(**found)  # type: ignore[arg-type]
    assert record.mode.mode is Mode.SAFE_STOP
    assert reason in str(record.mode.reason)
    assert record.command is Order.HALT
    for _ in range(50):
        after = script.cycle()
        assert (after.mode.mode, after.command) == (Mode.SAFE_STOP, None), "it sends nothing and does not move"


def test_deadman_after_its_grace() -> None:
    script = ScriptedRobot().driving()
    assert script.cycle(flags=Flags.DEADMAN).mode.mode is Mode.DRIVE
    for _ in range(12):
        script.cycle()
    record = script.cycle(flags=Flags.DEADMAN)
    assert (record.mode.mode, record.command) == (Mode.SAFE_STOP, Order.HALT)
    assert "deadman" in str(record.mode.reason)


def test_a_gap_longer_than_the_deadman_stops_the_drive() -> None:
    """As after SIGSTOP and SIGCONT: what waits in the buffer first is from before the base stopped by itself."""
    script = ScriptedRobot().driving()
    script.run_s += 0.3
    assert isinstance(script.cycle().command, Twist)
    script.run_s += 0.6
    record = script.cycle()
    assert (record.mode.mode, record.command) == (Mode.SAFE_STOP, Order.HALT)
    assert "held up for 0.6 s" in str(record.mode.reason) or "held up for 0.7 s" in str(record.mode.reason)


def test_re_arming_drives_on_and_a_halt_while_arming_latches_again() -> None:
    script = ScriptedRobot().driving()
    script.cycle(request=Request.HALT)
    assert script.cycle(request=Request.ARM).command is Order.RELEASE
    record = script.cycle(request=Request.HALT)
    assert (record.mode.mode, record.command) == (Mode.SAFE_STOP, Order.HALT), "the latch was open"
    for _ in range(30):
        assert script.cycle().command is None
    script.cycle(request=Request.ARM)
    while script.state.mode.mode is Mode.SAFE_STOP:
        record = script.cycle()
    assert isinstance(record.command, Twist)


def test_a_failed_re_arm_latches_again() -> None:
    """The ring is silent: the cycle that would have driven finds the next reason, with the latch open."""
    script = ScriptedRobot().driving()
    script.cycle(request=Request.HALT)
    for _ in range(round(TIMEOUT_S / PERIOD_S) + 2):
        script.cycle(firing=False)
    script.cycle(request=Request.ARM, firing=False)
    commands = [script.cycle(firing=False).command for _ in range(10)]
    assert commands.count(Order.HALT) == 1
    assert not any(isinstance(command, Twist) for command in commands)
    assert "ring has not reported" in str(script.state.mode.reason)


def test_no_odometry_is_a_reason_to_stop() -> None:
    script = ScriptedRobot()
    script.cycle(odometry=False, firing=False)
    script.cycle(odometry=False, firing=False, request=Request.ARM)
    commands: list[Command] = []
    while script.state.mode.mode is Mode.READY:
        commands.append(script.cycle(odometry=False, firing=False).command)
    assert script.state.mode.mode is Mode.SAFE_STOP
    assert "no odometry" in str(script.state.mode.reason)
    assert commands[-1] is Order.HALT
    assert set(commands[:-1]) <= {STANDSTILL}


def test_a_silent_ring_is_a_reason_to_stop() -> None:
    script = ScriptedRobot().driving()
    begin_s = script.robot_s
    speeds = []
    while script.state.mode.mode is Mode.DRIVE:
        record = script.cycle(firing=False)
        if isinstance(record.command, Twist):
            speeds.append(record.command.v)
            script.pose = replace(script.pose, x=script.pose.x + PERIOD_S * record.command.v)
    assert speeds[0] == pytest.approx(0.3)
    assert speeds[-1] < 0.05, "it has slowed down before"
    assert "ring has not reported" in str(record.mode.reason)
    assert record.command is Order.HALT
    assert TIMEOUT_S < script.robot_s - begin_s < TIMEOUT_S + 2 * PERIOD_S


def test_a_pose_that_is_not_finite_is_a_stop_and_no_exception() -> None:
    script = ScriptedRobot().driving()
    script.pose = Pose(float("nan"), 0.0, 0.0)
    record = script.cycle(firing=False)
    assert (record.mode.mode, record.command) == (Mode.SAFE_STOP, Order.HALT)
