"""Tests of the modes as a state machine: any actions of robot and operator in any order."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from drivers.driver import LineState
from drivers.messages import Flags
from runtime.cycle.inputs import GAP_MAX_S, Request
from runtime.cycle.modes import ARMING_MAX_S, ARMING_MIN_S, Mode, ModeState
from tests.runtime.cycle.mode_inputs import ModeInputs, advance_by

CYCLE_S = 0.05


class ModesMachine(RuleBasedStateMachine):
    """A robot with a line, flags and an operator; the model keeps only whether motion was allowed, and by what.

    Attributes
    ----------
    armed_s
        When the operator last armed, with nothing since that takes it back.
    """

    def __init__(self) -> None:
        super().__init__()
        self.state = ModeState()
        self.seen = ModeInputs(0.0, LineState.CLOSED, None, Flags.NONE, rebooted=False, request=None)
        self.armed_s: float | None = None
        self.entries: list[Mode] = [Mode.CONNECTING]

    def cycle(self, request: Request | None = None, *, gap_s: float = CYCLE_S, rebooted: bool = False) -> None:
        run_s = self.seen.run_s + gap_s
        self.seen = replace(self.seen, run_s=run_s, request=request, gap_s=gap_s, rebooted=rebooted)
        before, self.state = self.state, advance_by(self.state, self.seen)
        after = self.state
        if after.mode is not before.mode:
            self.entries.append(after.mode)
        if request is Request.ARM and self.seen.line is LineState.READY and self.armed_s is None:
            self.armed_s = run_s
        if after.mode is Mode.DRIVE and before.mode is not Mode.DRIVE:
            assert self.armed_s is not None, "motion resumed by itself"
            assert ARMING_MIN_S <= run_s - self.armed_s <= ARMING_MAX_S + gap_s
            assert before.mode in {Mode.READY, Mode.SAFE_STOP}
        if request is Request.HALT:
            assert after.mode is not Mode.DRIVE, "a HALT is never overruled"
        if before.mode is Mode.DRIVE and after.mode is not Mode.DRIVE:
            assert after.mode is Mode.SAFE_STOP or (after.mode is Mode.READY and request is Request.DISARM)
            assert after.entered_run_s == run_s
        given_up = before.arming_run_s is not None and after.arming_run_s is None
        taken_back = request in {Request.HALT, Request.DISARM}
        if after.mode is Mode.DRIVE or taken_back or self.seen.line is not LineState.READY or given_up:
            self.armed_s = None

    @rule(line=st.sampled_from(LineState), trouble=st.sampled_from([None, "a cable is loose"]))
    def line_becomes(self, line: LineState, trouble: str | None) -> None:
        self.seen = replace(self.seen, line=line, trouble=trouble)
        self.cycle()

    @rule()
    def line_is_ready(self) -> None:
        self.seen = replace(self.seen, line=LineState.READY, trouble=None)
        self.cycle()

    @rule(flag=st.sampled_from(Flags))
    def a_flag_is_set(self, flag: Flags) -> None:
        self.seen = replace(self.seen, flags=self.seen.flags | flag)
        self.cycle()

    @rule()
    def flags_clear(self) -> None:
        self.seen = replace(self.seen, flags=Flags.NONE)
        self.cycle()

    @rule()
    def arm(self) -> None:
        self.cycle(Request.ARM)

    @rule()
    def halt(self) -> None:
        self.cycle(Request.HALT)
        assert self.state.mode is Mode.SAFE_STOP
        assert "halted by the operator" in (self.state.reason or "")

    @rule()
    def disarm(self) -> None:
        self.cycle(Request.DISARM)
        assert self.state.mode is not Mode.DRIVE
        assert self.state.arming_run_s is None

    @rule()
    def reboot(self) -> None:
        was_driving = self.state.mode is Mode.DRIVE
        self.cycle(rebooted=True)
        assert not (was_driving and self.state.mode is Mode.DRIVE), "a reboot stops"

    @rule(gap_s=st.floats(GAP_MAX_S + 1e-6, 100.0))
    def held_up(self, gap_s: float) -> None:
        self.cycle(gap_s=gap_s)
        assert self.state.mode is not Mode.DRIVE, "it drives on data from before the gap"

    @rule(cycles=st.integers(1, 40))
    def time_passes(self, cycles: int) -> None:
        for _ in range(cycles):
            self.cycle()

    @rule()
    def all_is_well_and_it_is_armed(self) -> None:
        """From anywhere: an explicit re-arm on a robot without trouble leads to DRIVE within the arming time."""
        self.seen = replace(self.seen, line=LineState.READY, trouble=None, flags=Flags.NONE)
        self.cycle()
        self.cycle(Request.ARM)
        for _ in range(round(ARMING_MAX_S / CYCLE_S)):
            self.cycle()
        assert self.state.mode is Mode.DRIVE

    @invariant()
    def driving_has_every_reason_and_standing_has_one(self) -> None:
        state, seen = self.state, self.seen
        if state.mode is Mode.DRIVE:
            assert seen.line is LineState.READY
            assert state.reason is None
            assert not seen.flags & (Flags.LATCHED | Flags.BUMPER | Flags.MOTOR_FAULT)
            assert state.arming_run_s is None
        if state.mode is Mode.SAFE_STOP:
            assert state.reason
            assert "\n" not in state.reason
        assert state.mode is not Mode.FAULT
        assert state.entered_run_s <= seen.run_s


ModesMachine.TestCase.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
TestModes = ModesMachine.TestCase
