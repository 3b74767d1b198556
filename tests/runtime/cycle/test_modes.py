"""Tests of the modes: every transition in a table, and what must hold after any sequence of inputs."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.driver import LineState
from drivers.messages import Flags
from runtime.cycle.inputs import GAP_MAX_S, Request
from runtime.cycle.modes import ARMING_MAX_S, ARMING_MIN_S, DEADMAN_GRACE_S, Mode, ModeState
from runtime.cycle.motion_monitor import Movement
from tests.runtime.cycle.mode_inputs import ModeInputs, advance_by

NOW = 100.0
QUIET = ModeInputs(NOW, LineState.READY, None, Flags.NONE, rebooted=False, request=None)
ARM, HALT = replace(QUIET, request=Request.ARM), replace(QUIET, request=Request.HALT)
DISARM = replace(QUIET, request=Request.DISARM)

CONNECTING, READY = ModeState(), ModeState(Mode.READY, 50.0)
DRIVE, STOPPED = ModeState(Mode.DRIVE, 50.0), ModeState(Mode.SAFE_STOP, 50.0, "a reason")
FAULT = ModeState(Mode.FAULT, 50.0, "a fault")


def arming(state: ModeState, for_s: float) -> ModeState:
    return replace(state, arming_run_s=NOW - for_s)


def line(state: LineState, trouble: str | None = None) -> ModeInputs:
    return replace(QUIET, line=state, trouble=trouble)


def flags(value: Flags) -> ModeInputs:
    return replace(QUIET, flags=value)


def moves(movement: Movement) -> ModeInputs:
    return replace(QUIET, movement=movement)


UNCOMMANDED, UNSTOPPED = moves(Movement.UNCOMMANDED), moves(Movement.UNSTOPPED)
WAITED, TOO_SOON, TOO_LONG = 1.01 * ARMING_MIN_S, 0.5 * ARMING_MIN_S, 1.01 * ARMING_MAX_S

TRANSITIONS = [
    # mode before, inputs, mode after, part of the reason after, whether it is being armed
    (CONNECTING, line(LineState.CLOSED), Mode.CONNECTING, None, False),
    (CONNECTING, line(LineState.HANDSHAKE), Mode.CONNECTING, None, False),
    (CONNECTING, line(LineState.DOWN, "no answer"), Mode.CONNECTING, "no answer", False),
    (CONNECTING, QUIET, Mode.READY, None, False),
    (CONNECTING, ARM, Mode.READY, None, True),
    (CONNECTING, replace(ARM, line=LineState.HANDSHAKE), Mode.CONNECTING, None, False),
    (CONNECTING, HALT, Mode.SAFE_STOP, "halted by the operator", False),
    (CONNECTING, flags(Flags.LATCHED), Mode.READY, None, False),
    (READY, QUIET, Mode.READY, None, False),
    (READY, flags(Flags.LATCHED | Flags.DEADMAN), Mode.READY, None, False),
    (READY, ARM, Mode.READY, None, True),
    (READY, HALT, Mode.SAFE_STOP, "halted by the operator", False),
    (READY, line(LineState.DOWN, "silence"), Mode.CONNECTING, "silence", False),
    (READY, line(LineState.CLOSED), Mode.CONNECTING, "the line to the robot is gone", False),
    (arming(READY, TOO_SOON), QUIET, Mode.READY, None, True),
    (arming(READY, WAITED), QUIET, Mode.DRIVE, None, False),
    (arming(READY, WAITED), ARM, Mode.DRIVE, None, False),
    (arming(READY, WAITED), flags(Flags.LATCHED), Mode.READY, None, True),
    (arming(READY, WAITED), flags(Flags.DEADMAN | Flags.BATTERY_LOW), Mode.DRIVE, None, False),
    (arming(READY, TOO_LONG), flags(Flags.LATCHED), Mode.SAFE_STOP, "latch does not clear", False),
    (arming(READY, WAITED), flags(Flags.BUMPER), Mode.READY, None, True),
    (arming(READY, TOO_LONG), flags(Flags.BUMPER), Mode.SAFE_STOP, "bumper contact: free", False),
    (arming(READY, TOO_LONG), flags(Flags.BUMPER | Flags.LATCHED), Mode.SAFE_STOP, "bumper contact: free", False),
    (arming(STOPPED, WAITED), flags(Flags.MOTOR_FAULT), Mode.SAFE_STOP, "a reason", True),
    (arming(STOPPED, TOO_LONG), flags(Flags.MOTOR_FAULT), Mode.SAFE_STOP, "reports a motor fault", False),
    (arming(READY, WAITED), replace(QUIET, rebooted=True), Mode.SAFE_STOP, "restarted", False),
    (READY, replace(QUIET, rebooted=True), Mode.READY, None, False),
    (arming(READY, WAITED), line(LineState.HANDSHAKE), Mode.CONNECTING, "as after a restart", False),
    (arming(READY, WAITED), HALT, Mode.SAFE_STOP, "halted by the operator", False),
    (DRIVE, QUIET, Mode.DRIVE, None, False),
    (DRIVE, ARM, Mode.DRIVE, None, False),
    (DRIVE, HALT, Mode.SAFE_STOP, "halted by the operator", False),
    (DRIVE, line(LineState.DOWN, "the cable is loose"), Mode.SAFE_STOP, "the cable is loose", False),
    (DRIVE, line(LineState.CLOSED), Mode.SAFE_STOP, "line to the robot is gone", False),
    (DRIVE, line(LineState.HANDSHAKE), Mode.SAFE_STOP, "odometry jumped", False),
    (DRIVE, line(LineState.DOWN), Mode.SAFE_STOP, "does not answer", False),
    (DRIVE, replace(QUIET, rebooted=True), Mode.SAFE_STOP, "restarted", False),
    (DRIVE, flags(Flags.BUMPER | Flags.LATCHED), Mode.SAFE_STOP, "bumper", False),
    (DRIVE, flags(Flags.MOTOR_FAULT | Flags.LATCHED), Mode.SAFE_STOP, "motor fault", False),
    (DRIVE, flags(Flags.LATCHED), Mode.SAFE_STOP, "latched", False),
    (DRIVE, flags(Flags.DEADMAN), Mode.SAFE_STOP, "deadman", False),
    (DRIVE, flags(Flags.BATTERY_LOW), Mode.DRIVE, None, False),
    (replace(DRIVE, entered_run_s=NOW - 0.5 * DEADMAN_GRACE_S), flags(Flags.DEADMAN), Mode.DRIVE, None, False),
    (DRIVE, replace(QUIET, gap_s=GAP_MAX_S), Mode.DRIVE, None, False),
    (DRIVE, replace(QUIET, gap_s=1.01 * GAP_MAX_S), Mode.SAFE_STOP, "held up for 0.5 s", False),
    (arming(READY, WAITED), replace(QUIET, gap_s=3.0), Mode.SAFE_STOP, "held up for 3.0 s", False),
    (arming(STOPPED, WAITED), replace(QUIET, gap_s=3.0), Mode.SAFE_STOP, "held up for 3.0 s", False),
    (READY, replace(QUIET, gap_s=3.0), Mode.READY, None, False),
    (STOPPED, QUIET, Mode.SAFE_STOP, "a reason", False),
    (STOPPED, flags(Flags.BUMPER), Mode.SAFE_STOP, "a reason", False),
    (STOPPED, line(LineState.CLOSED), Mode.SAFE_STOP, "waiting for the robot: the line to the robot is gone", False),
    (STOPPED, ARM, Mode.SAFE_STOP, "a reason", True),
    (STOPPED, replace(ARM, line=LineState.DOWN), Mode.SAFE_STOP, "waiting for the robot: ", False),
    (STOPPED, HALT, Mode.SAFE_STOP, "halted by the operator", False),
    (arming(STOPPED, TOO_SOON), QUIET, Mode.SAFE_STOP, "a reason", True),
    (arming(STOPPED, WAITED), QUIET, Mode.DRIVE, None, False),
    (arming(STOPPED, WAITED), flags(Flags.LATCHED), Mode.SAFE_STOP, "a reason", True),
    (arming(STOPPED, TOO_LONG), flags(Flags.LATCHED), Mode.SAFE_STOP, "latch does not clear", False),
    (
        arming(STOPPED, WAITED),
        line(LineState.DOWN, "silence"),
        Mode.SAFE_STOP,
        "waiting for the robot: silence",
        False,
    ),
    (arming(STOPPED, WAITED), HALT, Mode.SAFE_STOP, "halted by the operator", False),
    (CONNECTING, DISARM, Mode.READY, None, False),
    (READY, DISARM, Mode.READY, None, False),
    (arming(READY, WAITED), DISARM, Mode.READY, "disarmed by the operator", False),
    (DRIVE, DISARM, Mode.READY, "disarmed by the operator", False),
    (DRIVE, replace(DISARM, flags=Flags.BUMPER), Mode.SAFE_STOP, "bumper", False),
    (DRIVE, replace(DISARM, line=LineState.CLOSED), Mode.SAFE_STOP, "line to the robot is gone", False),
    (STOPPED, DISARM, Mode.SAFE_STOP, "a reason", False),
    (arming(STOPPED, WAITED), DISARM, Mode.SAFE_STOP, "disarmed by the operator", False),
    (DRIVE, moves(Movement.MISSING), Mode.SAFE_STOP, "does not move although", False),
    (DRIVE, UNCOMMANDED, Mode.SAFE_STOP, "faster or elsewhere than commanded", False),
    (DRIVE, UNSTOPPED, Mode.SAFE_STOP, "faster or elsewhere than commanded", False),
    (DRIVE, replace(UNSTOPPED, flags=Flags.BUMPER), Mode.SAFE_STOP, "bumper", False),
    (READY, UNCOMMANDED, Mode.SAFE_STOP, "moves without a command", False),
    (READY, UNSTOPPED, Mode.SAFE_STOP, "moves without a command", False),
    (arming(READY, WAITED), UNCOMMANDED, Mode.SAFE_STOP, "moves without a command", False),
    (STOPPED, UNCOMMANDED, Mode.SAFE_STOP, "moves without a command", False),
    (arming(STOPPED, WAITED), UNCOMMANDED, Mode.SAFE_STOP, "moves without a command", False),
    (STOPPED, UNSTOPPED, Mode.FAULT, "does not obey HALT", False),
    (STOPPED, replace(UNSTOPPED, request=Request.HALT), Mode.FAULT, "does not obey HALT", False),
    (STOPPED, replace(UNSTOPPED, line=LineState.DOWN), Mode.FAULT, "does not obey HALT", False),
    (STOPPED, moves(Movement.MISSING), Mode.SAFE_STOP, "a reason", False),
    (CONNECTING, replace(UNCOMMANDED, line=LineState.HANDSHAKE), Mode.CONNECTING, None, False),
    (FAULT, UNSTOPPED, Mode.FAULT, "a fault", False),
    (FAULT, DISARM, Mode.FAULT, "a fault", False),
    (FAULT, QUIET, Mode.FAULT, "a fault", False),
    (FAULT, ARM, Mode.FAULT, "a fault", False),
    (FAULT, HALT, Mode.FAULT, "a fault", False),
    (FAULT, line(LineState.CLOSED), Mode.FAULT, "a fault", False),
]


@pytest.mark.parametrize(("before", "seen", "mode", "reason", "is_arming"), TRANSITIONS)
def test_transition(before: ModeState, seen: ModeInputs, mode: Mode, reason: str | None, is_arming: bool) -> None:
    after = advance_by(before, seen)
    assert after.mode is mode
    assert (after.reason is None) if reason is None else (after.reason is not None and reason in after.reason)
    assert (after.arming_run_s is not None) == is_arming
    if mode is not before.mode and mode is not Mode.CONNECTING:
        assert after.entered_run_s == NOW


def test_a_failed_part_ends_every_mode_but_fault_and_arming_does_not_help() -> None:
    seen = replace(QUIET, fault="the part `link` has ended")
    for before in (CONNECTING, READY, DRIVE, STOPPED, arming(READY, WAITED), arming(STOPPED, WAITED)):
        after = advance_by(before, seen)
        assert (after.mode, after.reason, after.entered_run_s) == (Mode.SAFE_STOP, seen.fault, NOW)
        assert after.arming_run_s is None
        later = replace(seen, run_s=NOW + 0.05)
        assert advance_by(after, later) == after, "it is entered once"
        armed = advance_by(after, replace(later, request=Request.ARM))
        assert armed == ModeState(Mode.SAFE_STOP, NOW + 0.05, seen.fault), "and reported again on an ARM"
        lost = replace(later, line=LineState.CLOSED)
        assert advance_by(after, lost) == after
        assert "halted by the operator" in str(advance_by(after, replace(later, request=Request.HALT)).reason)
    assert advance_by(FAULT, seen) == FAULT
    assert advance_by(DRIVE, replace(seen, line=LineState.CLOSED)).reason == seen.fault, (
        "the cause, not the consequence"
    )


def test_the_table_covers_every_possible_transition() -> None:
    shown = {(before.mode, mode) for before, _, mode, _, _ in TRANSITIONS}
    everywhere = {
        Mode.CONNECTING: {Mode.CONNECTING, Mode.READY, Mode.SAFE_STOP},
        Mode.READY: {Mode.READY, Mode.CONNECTING, Mode.DRIVE, Mode.SAFE_STOP},
        Mode.DRIVE: {Mode.DRIVE, Mode.READY, Mode.SAFE_STOP},
        Mode.SAFE_STOP: {Mode.SAFE_STOP, Mode.DRIVE, Mode.FAULT},
        Mode.FAULT: {Mode.FAULT},
    }
    assert shown == {(a, b) for a, many in everywhere.items() for b in many}


inputs_of_a_cycle = st.builds(
    ModeInputs,
    run_s=st.sampled_from([0.02, 0.05, 0.3, 1.5]),  # how long after the one before
    line=st.sampled_from([LineState.READY] * 8 + list(LineState)),
    trouble=st.sampled_from([None, "some trouble"]),
    flags=st.sampled_from([Flags.NONE] * 6 + list(Flags)),
    rebooted=st.sampled_from([False] * 5 + [True]),
    request=st.sampled_from([None, None, Request.ARM, Request.ARM, Request.HALT, Request.DISARM]),
)


@pytest.mark.compiled
@given(
    st.lists(inputs_of_a_cycle, min_size=5, max_size=40), st.sampled_from([CONNECTING, READY, DRIVE, STOPPED, FAULT])
)
def test_motion_never_resumes_by_itself(steps: list[ModeInputs], begin: ModeState) -> None:
    state, run_s, armed = begin, NOW, False
    for step in steps:
        run_s += step.run_s
        seen = replace(step, run_s=run_s, gap_s=step.run_s)
        before, state = state, advance_by(state, seen)
        if begin.mode is Mode.FAULT:
            assert state == begin
        assert state.mode is not Mode.FAULT or begin.mode is Mode.FAULT
        if state.mode is Mode.SAFE_STOP:
            assert state.reason
        if state.mode is Mode.DRIVE:
            assert seen.request not in {Request.HALT, Request.DISARM}
            assert seen.line is LineState.READY
            assert not seen.flags & (Flags.LATCHED | Flags.BUMPER | Flags.MOTOR_FAULT)
            assert seen.gap_s <= GAP_MAX_S, "it drives on data from before the gap"
            assert before.mode is Mode.DRIVE or armed, "DRIVE was entered without an ARM after the last stop"
        if seen.request is Request.ARM:
            armed = True
        taken_back = seen.request in {Request.HALT, Request.DISARM}
        if state.mode is Mode.DRIVE or taken_back or seen.line is not LineState.READY:
            armed = False
        if before.arming_run_s is not None and state.mode is Mode.SAFE_STOP and state.entered_run_s == run_s:
            armed = False


def test_a_base_that_goes_on_being_pushed_is_reported_once() -> None:
    stopped = advance_by(STOPPED, UNCOMMANDED)
    later = replace(UNCOMMANDED, run_s=NOW + 1.0)
    assert advance_by(stopped, later) == stopped
    armed = advance_by(stopped, replace(ARM, run_s=NOW + 1.0))
    assert armed.arming_run_s == NOW + 1.0
    again = advance_by(armed, replace(UNCOMMANDED, run_s=NOW + 1.05))
    assert (again.arming_run_s, again.entered_run_s) == (None, NOW + 1.05), "the latch is set again"


def test_cycles_that_overrun_too_often_stop_a_drive_and_end_an_arming() -> None:
    reason = "10 cycles in a row left no time"
    seen = replace(QUIET, overrun=reason)
    stopped = advance_by(ModeState(Mode.DRIVE, NOW - 5.0), seen)
    assert (stopped.mode, stopped.reason) == (Mode.SAFE_STOP, reason)
    arming = advance_by(ModeState(Mode.READY, NOW - 5.0, arming_run_s=NOW - 0.2), seen)
    assert (arming.mode, arming.reason) == (Mode.SAFE_STOP, reason)
    assert advance_by(ModeState(Mode.READY, NOW - 5.0), seen).mode is Mode.READY
    assert advance_by(ModeState(Mode.DRIVE, NOW - 5.0), replace(seen, request=Request.HALT)).reason != reason


@pytest.mark.parametrize(
    ("before", "seen", "mode"),
    [
        (replace(READY, arming_run_s=0.0), replace(QUIET, run_s=ARMING_MIN_S), Mode.DRIVE),
        (replace(READY, arming_run_s=0.0), replace(flags(Flags.LATCHED), run_s=ARMING_MAX_S), Mode.READY),
        (replace(READY, arming_run_s=0.0), replace(QUIET, run_s=1.0, gap_s=GAP_MAX_S), Mode.DRIVE),
        (replace(DRIVE, entered_run_s=0.0), replace(flags(Flags.DEADMAN), run_s=DEADMAN_GRACE_S), Mode.DRIVE),
    ],
    ids=["waited just long enough", "the latch has its whole second", "a gap as long as may be", "grace to its end"],
)
def test_exactly_at_the_end_of_a_time_limit(before: ModeState, seen: ModeInputs, mode: Mode) -> None:
    assert advance_by(before, seen).mode is mode


def test_time_limits_in_seconds() -> None:
    """The protocol sends odometry every 20 ms and its deadman is half a second; an operator waits for one."""
    assert (ARMING_MIN_S, ARMING_MAX_S, DEADMAN_GRACE_S, GAP_MAX_S) == (0.1, 1.0, 0.5, 0.45)


def test_modes_and_requests_have_the_names_of_logs_and_summaries() -> None:
    assert [mode.value for mode in Mode] == ["CONNECTING", "READY", "DRIVE", "SAFE_STOP", "FAULT"]
    assert [request.value for request in Request] == ["arm", "halt", "disarm"]


def test_entering_the_same_mode_again_counts_as_entered() -> None:
    assert (CONNECTING.mode, CONNECTING.entered_run_s) == (Mode.CONNECTING, 0.0)
    assert not DRIVE.entered_since(DRIVE)
    assert not replace(DRIVE, arming_run_s=1.0, reason="another").entered_since(DRIVE)
    assert DRIVE.enter(Mode.DRIVE, NOW).entered_since(DRIVE)
    assert STOPPED.entered_since(DRIVE)


def test_the_reason_of_a_stop_follows_the_line_and_says_when_it_is_back() -> None:
    state = advance_by(DRIVE, line(LineState.DOWN, "silence"))
    said = [state.reason]
    for seen in (
        line(LineState.CLOSED, "unplugged"),
        line(LineState.HANDSHAKE),
        line(LineState.DOWN, "a p3at"),
        QUIET,
        QUIET,
    ):
        state = advance_by(state, seen)
        said.append(state.reason)
    assert said[:4] == [
        "silence",
        *[f"waiting for the robot: {text}" for text in ("unplugged", "unplugged", "a p3at")],
    ]
    assert said[4] is not None
    assert "is back" in said[4]
    assert said[5] == said[4]
    assert advance_by(state, ARM).arming_run_s is not None


def test_a_halt_that_a_silent_base_never_confirmed_says_so_until_it_is_confirmed() -> None:
    halted, silent = advance_by(DRIVE, HALT), line(LineState.DOWN, "no answer")
    unheard = advance_by(advance_by(halted, silent), silent)
    assert unheard.reason == "waiting for the robot: HALT not confirmed: use the robot's own stop; no answer"
    again = advance_by(unheard, replace(silent, line=LineState.HANDSHAKE, trouble=None))
    assert again.reason == unheard.reason
    assert advance_by(again, replace(silent, flags=Flags.LATCHED)).reason == "waiting for the robot: no answer"
    assert advance_by(halted, replace(silent, flags=Flags.LATCHED)).reason == "waiting for the robot: no answer"
