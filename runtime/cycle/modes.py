"""The modes of the main process, as a pure function of a cycle's inputs.

CONNECTING until the robot answers, READY until an operator arms it, DRIVE until anything is wrong, then SAFE_STOP
with a reason. Leaving SAFE_STOP takes an explicit re-arm: motion never resumes by itself. FAULT is the program's own
failure, or a base that does not obey HALT, and is never left.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType
from typing import Final

from config.bounded import Seconds
from drivers.driver import LineState
from drivers.messages import Flags
from runtime.cycle.clock_monitor import ClockState
from runtime.cycle.inputs import Inputs, Request
from runtime.cycle.motion_monitor import Movement

ARMING_MIN_S: Final = 0.1
"""Time from a RELEASE until the flags are believed: odometry sent after it must have had time to arrive, s."""

ARMING_MAX_S: Final = 1.0
"""Least time from a RELEASE until an arming is given up: a latch that is still set has another cause, s. A
robot whose file lets it answer later has that time."""

DEADMAN_GRACE_S: Final = 0.5
"""Time after DRIVE is entered in which the deadman's flag may still date from before the first DRIVE command, s."""

STOPPING: Final = Flags.BUMPER | Flags.MOTOR_FAULT
"""Flags that name why the base is latched, or should be."""

LINE_REASONS: Final = MappingProxyType(
    {
        LineState.CLOSED: "the line to the robot is gone: check cable and power, then re-arm",
        LineState.HANDSHAKE: "the robot's clock or odometry jumped, as after a restart: check the robot, then re-arm",
        LineState.DOWN: "the robot does not answer: check its power and cable, then re-arm",
    }
)

WAITING: Final = "waiting for the robot: "
"""Begins the reason of a SAFE_STOP while the line is not READY; what follows is the driver's, and changes with it."""
RESTORED: Final = "the line to the robot was lost and is back: check where the robot stands, then re-arm"
STARTING: Final = "it is being connected again"

HALTED: Final = "halted by the operator; re-arm to continue"
UNCONFIRMED: Final = f"{WAITING}HALT not confirmed: use the robot's own stop; "
"""Begins that reason where an operator halted a base that has not answered since."""
DISARMED: Final = "disarmed by the operator; re-arm to continue"
HELD_UP: Final = "the program was held up for {:.1f} s, so commands came too late: check the load, then re-arm"

RUNS_AWAY: Final = (
    "the base moves faster or elsewhere than commanded: unless it is being pushed, check its motors, its odometry "
    "and body.acceleration_max_m_s2, then re-arm"
)
MOVES: Final = (
    "the base moves without a command, and HALT is sent again: unless it is being pushed, stop it by its emergency "
    "switch and check its motors; then re-arm"
)
STANDS: Final = (
    "the base does not move although it is commanded to: it is held or blocked, its motors are off, or its odometry "
    "has failed: free it, check its motors, then re-arm"
)
NOT_HALTED: Final = (
    "the base does not obey HALT and drives on, or brakes far less than body.acceleration_max_m_s2: stop it by its "
    "emergency switch; HALT is sent again and again; repair the base, then restart the program"
)
CLOCK_REASONS: Final = MappingProxyType(
    {
        ClockState.RIGHT: None,
        ClockState.STANDS: (
            "the robot's clock stands still, so it is unknown how old its echoes are: check the source of its "
            "stamps, restart the robot, then re-arm"
        ),
        ClockState.SLOW: (
            "the robot's clock runs slowly, or its data come later and later, so its echoes are older than it says: "
            "check the load of robot and line, restart the robot, then re-arm"
        ),
        ClockState.FAST: (
            "the robot's clock leapt ahead or runs fast, so its speeds and the ages of its echoes are wrong: check "
            "the source of its stamps, restart the robot, then re-arm"
        ),
    }
)


class Mode(Enum):
    """What the main process is doing."""

    CONNECTING = "CONNECTING"
    READY = "READY"
    DRIVE = "DRIVE"
    SAFE_STOP = "SAFE_STOP"
    FAULT = "FAULT"


NEVER_ARMED: Final = frozenset({Mode.CONNECTING, Mode.READY})
"""Modes from which a run that is to arm the robot once does so, as soon as the line works."""


@dataclass(frozen=True, slots=True)
class ModeState:
    """A mode with its reason, and the progress of arming."""

    mode: Mode = Mode.CONNECTING
    entered_run_s: Seconds = 0.0
    """When the mode was entered, by the run's clock."""
    reason: str | None = None
    arming_run_s: Seconds | None = None
    """When the robot began to be armed, by the run's clock; None while it is not being armed."""

    def enter(self, mode: Mode, run_s: float, reason: str | None = None) -> ModeState:
        """Return the state of having just entered `mode`.

        It may be the present mode again. The reason is for the operator.
        """
        return ModeState(mode, run_s, reason)

    def entered_since(self, before: ModeState) -> bool:
        """Return whether a mode was entered since `before`, including the same one again."""
        return (self.mode, self.entered_run_s) != (before.mode, before.entered_run_s)


def advance(
    state: ModeState,
    inputs: Inputs,
    flags: Flags,
    gap_s: float,
    movement: Movement = Movement.AS_COMMANDED,
    clock: ClockState = ClockState.RIGHT,
    arming_max_s: float = ARMING_MAX_S,
) -> ModeState:
    """Return the mode in which a cycle decides.

    Parameters
    ----------
    state : ModeState
        The mode so far.
    inputs : Inputs
        The cycle's: line, requests, faults.
    flags : Flags
        The base's, of all odometry since the cycle before.
    gap_s : float
        Time since the cycle before.
    movement : Movement
        How the base moves by its odometry.
    clock : ClockState
        How the robot's clock runs.
    arming_max_s : float
        Time after which an arming is given up.
    """
    run_s, request, fault = inputs.run_s, inputs.request, inputs.fault
    if state.mode is Mode.FAULT:
        return state
    if state.mode is Mode.DRIVE:
        reason = why_stop(state, inputs, flags, gap_s) or CLOCK_REASONS[clock] or _why_moving(movement)
        return _advance_drive(state, inputs, reason)
    if state.mode is Mode.SAFE_STOP and movement is Movement.UNSTOPPED:
        return state.enter(Mode.FAULT, run_s, NOT_HALTED)
    if request is Request.HALT:
        return state.enter(Mode.SAFE_STOP, run_s, HALTED)
    if fault is not None:
        is_known = state.mode is Mode.SAFE_STOP and state.reason == fault and request is None
        return replace(state, arming_run_s=None) if is_known else state.enter(Mode.SAFE_STOP, run_s, fault)
    if inputs.line is not LineState.READY:
        return _wait_for_line(state, inputs, flags)
    if state.mode is Mode.SAFE_STOP and state.reason is not None and state.reason.startswith(WAITING):
        state = replace(state, reason=f"{RESTORED} (what was wrong: {state.reason.removeprefix(WAITING)})")
    if state.mode is Mode.CONNECTING:
        state = state.enter(Mode.READY, run_s)
    if movement in {Movement.UNCOMMANDED, Movement.UNSTOPPED}:
        return _stop_moving(state, run_s)
    reason = _why_interrupt(inputs, gap_s) or CLOCK_REASONS[clock]
    return _advance_arming(state, inputs, flags, reason, arming_max_s)


def _why_waiting(reason: str | None, inputs: Inputs, flags: Flags) -> str:
    """Return the reason of a SAFE_STOP on a line that is not READY: the newest that is known of it."""
    known = reason or ""
    is_unconfirmed = known.startswith((HALTED, UNCONFIRMED)) and not flags & Flags.LATCHED
    begin = UNCONFIRMED if is_unconfirmed else WAITING
    if inputs.line_problem is not None or inputs.line is not LineState.HANDSHAKE:
        return begin + (inputs.line_problem or LINE_REASONS[inputs.line])
    return known if known.startswith(begin) else begin + STARTING


def why_stop(state: ModeState, inputs: Inputs, flags: Flags, gap_s: float) -> str | None:
    """Return the reason why driving must end, None if it may continue.

    Arguments are as of `advance`.
    """
    if inputs.request is Request.HALT:
        return HALTED
    if inputs.fault is not None:
        return inputs.fault
    if inputs.line is not LineState.READY:
        return inputs.line_problem or LINE_REASONS[inputs.line]
    reason = _why_interrupt(inputs, gap_s) or _why_latched(flags)
    if reason is not None:
        return reason
    if flags and flags & Flags.DEADMAN and inputs.run_s - state.entered_run_s > DEADMAN_GRACE_S:
        return "the base's deadman tripped: commands came too late; check line and load, then re-arm"
    return None


def _why_interrupt(inputs: Inputs, gap_s: float) -> str | None:
    """Return why driving, or arming, must end because of the cycle's own lateness or a restart of the robot."""
    if gap_s > inputs.gap_max_s:
        # The received data may be from before the gap, and the base may have stopped by its deadman: the next
        # command would set it in motion again.
        return HELD_UP.format(gap_s)
    if inputs.overrun is not None:
        return inputs.overrun
    if inputs.received.rebooted:
        return "the robot restarted, so its odometry began again at zero: check why, then re-arm"
    return None


def _why_moving(movement: Movement) -> str | None:
    """Return why driving must end because of how the base moves."""
    match movement:
        case Movement.AS_COMMANDED:
            return None
        case Movement.MISSING:
            return STANDS
        case _:
            return RUNS_AWAY


def _why_latched(flags: Flags) -> str | None:
    """Return why the base, by its flags, must not be driven: it is latched, or what latches it is present."""
    if not flags:  # as in almost every cycle; each test of a flag costs Python several µs
        return None
    if flags & Flags.BUMPER:
        return "bumper contact: free the robot, then re-arm"
    if flags & Flags.MOTOR_FAULT:
        return "the base reports a motor fault: check its drives, then re-arm"
    if flags & Flags.LATCHED:
        return "the base latched without a HALT from here: check its emergency stop, then re-arm"
    return None


def _advance_drive(state: ModeState, inputs: Inputs, reason: str | None) -> ModeState:
    """Return the mode of a robot that drives, and that must stop for a reason other than None."""
    if reason is not None:
        return state.enter(Mode.SAFE_STOP, inputs.run_s, reason)
    return state.enter(Mode.READY, inputs.run_s, DISARMED) if inputs.request is Request.DISARM else state


def _stop_moving(state: ModeState, run_s: float) -> ModeState:
    """Return the mode of a robot that moves although it must not."""
    is_known = state.mode is Mode.SAFE_STOP and state.reason == MOVES and state.arming_run_s is None
    return state if is_known else state.enter(Mode.SAFE_STOP, run_s, MOVES)


def _wait_for_line(state: ModeState, inputs: Inputs, flags: Flags) -> ModeState:
    """Return the mode of a robot that does not drive and whose line does not work."""
    if state.mode is Mode.SAFE_STOP:
        return replace(state, arming_run_s=None, reason=_why_waiting(state.reason, inputs, flags))
    lost = LINE_REASONS[inputs.line] if state.mode is Mode.READY else None
    return replace(state, mode=Mode.CONNECTING, reason=inputs.line_problem or lost, arming_run_s=None)


def _advance_arming(
    state: ModeState, inputs: Inputs, flags: Flags, interrupt: str | None, arming_max_s: float
) -> ModeState:
    """Return the mode of a robot in READY or SAFE_STOP on a working line, by the progress of arming.

    RELEASE clears the latch and the flags of what caused it. What is still set afterwards is present, and the robot
    is not armed.
    """
    run_s = inputs.run_s
    if inputs.request is Request.ARM and state.arming_run_s is None:
        return replace(state, arming_run_s=run_s)
    if state.arming_run_s is None:
        return state
    if inputs.request is Request.DISARM:
        # Entering SAFE_STOP again sets the latch, which the arming has already cleared.
        return state.enter(state.mode, run_s, DISARMED)
    if interrupt is not None:
        return state.enter(Mode.SAFE_STOP, run_s, interrupt)
    waited_s, reason = run_s - state.arming_run_s, _why_latched(flags)
    if waited_s >= ARMING_MIN_S and reason is None:
        return state.enter(Mode.DRIVE, run_s)
    if waited_s > arming_max_s:
        latch = "the base's latch does not clear: look for bumper contact or a motor fault"
        return state.enter(Mode.SAFE_STOP, run_s, reason if flags & STOPPING else latch)
    return state
