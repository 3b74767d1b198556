"""The modes of the main process, as a pure function of what happened.

CONNECTING until the robot answers, READY until an operator arms it, DRIVE until anything is wrong, then SAFE_STOP
with a reason. Leaving SAFE_STOP takes an explicit re-arm: motion never resumes by itself. FAULT is the program's own
failure and is not left at all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType
from typing import Final

from drivers.driver import LineState
from drivers.messages import Flags

ARMING_MIN_S: Final = 0.1
"""After a RELEASE the flags are believed only once odometry sent after it can have arrived."""

ARMING_MAX_S: Final = 1.0
"""A latch that does not clear in this time has a cause that releasing does not remove."""

DEADMAN_GRACE_S: Final = 0.5
"""How long the deadman's flag may still tell of the time before the first DRIVE."""


LINE_REASONS: Final = MappingProxyType(
    {
        LineState.CLOSED: "the line to the robot is gone: check cable and power, then re-arm",
        LineState.HANDSHAKE: "the robot's clock or odometry jumped, as after a restart: check the robot, then re-arm",
        LineState.DOWN: "the robot does not answer: check its power and cable, then re-arm",
    }
)

GAP_SHARE: Final = 0.9
"""Commands farther apart than this share of the deadman find a base that it has stopped or is about to."""

GAP_MAX_S: Final = GAP_SHARE * 0.5
"""That gap for the protocol's usual deadman, used until the robot has said its own."""

HALTED: Final = "halted by the operator; re-arm to go on"
DISARMED: Final = "disarmed by the operator; re-arm to go on"
HELD_UP: Final = "the program was held up for {:.1f} s, so commands came too late: check the load, then re-arm"


class Mode(Enum):
    """What the main process is doing."""

    CONNECTING = "CONNECTING"
    READY = "READY"
    DRIVE = "DRIVE"
    SAFE_STOP = "SAFE_STOP"
    FAULT = "FAULT"


class Request(Enum):
    """What an operator asks for."""

    ARM = "arm"
    HALT = "halt"
    DISARM = "disarm"
    """Stand, and wait to be armed: from DRIVE back to READY, without the base's latch."""


@dataclass(frozen=True, slots=True)
class ModeState:
    """A mode, when it was entered by the run's clock, why, and since when it is being armed."""

    mode: Mode = Mode.CONNECTING
    entered_run_s: float = 0.0
    reason: str | None = None
    arming_run_s: float | None = None

    def enter(self, mode: Mode, run_s: float, reason: str | None = None) -> ModeState:
        """Return the state of having just entered `mode`."""
        return ModeState(mode, run_s, reason)

    def entered_since(self, before: ModeState) -> bool:
        """Say whether a mode was entered since `before`, be it the same one again."""
        return (self.mode, self.entered_run_s) != (before.mode, before.entered_run_s)


@dataclass(frozen=True, slots=True)
class Situation:
    """What the modes depend on, as one cycle finds it."""

    run_s: float
    line: LineState
    trouble: str | None
    flags: Flags
    rebooted: bool
    request: Request | None
    gap_s: float = 0.0
    """Time since the cycle before."""
    gap_max_s: float = GAP_MAX_S
    """Longest such time after which driving may go on."""
    overrun: str | None = None
    """Why the cycle cannot keep its time any more; None while it can."""
    fault: str | None = None
    """Which part of the program has failed; None while all work."""


def advance(state: ModeState, seen: Situation) -> ModeState:
    """Return the mode that follows from what a cycle finds before it decides anything.

    Parameters
    ----------
    state : ModeState
        The mode so far.
    seen : Situation
        Line, flags and the operator's request.
    """
    if state.mode is Mode.FAULT:
        return state
    if state.mode is Mode.DRIVE:
        reason = why_stop(state, seen)
        if reason is not None:
            return state.enter(Mode.SAFE_STOP, seen.run_s, reason)
        return state.enter(Mode.READY, seen.run_s, DISARMED) if seen.request is Request.DISARM else state
    if seen.request is Request.HALT:
        return state.enter(Mode.SAFE_STOP, seen.run_s, HALTED)
    if seen.fault is not None:
        known = state.mode is Mode.SAFE_STOP and state.reason == seen.fault and seen.request is None
        return replace(state, arming_run_s=None) if known else state.enter(Mode.SAFE_STOP, seen.run_s, seen.fault)
    if seen.line is not LineState.READY:
        if state.mode is Mode.SAFE_STOP:
            return replace(state, arming_run_s=None)
        return replace(state, mode=Mode.CONNECTING, reason=seen.trouble, arming_run_s=None)
    if state.mode is Mode.CONNECTING:
        state = state.enter(Mode.READY, seen.run_s)
    return _arm(state, seen)


def why_stop(state: ModeState, seen: Situation) -> str | None:
    """Return the reason why driving must end, None where there is none."""
    if seen.request is Request.HALT:
        return HALTED
    if seen.fault is not None:
        return seen.fault
    if seen.line is not LineState.READY:
        return seen.trouble or LINE_REASONS[seen.line]
    if seen.gap_s > seen.gap_max_s:
        # What has been heard may be from before: the next command would set a base in motion that stopped by itself.
        return HELD_UP.format(seen.gap_s)
    if seen.overrun is not None:
        return seen.overrun
    if seen.rebooted:
        return "the robot restarted, so its odometry began anew: check why, then re-arm"
    if seen.flags & Flags.BUMPER:
        return "bumper contact: free the robot, then re-arm"
    if seen.flags & Flags.MOTOR_FAULT:
        return "the base reports a motor fault: check its drives, then re-arm"
    if seen.flags & Flags.LATCHED:
        return "the base latched without being told to from here: check its emergency stop, then re-arm"
    if seen.flags & Flags.DEADMAN and seen.run_s - state.entered_run_s > DEADMAN_GRACE_S:
        return "the base's deadman tripped: commands came too late; check line and load, then re-arm"
    return None


def _arm(state: ModeState, seen: Situation) -> ModeState:
    """Go through the arming of a robot that stands in READY or SAFE_STOP on a line that works."""
    if seen.request is Request.ARM and state.arming_run_s is None:
        return replace(state, arming_run_s=seen.run_s)
    if state.arming_run_s is None:
        return state
    if seen.request is Request.DISARM:
        # From SAFE_STOP the latch is open already: it is set again.
        return state.enter(state.mode, seen.run_s, DISARMED)
    if seen.gap_s > seen.gap_max_s:
        return state.enter(Mode.SAFE_STOP, seen.run_s, HELD_UP.format(seen.gap_s))
    if seen.overrun is not None:
        return state.enter(Mode.SAFE_STOP, seen.run_s, seen.overrun)
    waited = seen.run_s - state.arming_run_s
    if waited >= ARMING_MIN_S and not seen.flags & Flags.LATCHED:
        return state.enter(Mode.DRIVE, seen.run_s)
    if waited > ARMING_MAX_S:
        return state.enter(
            Mode.SAFE_STOP, seen.run_s, "the base's latch does not clear: look for bumper contact or a motor fault"
        )
    return state
