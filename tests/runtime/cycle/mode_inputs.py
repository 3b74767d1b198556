"""The part of a cycle's inputs on which the modes depend, as one value that the tests of the modes can vary."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.driver import LineState, Received
from drivers.messages import Flags
from runtime.cycle.inputs import Inputs, Request
from runtime.cycle.modes import ModeState, advance
from runtime.cycle.motion_monitor import Movement


@dataclass(frozen=True)
class ModeInputs:
    """Everything that `advance` looks at in one cycle besides the mode so far."""

    run_s: float
    line: LineState
    trouble: str | None
    flags: Flags
    rebooted: bool
    request: Request | None
    gap_s: float = 0.0
    overrun: str | None = None
    fault: str | None = None
    movement: Movement = Movement.AS_COMMANDED


def advance_by(state: ModeState, seen: ModeInputs) -> ModeState:
    """Return what `advance` returns for these inputs."""
    inputs = Inputs(
        seen.run_s, seen.line, seen.trouble, Received((), None, rebooted=seen.rebooted), seen.request,
        overrun=seen.overrun, fault=seen.fault,
    )  # fmt: skip
    return advance(state, inputs, seen.flags, seen.gap_s, seen.movement)
