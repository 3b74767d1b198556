"""One perception-action cycle as a pure function of its inputs.

`step` gets every input as an argument and has effects through three callables only: one carries out the command, one
returns whether refinement may continue, one is called at the end of each phase. The same inputs and the same results
of the callables give the same record, bit for bit; replay relies on that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Annotated, Literal, TypeAlias

from behaviors.arbiter import Drive, Stop, Unseen
from behaviors.move_ahead import Leg
from behaviors.move_to_goal import Goal
from behaviors.response import Response
from config.bounded import CONSISTENT, Count, Seconds
from config.places import PlacesConfig
from config.settings import Settings
from drivers.driver import LineState, RobotDriver
from drivers.messages import Flags, Odometry, Pose, Twist
from perception.edits import Edit
from perception.percept import Percept
from perception.pipeline import Perception
from perception.undo import Undo, edit_with_undo
from runtime.cycle.clock_monitor import ClockMonitor
from runtime.cycle.drive_requests import (
    NO_MAP,
    STANDSTILL,
    DriveInput,
    DriveRequest,
    Legs,
    after_reboot,
    after_stop,
    goal_place,
    is_same_drive,
    needs_map,
    needs_objects,
    needs_recognition,
    needs_space,
    refusal,
    requested,
)
from runtime.cycle.drive_state import DriveState, Moment
from runtime.cycle.driving import commit, drive
from runtime.cycle.echo_watch import EchoWatch
from runtime.cycle.goal_drive import can_look_ahead, look_ahead
from runtime.cycle.inputs import Inputs
from runtime.cycle.line_messages import blind_reason, unseen_reason
from runtime.cycle.modes import ARMING_MAX_S, Mode, ModeState, advance
from runtime.cycle.motion_monitor import MotionMonitor, Movement
from runtime.cycle.mounting_limit import limit_by_mounting
from runtime.cycle.stalled_drives import DriveMemory
from runtime.cycle.start_turn import StartTurn
from runtime.cycle.unheard_limit import limit_unheard, lost_ahead
from runtime.cycle.velocity_limits import ZoneLimits, wants_map, way_refused, zone_limits
from runtime.timing.phases import Phase, ignore_phase

__all__ = [
    "NO_MAP",
    "STANDSTILL",
    "Command",
    "CycleRecord",
    "DriveInput",
    "DriveRequest",
    "Edit",
    "Inputs",
    "Order",
    "Refused",
    "State",
    "StopCause",
    "apply_command",
    "apply_settings",
    "step",
]


class Order(Enum):
    """A command to the base other than a velocity."""

    HALT = "halt"
    RELEASE = "release"


Command: TypeAlias = Twist | Order | None
"""What a cycle sends to the base: a velocity, an order, or nothing."""

StopCause: TypeAlias = Literal["budget", "quota", "converged", "nothing"]
"""Why refinement ended: no time left, no quanta left for these firings, all improved, nothing there to improve."""


@dataclass(frozen=True, slots=True)
class Refused:
    """A request of the operator that the cycle could not fulfil, and why."""

    edit: Count | None
    """Index of the refused one among the cycle's edits; None for the drive request."""
    why: str


@dataclass(slots=True)
class State(DriveState):
    """The state that a cycle passes to the next one, that of its drive included."""

    perception: Perception
    mode: ModeState = field(default_factory=ModeState)
    odometry: Odometry | None = None
    last_firing_robot_s: Seconds = 0.0
    """When the ring last fired, by the robot's clock."""
    run_s: Seconds | None = None
    """When the last cycle began, by the run's clock."""
    cycle: Count = 0
    vectors: tuple[Response, ...] = ()
    """The schemas' responses in the last cycle, and their sum; empty if no schema was called."""
    hold_reason: str | None = None
    """Why the robot does not move although it may drive; None if it moves."""
    motion_monitor: Annotated[MotionMonitor, CONSISTENT] = field(default_factory=MotionMonitor)
    """Whether the base moves as commanded."""
    echo_watch: EchoWatch = field(default_factory=EchoWatch)
    start_turn: StartTurn = field(default_factory=StartTurn)
    clock_monitor: ClockMonitor = field(default_factory=ClockMonitor)
    """Whether the robot's clock keeps time."""
    ring_problem: str | None = None
    """Why the readings of the newest firings cannot be true; None if they can. Made anew each cycle, not recorded."""
    preparing: str | None = None
    """How far the preparation of recognition is; None once it has started. Of the inputs, and not recorded."""
    percept: Percept | None = None
    """What the last cycle decided on; None if it did not drive. It is made anew each cycle and not recorded."""
    undos: tuple[Undo, ...] = ()
    """What takes each of the last cycle's edits back. Made anew each cycle and not recorded."""
    zones: ZoneLimits | None = None
    """No-go zones and speed areas; None without any. They follow from the settings and are not recorded."""
    void_places: PlacesConfig | None = None
    """The places in odometry's frame that a restart of the odometry voided."""


@dataclass(frozen=True, slots=True)
class CycleRecord:
    """The inputs of a cycle, its decisions, and its counts."""

    cycle: Count
    inputs: Inputs
    mode: ModeState
    command: Command
    new_segments: Count
    segments: Count
    clusters: Count
    quanta: Count
    iterations: Count
    refinement: StopCause
    refused: tuple[Refused, ...] = ()
    """The operator's drive request and edits that could not be fulfilled."""


def step(
    state: State,
    inputs: Inputs,
    settings: Settings,
    carry_out: Callable[[Command], None],
    may_refine: Callable[[int], bool],
    mark: Callable[[Phase], None] = ignore_phase,
) -> CycleRecord:
    """Run one cycle and return its record: perceive, decide, send the command, edit the map, refine.

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
        Called with the number of quanta done before each further one; returns whether there may be one.
    mark : callable
        Called at the end of each phase; no decision depends on it.
    """
    state.preparing, recognises = inputs.preparing, inputs.preparing is None
    if state.perception.recognises is not recognises:
        state.perception.recognise(settings.models, settings.perception, on=recognises)
    leaves_canyons = settings.behaviors.leave_canyon.leave_canyon_gain > 0.0
    state.perception.canyon_map.is_wanted = leaves_canyons and needs_space(state.drive_request)
    new_segments = _perceive(state, inputs, settings)
    mark(Phase.PERCEIVE)
    state.zones = zone_limits(state.zones, state.void_places, state.perception, settings)
    problem = None if inputs.drive_request is None else _refusal(state, inputs.drive_request, settings)
    command = _decide(state, inputs, settings, accepts=problem is None)
    mark(Phase.DECIDE)
    carry_out(command)
    mark(Phase.COMMAND)
    refused = _edit(state, inputs, problem)
    quanta, iterations, refinement = _refine(state, settings, may_refine)
    mark(Phase.REFINE)
    state.cycle += 1
    counts = state.perception.counts
    return CycleRecord(
        state.cycle, inputs, state.mode, command, new_segments, counts.segments, counts.hypotheses,
        quanta, iterations, refinement, refused,
    )  # fmt: skip


def apply_command(driver: RobotDriver, command: Command) -> None:
    """Hand a cycle's command to the driver."""
    match command:
        case Twist():
            driver.drive(command)
        case Order.HALT:
            driver.halt()
        case Order.RELEASE:
            driver.release()


def apply_settings(state: State, settings: Settings) -> None:
    """Continue perception under other settings, which differ only where a running process can follow."""
    state.perception.apply_settings(settings.perception)
    state.perception.set_models(settings.models)
    state.perception.set_firing_pattern(settings.ring)


def _perceive(state: State, inputs: Inputs, settings: Settings) -> int:
    """Return how many segments the received firings gave: the part of perception that always runs."""
    if inputs.received.rebooted:
        state.perception.reset()
        state.odometry = state.leg = None
        state.motion_monitor, state.clock_monitor, state.echo_watch = MotionMonitor(), ClockMonitor(), EchoWatch()
        state.drive_request = after_reboot(state.drive_request)  # a goal is a place in the odometry before the reboot
        state.last_firing_robot_s = 0.0
        state.void_places = settings.places if settings.places_frame == "odom" else None
    if inputs.received.odometry is not None:
        state.odometry = inputs.received.odometry
    new_segments = sum(map(state.perception.observe, inputs.received.firings))
    for firing in inputs.received.firings[-1:]:
        state.last_firing_robot_s = firing.robot_s
    hears_new, received = not state.perception.unheard.hears_nothing_new, inputs.received
    state.echo_watch = state.echo_watch.observe(received.odometry, received.firings, hears_new=hears_new)
    state.ring_problem = state.perception.ring_monitor.take_problem()
    return new_segments


def _decide(state: State, inputs: Inputs, settings: Settings, *, accepts: bool) -> Command:
    """Return the command; any stop, also one from another mode, drops a goal and an operator's velocity."""
    before = state.mode
    state.vectors, state.hold_reason, state.percept = (), None, None
    if accepts:
        _accept_drive_request(state, inputs)
    state.motion_monitor = state.motion_monitor.observe(inputs.received.odometry, inputs.run_s, settings.body)
    if inputs.line is LineState.READY:
        state.clock_monitor = state.clock_monitor.observe(
            inputs.received.odometry, inputs.received.firings, inputs.run_s
        )
    else:  # what is on its way is unknown
        state.clock_monitor = ClockMonitor()
    command = _command(state, inputs, settings)
    if inputs.line is LineState.READY:  # no other command reaches the base
        twist = command if isinstance(command, Twist) else None
        state.motion_monitor = state.motion_monitor.command(twist, inputs.run_s)
    after = state.mode
    stopped = after.entered_since(before) and after.mode in {Mode.SAFE_STOP, Mode.FAULT}
    if stopped or (before.mode is Mode.DRIVE and after.mode is not Mode.DRIVE):
        bumper = bool((inputs.received.flags | state.odometry.flags) & Flags.BUMPER) if state.odometry else False
        state.drive_request = after_stop(state.drive_request, bumper=bumper)
        state.echo_watch = state.echo_watch.touched() if bumper else state.echo_watch
    if not needs_space(state.drive_request):
        state.goal_drive = None
    return command


def _accept_drive_request(state: State, inputs: Inputs) -> None:
    """Make the operator's drive request, which `_refusal` allows, the current one; legs that ended begin again."""
    if inputs.drive_request is None:
        return
    before = state.drive_request
    state.drive_request = requested(before, inputs.drive_request)
    state.requested_run_s, state.goal_place, state.trail = inputs.run_s, None, ()
    if not is_same_drive(before, state.drive_request):
        state.goal_drive = None
    if isinstance(inputs.drive_request, Legs) and state.leg is not None and state.leg.done:
        state.leg = None


def _refusal(state: State, asked: DriveInput, settings: Settings) -> str | None:
    """Return why a drive request cannot be carried out, None if it can."""
    no_map = NO_MAP if needs_map(asked) and settings.places_frame != "map" else None
    return no_map or refusal(state.drive_request, asked) or way_refused(asked, state.zones, state.odometry, settings)


def _command(state: State, inputs: Inputs, settings: Settings) -> Command:
    """Return the command that mode and schemas lead to."""
    flags = inputs.received.flags | (Flags(0) if state.odometry is None else state.odometry.flags)
    before = state.mode
    gap_s = 0.0 if state.run_s is None else max(0.0, inputs.run_s - state.run_s)
    state.run_s = inputs.run_s
    request = state.drive_request
    map_frame = state.perception.known_map_frame() if wants_map(request, settings) else None
    state.goal_place = goal_place(request, state.goal_place, map_frame, gap_s) if isinstance(request, Goal) else None
    movement = state.motion_monitor.movement
    arming_max_s = max(ARMING_MAX_S, settings.link.answer_max_s)
    state.mode = advance(before, inputs, flags, gap_s, movement, state.clock_monitor.clock, arming_max_s)
    if state.mode.mode is Mode.DRIVE:
        state.echo_watch = state.echo_watch.armed() if before.mode is not Mode.DRIVE else state.echo_watch
        decision = _drive(state, inputs, settings, map_frame, gap_s)
        if isinstance(decision, Drive):
            return decision.twist
        state.mode = state.mode.enter(Mode.SAFE_STOP, inputs.run_s, decision.reason)
    state.drive_memory = DriveMemory()
    must_stand = state.mode.mode in {Mode.SAFE_STOP, Mode.FAULT}
    if must_stand and (state.mode.entered_since(before) or movement is not Movement.AS_COMMANDED):
        return Order.HALT
    if state.mode.arming_run_s is not None and before.arming_run_s is None:
        return Order.RELEASE
    return STANDSTILL if state.mode.mode is Mode.READY else None


def _drive(state: State, inputs: Inputs, settings: Settings, map_frame: Pose | None, gap_s: float) -> Drive | Stop:
    """Return the arbiter's decision, or a stop where odometry or echoes are missing."""
    odometry, behaviors = state.odometry, settings.behaviors
    if odometry is None:
        return Stop("no odometry has arrived: check that the base reports it, then re-arm")
    state.echo_watch, problem = state.echo_watch.stopped(settings.ring.range_max_m, state.ring_problem)
    if problem is not None:
        return Stop(problem)
    age_max_s = behaviors.avoid_static_obstacle.echo_age_max_s
    now_s = state.clock_monitor.now_s(odometry.robot_s, inputs.run_s)
    view, obstacles = state.perception.surroundings(now_s, odometry.ring_yaw, odometry.pose, age_max_s)
    blind_s = min(*view.sensor_ages_s.tolist(), now_s)  # numpy's call would take longer
    if blind_s > age_max_s:
        return Stop(blind_reason(blind_s, inputs.line_problem, fires=now_s - state.last_firing_robot_s <= age_max_s))
    unheard = state.perception.unheard
    lost = lost_ahead(unheard, odometry.pose, len(view.unknown_rad) > 0, state.drive_request, settings)
    if lost is not None:
        return Stop(lost)
    if inputs.preparing is not None and needs_recognition(state.drive_request):
        state.hold_reason, state.drive_memory = inputs.preparing, DriveMemory()
        return Drive(STANDSTILL)
    if state.leg is None:
        state.leg = Leg.starting_at(odometry.pose)
    objects = state.perception.labelled_objects() if needs_objects(state.drive_request) else ()
    percept = Percept(odometry.pose, obstacles, view, objects)
    if needs_space(state.drive_request):
        percept = replace(
            percept,
            occupancy=state.perception.occupancy(),
            canyons=state.perception.canyons(),
            steady=state.perception.steady_obstacles(now_s, age_max_s, odometry.pose),
        )
    if (zones := state.zones) is not None:
        percept, state.hold_reason = zones.seen(percept, state.drive_request, settings.body.radius_m)
        if state.hold_reason is not None:
            state.goal_drive, state.drive_memory = None, DriveMemory()  # standing here is no lack of progress
            return Drive(STANDSTILL)
    result = drive(state, percept, settings, Moment(inputs.run_s, gap_s, map_frame, zones))
    state.percept, decision, reason = percept, result.decision, result.hold_reason
    if isinstance(decision, Unseen):
        driven_s = inputs.run_s - state.mode.entered_run_s
        if min(decision.age_s - age_max_s, driven_s) <= age_max_s:
            # It stands until the ring looks there: echoes were lost, or not every sensor has fired since the start.
            fired_s = state.clock_monitor.fired_s(inputs.run_s)
            reason, decision = unseen_reason(decision, fired_s, settings.ring), Drive(STANDSTILL)
    if isinstance(decision, Drive):
        twist, slowed = limit_unheard(decision.twist, percept, unheard, settings, state.echo_watch.slow_reason)
        twist, slowed = limit_by_mounting(twist, slowed, odometry.pose, state.perception.ring_monitor, settings)
        if zones is not None:
            commands, age_s = state.motion_monitor.commands, max(0.0, now_s - odometry.robot_s)
            last = commands[-1].twist if commands else STANDSTILL
            twist, by_zone = zones.applied(twist, last, result.state.drive_request, odometry, age_s, settings)
            slowed = slowed or by_zone
        state.start_turn, twist, slowed = state.start_turn.apply(
            twist, slowed, odometry.pose, state.drive_request, settings, state.perception.ring_monitor.judge_turn
        )
        twist, waits = commit(result.state, twist, state.requested_run_s, inputs.run_s)
        decision, reason = Drive(twist), reason or slowed or waits
    state.vectors, state.hold_reason = result.vectors, reason
    state.take_over(result.state)
    return decision


def _edit(state: State, inputs: Inputs, problem: str | None) -> tuple[Refused, ...]:
    """Apply the operator's edits of the map; return what was refused, the drive request included."""
    outcomes = [edit_with_undo(edit, state.perception) for edit in inputs.edits]
    state.undos = tuple(undo for _, undo in outcomes)
    refused = (Refused(i, why) for i, (why, _) in enumerate(outcomes) if why is not None)
    return (*(() if problem is None else (Refused(None, problem),)), *refused)


def _refine(state: State, settings: Settings, may_refine: Callable[[int], bool]) -> tuple[int, int, StopCause]:
    """Refine the look-ahead to a goal and perception in turns; return quanta, iterations, and why it ended."""
    perception, quanta, iterations = state.perception, 0, 0
    while (is_looking := can_look_ahead(state.goal_drive, state.percept)) or perception.can_refine:
        if not may_refine(quanta):
            return quanta, iterations, "budget"
        if is_looking and (quanta % 2 == 0 or not perception.can_refine):
            state.goal_drive = look_ahead(state.goal_drive, state.percept, settings)
        else:
            iterations += perception.refine()
        quanta += 1
    return quanta, iterations, "nothing" if quanta == 0 else "converged" if perception.converged else "quota"
