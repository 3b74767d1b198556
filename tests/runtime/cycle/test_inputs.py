"""Tests of the inputs of a cycle: everything that arrived is taken once, and the deadman limits the gap."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

from drivers.driver import LineState, Received
from drivers.messages import Identity
from runtime.cycle.drive_requests import Legs
from runtime.cycle.inputs import (
    GAP_LIMIT_S,
    GAP_MAX_S,
    GAP_SHARE,
    Inputs,
    OperatorInput,
    Request,
    command_gap_max_s,
    gather_inputs,
)

RECEIVED = Received((), None, rebooted=True)


@dataclass
class StubDriver:
    """A driver whose `tick` finds that the line is down."""

    identity: Identity | None = None
    state: LineState = LineState.READY
    problem: str | None = None
    calls: list[object] = field(default_factory=list)

    def tick(self, run_s: float) -> None:
        self.calls.append(run_s)
        self.state, self.problem = LineState.DOWN, "silence"

    def take_received(self) -> Received:
        self.calls.append("taken")
        return RECEIVED


def test_the_driver_is_asked_at_the_time_of_the_cycle_and_what_it_received_is_taken_once() -> None:
    driver: Any = StubDriver()
    drive_request = Legs()
    inputs = gather_inputs(
        driver, 7.5, OperatorInput(Request.ARM, drive_request), echo_age_s=0.01, overrun="o", fault="f", host_s=9.0
    )
    assert driver.calls == [7.5, "taken"]
    assert inputs == Inputs(
        7.5, LineState.DOWN, "silence", RECEIVED, Request.ARM, GAP_MAX_S, 0.01, "o", "f", drive_request, (), 9.0
    )


def test_commands_may_be_nine_tenths_of_the_deadman_apart() -> None:
    driver: Any = StubDriver()
    assert command_gap_max_s(driver) == GAP_MAX_S == pytest.approx(0.45), "until the robot reports its own"
    driver.identity = Identity("denning", 24, 0.381, 0.4, 0.02, 7)
    assert command_gap_max_s(driver) == GAP_SHARE * 0.4
    assert gather_inputs(driver, 0.0, OperatorInput()).gap_max_s == GAP_SHARE * 0.4


@pytest.mark.promise("P25")
@pytest.mark.parametrize("deadman_s", [0.6, 1.0, 65.535])
def test_an_own_limit_holds_whatever_deadman_the_base_reports(deadman_s: float) -> None:
    driver: Any = StubDriver(Identity("denning", 24, 0.381, deadman_s, 0.02, 7))
    assert command_gap_max_s(driver) == GAP_LIMIT_S == 0.5
