"""One perception-action cycle: the pure heart of the program.

`step` gets every input as an argument and reaches the world through three callables only: one that carries out the
command, one that says whether refinement may go on, one that is told which phase has ended. Handing it the same
inputs and the same answers gives the same record again, to the bit; that is what a replay is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Literal, TypeAlias

from behaviors.arbiter import Drive, Stop
from behaviors.move_ahead import Leg
from behaviors.response import Response
from config.settings import Settings
from drivers.driver import LineState, Received
from drivers.messages import Flags, Odometry, Twist
from perception.edits import Edit
from perception.percept import Percept
from perception.pipeline import Perception
from runtime.cycle.drive_requests import STANDSTILL, DriveRequest, Legs, after_a_stop, drive, validate
from runtime.cycle.modes import GAP_MAX_S, Mode, ModeState, Request, Situation, advance
from runtime.timing.phases import Phase, unmarked

__all__ = [
    "STANDSTILL",
    "Command",
    "CycleRecord",
    "DriveRequest",
    "Edit",
    "Inputs",
    "Order",
    "Refused",
    "State",
    "StopCause",
    "step",
    "take_over",
]


class Order(Enum):
    """What a base can be told besides a velocity."""

    HALT = "halt"
    RELEASE = "release"


Command: TypeAlias = Twist | Order | None
StopCause: TypeAlias = Literal["budget", "quota", "converged", "nothing"]
"""Why refinement ended: no time left, no quanta left for these firings, all improved, nothing there to improve."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """Everything a cycle takes in, at `run_s` of the run's clock."""

    run_s: float
    line: LineState
    trouble: str | None
    heard: Received
    request: Request | None = None
    gap_max_s: float = GAP_MAX_S
    """Cycles farther apart than this come too late for the base's deadman."""
    echo_age_s: float | None = None
    """How long the oldest of these firings has waited for this cycle; None where none came or nobody asks."""
    overrun: str | None = None
    """Why the cycle cannot keep its time any more; None while it can."""
    fault: str | None = None
    """Which part of the program has failed; None while all work."""
    drive_request: DriveRequest | None = None
    """What the operator wants driven from now on; None where that is as before."""
    edits: tuple[Edit, ...] = ()
    """What the operator does to what was perceived, in this order."""
    host_s: float | None = None
    """The same moment by the host's clock; None in virtual time. For the record only: no decision depends on it."""


@dataclass(frozen=True, slots=True)
class Refused:
    """What an operator asked for in vain, and why."""

    edit: int | None
    """Which of the cycle's edits; None: the drive_request."""
    why: str


@dataclass(slots=True)
class State:
    """Everything a cycle leaves to the next one."""

    perception: Perception
    mode: ModeState = field(default_factory=ModeState)
    leg: Leg | None = None
    odometry: Odometry | None = None
    last_firing_robot_s: float = 0.0
    run_s: float | None = None
    cycle: int = 0
    drive_request: DriveRequest = field(default_factory=Legs)
    """What is driven in DRIVE."""
    requested_run_s: float = 0.0
    """When the operator said so, by the run's clock."""
    vectors: tuple[Response, ...] = ()
    """What the schemas answered in the last cycle, and their sum; nothing where none was asked."""
    standing: str | None = None
    """Why the robot stands though it may drive; None where it does not."""


@dataclass(frozen=True, slots=True)
class CycleRecord:
    """What went into a cycle, what it decided, and what it counted."""

    cycle: int
    inputs: Inputs
    mode: ModeState
    command: Command
    new_segments: int
    segments: int
    clusters: int
    quanta: int
    iterations: int
    refinement: StopCause
    refused: tuple[Refused, ...] = ()
    """What of the operator's drive_request and edits came to nothing."""


def step(
    state: State,
    inputs: Inputs,
    settings: Settings,
    carry_out: Callable[[Command], None],
    may_refine: Callable[[int], bool],
    mark: Callable[[Phase], None] = unmarked,
) -> CycleRecord:
    """Run one cycle: perceive, decide, command, do what a person says, and refine for as long as it may.

    Parameters
    ----------
    state : State
        Left by the cycle before. Updated.
    inputs : Inputs
        What arrived since.
    settings : Settings
        The run's settings.
    carry_out : callable
        Gets the command before anything is edited or refined, so that neither ever delays a stop.
    may_refine : callable
        Asked with the number of quanta done before each further one.
    mark : callable
        Told of each phase that has ended; nothing in here depends on what it does.

    Returns
    -------
    CycleRecord
        The whole cycle.
    """
    new_segments = _perceive(state, inputs)
    mark(Phase.PERCEIVE)
    command = _decide(state, inputs, settings)
    mark(Phase.DECIDE)
    carry_out(command)
    mark(Phase.COMMAND)
    refused = _edit(state, inputs)
    quanta, iterations, refinement = _refine(state.perception, may_refine)
    mark(Phase.REFINE)
    state.cycle += 1
    counts = state.perception.counts
    return CycleRecord(
        state.cycle, inputs, state.mode, command, new_segments, counts.segments, counts.hypotheses, quanta, iterations,
        refinement, refused,
    )  # fmt: skip


def take_over(state: State, settings: Settings) -> None:
    """Let perception go on with other settings, of those that a running process follows (`config.reload`)."""
    state.perception.apply_settings(settings.perception)
    state.perception.set_models(settings.models)
    state.perception.set_firing_pattern(settings.ring)


def _edit(state: State, inputs: Inputs) -> tuple[Refused, ...]:
    """Do what the operator says to what was perceived; return what could not be done."""
    drive_request = None if inputs.drive_request is None else validate(inputs.drive_request)
    refused = [] if drive_request is None else [Refused(None, drive_request)]
    for i, edit in enumerate(inputs.edits):
        why = state.perception.edit(edit)
        if why is not None:
            refused.append(Refused(i, why))
    return tuple(refused)


def _perceive(state: State, inputs: Inputs) -> int:
    """Take in what arrived: the part of perception that always runs."""
    if inputs.heard.rebooted:
        state.perception.reset()
        state.odometry = None
        state.leg = None
        state.drive_request = after_a_stop(state.drive_request)  # a goal is a place in the odometry that was
        state.last_firing_robot_s = 0.0
    if inputs.heard.odometry is not None:
        state.odometry = inputs.heard.odometry
    new_segments = 0
    for firing in inputs.heard.firings:
        new_segments += state.perception.observe(firing)
        state.last_firing_robot_s = firing.robot_s
    return new_segments


def _take_wish(state: State, inputs: Inputs) -> None:
    """Take over what the operator wants driven; the legs begin anew where they were done."""
    if inputs.drive_request is None or validate(inputs.drive_request) is not None:
        return
    state.drive_request, state.requested_run_s = inputs.drive_request, inputs.run_s
    if isinstance(inputs.drive_request, Legs) and state.leg is not None and state.leg.done:
        state.leg = None


def _decide(state: State, inputs: Inputs, settings: Settings) -> Command:
    """Return what the base is told; whatever ends a drive, or refuses one, takes goal and hand away."""
    before = state.mode
    state.vectors, state.standing = (), None
    _take_wish(state, inputs)
    command = _command(state, inputs, settings)
    after = state.mode
    stopped = after.mode in {Mode.SAFE_STOP, Mode.FAULT} and after.entered_since(before)
    if stopped or (before.mode is Mode.DRIVE and after.mode is not Mode.DRIVE):
        state.drive_request = after_a_stop(state.drive_request)
    return command


def _command(state: State, inputs: Inputs, settings: Settings) -> Command:
    """Go through modes and schemas and return what the base is told."""
    flags = Flags.NONE if state.odometry is None else state.odometry.flags
    before = state.mode
    gap_s = 0.0 if state.run_s is None else inputs.run_s - state.run_s
    state.run_s = inputs.run_s
    situation = Situation(
        inputs.run_s, inputs.line, inputs.trouble, flags, inputs.heard.rebooted, inputs.request,
        gap_s, inputs.gap_max_s, inputs.overrun, inputs.fault,
    )  # fmt: skip
    state.mode = advance(before, situation)
    if state.mode.mode is Mode.DRIVE:
        decision = _drive(state, inputs, settings)
        if isinstance(decision, Drive):
            return decision.twist
        state.mode = state.mode.enter(Mode.SAFE_STOP, inputs.run_s, decision.reason)
    if state.mode.mode in {Mode.SAFE_STOP, Mode.FAULT} and state.mode.entered_since(before):
        return Order.HALT
    if state.mode.arming_run_s is not None and before.arming_run_s is None:
        return Order.RELEASE
    return STANDSTILL if state.mode.mode is Mode.READY else None


def _drive(state: State, inputs: Inputs, settings: Settings) -> Drive | Stop:
    """Ask the schemas and the arbiter; the driver may know why a ring is not heard."""
    odometry, behaviors = state.odometry, settings.behaviors
    if odometry is None:
        return Stop("no odometry has arrived: check that the base reports it, then re-arm")
    silence = odometry.robot_s - state.last_firing_robot_s
    patience = behaviors.avoid_static_obstacle.echo_age_max_s
    if silence > patience:
        likely = inputs.trouble or "check the ring's power and cable"
        return Stop(f"the ring has not reported for {silence:.1f} s: {likely}, then re-arm")
    if state.leg is None:
        state.leg = Leg.starting_at(odometry.pose)
    percept = Percept(odometry.pose, state.perception.obstacles(odometry.robot_s, patience))
    driven = drive(state.drive_request, state.requested_run_s, inputs.run_s, state.leg, percept, settings)
    state.drive_request, state.leg = driven.drive_request, driven.leg
    state.vectors, state.standing = driven.vectors, driven.standing
    return driven.decision


def _refine(perception: Perception, may_refine: Callable[[int], bool]) -> tuple[int, int, StopCause]:
    """Refine quantum by quantum; return quanta, iterations, and why it ended."""
    quanta = iterations = 0
    while perception.can_refine:
        if not may_refine(quanta):
            return quanta, iterations, "budget"
        iterations += perception.refine()
        quanta += 1
    if quanta == 0:
        return quanta, iterations, "nothing"
    return quanta, iterations, "converged" if perception.converged else "quota"
