"""Handlers of the commands that are carried out at once or by the next cycle.

A command that moves the robot or changes its map becomes an input of the next cycle. Only HALT is sent at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import orjson

from behaviors.missions.mission import Mission, MissionEdit, route
from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from config.load import ConfigError, list_shipped, load_mission, parse_text, with_mission
from config.mission import MissionConfig
from config.reload import Difference
from config.route import mission_text, route_config, waypoints_of
from perception.edits import Arc, Edit
from runtime.console.commands.command import ANSWERED_LATER, AnsweredLater, Call, CommandContext, PendingEdit
from runtime.console.commands.command_error import CommandError
from runtime.console.commands.messages import (
    GetEvidence,
    GrantControl,
    NoArguments,
    ReadMission,
    RunMission,
    SaveRoute,
    SetGoal,
    SetParameter,
    SetRoute,
    StartMission,
)
from runtime.console.frames.grid_message import grid_message
from runtime.console.sent_messages import ChangedValue, CrossReadingRow, EvidenceAnswer, MissionAnswer, ReadingRow
from runtime.cycle.drive_requests import NO_MAP, DriveInput, Legs, needs_map, refusal
from runtime.cycle.inputs import Request
from runtime.cycle.velocity_limits import way_refused

MISSION_EDITS: Final[Mapping[str, MissionEdit]] = MappingProxyType(
    {
        "hold_mission": MissionEdit("hold"),
        "resume_mission": MissionEdit("resume"),
        "skip_step": MissionEdit("skip"),
    }
)
"""What each command does to the mission under way."""
GRID_PERIOD_S: Final = 0.5
"""Least time between two messages of the evidence grid that are made."""


def request_mode(call: Call, _: NoArguments) -> None:
    """Request HALT, ARM or DISARM, whichever the command is called."""
    request = Request(call.name)
    if request is Request.ARM:
        call.context.armed_by = call.client
        call.context.robot.request(request, call.remains_valid())
        return
    if request is Request.HALT:
        call.context.hub.void_challenges()
    call.context.robot.request(request)


def follow_legs(call: Call, legs: Legs) -> None:
    """Replace the drive request by the configured legs."""
    _request_drive(call, legs)


def set_goal(call: Call, asked: SetGoal) -> None:
    """Replace the drive request by a goal.

    Raises
    ------
    CommandError
        The robot does not know a map, and the goal is a place there; or it must not or cannot drive there.
    """
    _request_drive(call, Goal(asked.x, asked.y, frame=asked.frame, heading=asked.heading))


def start_mission(call: Call, start: StartMission) -> None:
    """Replace the drive request by a mission, which begins anew.

    Raises
    ------
    CommandError
        No mission has this name, or this run cannot drive it.
    """
    settings = call.context.tuning.current
    mission = settings.mission
    if mission is None or mission.name != start.name:
        if start.name not in list_shipped("missions"):
            raise CommandError(f"no mission is named {start.name}: choose one from the list", "name")
        try:
            mission = load_mission(start.name)
            with_mission(settings, mission)
        except ConfigError as error:
            raise CommandError(str(error), "name") from None
    _request_drive(call, Mission(mission))


def run_mission(call: Call, given: RunMission) -> None:
    """Replace the drive request by the mission of a file, which begins anew.

    Raises
    ------
    CommandError
        The text is no mission, or this run cannot drive it.
    """
    mission = _parsed_mission(given.toml)
    try:
        with_mission(call.context.tuning.current, mission)
    except ConfigError as error:
        raise CommandError(str(error), "toml") from None
    _request_drive(call, Mission(mission))


def read_mission(_: Call, given: ReadMission) -> MissionAnswer:
    """Return what a mission file holds; its waypoints and their frame where it is a route, otherwise None for both.

    Raises
    ------
    CommandError
        The text is no mission.
    """
    mission = _parsed_mission(given.toml)
    waypoints, frame = waypoints_of(mission) or (None, None)
    return {"name": mission.name, "about": mission.about, "waypoints": waypoints, "frame": frame}


def save_route(_: Call, asked: SaveRoute) -> str:
    """Return a route as the text of a mission file.

    Raises
    ------
    CommandError
        The name is none that a mission can have.
    """
    try:
        mission = route_config(asked.waypoints, asked.frame, asked.name)
    except ValueError:
        problem = f"{asked.name} cannot be a mission's name: use small letters, digits, - and _, 40 at most"
        raise CommandError(problem, "name") from None
    return mission_text(mission, "A route saved from the operator console; places are metres, headings degrees.")


def _parsed_mission(toml: str) -> MissionConfig:
    """Return the mission of a text.

    Raises
    ------
    CommandError
        It is invalid; the field is `toml`.
    """
    try:
        return parse_text(MissionConfig, toml, "mission")
    except ConfigError as error:
        raise CommandError(str(error), "toml") from None


def set_route(call: Call, asked: SetRoute) -> None:
    """Replace the drive request by a route, or change the one under way.

    Raises
    ------
    CommandError
        The robot does not know a map, and the waypoints are places there; or it must not or cannot drive there.
    """
    _request_drive(call, route(asked.waypoints, asked.frame))


def edit_mission(call: Call, _: NoArguments) -> None:
    """Hold, resume or skip in the mission under way, whichever the command is called.

    Raises
    ------
    CommandError
        There is none, or it is in no state for that.
    """
    _request_drive(call, MISSION_EDITS[call.name])


def _request_drive(call: Call, asked: DriveInput) -> None:
    """Pass what is to be driven, or a change of the mission, to the next cycle, unless that would refuse it.

    Raises
    ------
    CommandError
        The next cycle would refuse it, or too many wait; the text says why.
    """
    state = call.context.robot.state
    if needs_map(asked) and state.perception.localized() is None:
        raise CommandError(NO_MAP)
    settings = call.context.tuning.current
    _refuse_if(refusal(state.drive_request, asked) or way_refused(asked, state.zones, state.odometry, settings))
    if not call.context.robot.drive_request(asked, call.remains_valid()):
        raise CommandError(
            "too many changes of the mission are waiting for the next cycle: resume time, then try again"
        )
    call.context.is_teleoperated = False


def teleoperate(call: Call, request: Teleoperate) -> None:
    """Replace the drive request by a velocity, which expires unless it is repeated."""
    limit_s = call.context.tuning.current.behaviors.teleoperation.message_age_max_s
    call.context.is_teleoperated = True
    call.context.robot.drive_request(replace(request, valid_s=limit_s), call.remains_valid())


def take_control(call: Call, _: NoArguments) -> None:
    """Give the client control of the robot if it is free; otherwise ask the client that has it.

    Raises
    ------
    CommandError
        Another client has control and was asked.
    """
    _refuse_if(call.context.hub.control.request(call.client, call.context.clock()))


def release_control(call: Call, _: NoArguments) -> None:
    """Take control away from the client that has it."""
    call.context.hub.control.release()


def grant_control(call: Call, to: GrantControl) -> None:
    """Hand control over to the client that requested it.

    Raises
    ------
    CommandError
        That client did not request it.
    """
    _refuse_if(call.context.hub.control.grant(to.client))


def edit(call: Call, edit: Edit) -> AnsweredLater[None]:
    """Queue an edit of the map for the next cycle; the answer follows that cycle.

    Raises
    ------
    CommandError
        Too many edits are queued.
    """
    _queue(call, PendingEdit(edit, call.client, call.id))
    return ANSWERED_LATER


def undo_edit(call: Call, _: NoArguments) -> AnsweredLater[str]:
    """Take back the newest edit of the map that is not taken back yet; the answer names its kind.

    Raises
    ------
    CommandError
        There is none, a newer edit waits for the next cycle, or too many edits are queued.
    """
    history = call.context.history
    if any(not pending.is_undo for pending in call.context.pending_edits):
        raise CommandError("an edit waits for the next cycle: undo it once it is done; resume or step a paused run")
    if history.newest is None:
        raise CommandError("there is no edit of the map to undo")
    edited, undo = history.newest
    first = (PendingEdit(edit, call.client, None, is_undo=True) for edit in undo[:-1])
    _queue(call, *first, PendingEdit(undo[-1], call.client, call.id, edited.kind, is_undo=True))
    history.drop_newest()
    return ANSWERED_LATER


def _queue(call: Call, *pending: PendingEdit) -> None:
    """Pass edits to the next cycle; each command is answered when they are done.

    Raises
    ------
    CommandError
        Too many are waiting already.
    """
    if not call.context.robot.edit(*(one.edit for one in pending)):
        raise CommandError("too many edits are waiting for the next cycle: try again")
    call.context.pending_edits.extend(pending)


def get_evidence(call: Call, about: GetEvidence) -> EvidenceAnswer:
    """Return what supports and opposes an object, as the page shows it.

    Raises
    ------
    CommandError
        There is no such object.
    """
    found = call.context.robot.evidence(about.object)
    if found is None:
        raise CommandError(f"object {about.object} no longer exists: choose one from the list of objects")
    return {
        "object": found.object,
        "model": found.model,
        "for": found.supporting,
        "against": -found.opposing,
        "readings": [_reading(arc) for arc in found.arcs],
        "lines": [(line.number, line.x1, line.y1, line.x2, line.y2, line.supports) for line in found.lines],
        "rivals": found.rivals,
    }


def _reading(arc: Arc) -> ReadingRow | CrossReadingRow:
    row = (arc.x, arc.y, arc.range_m, arc.direction, arc.nats)
    return row if arc.listener is None else (*row, *arc.listener)


def show_grid(call: Call, _: NoArguments) -> None:
    """Send the client the evidence grid of the run, or of the recording that it is shown, as a message of its own.

    Raises
    ------
    CommandError
        Its recording has ended.
    """
    client, replay = call.client, call.context.replay
    if client.is_live or replay is None:
        client.send_newest("grid", _live_grid(call.context))
    else:
        replay.show_grid(client)


def _live_grid(context: CommandContext) -> bytes:
    """Return the message of the run's grid; it is made at most twice a second, however many clients ask how often."""
    now_s = context.clock()
    if now_s - context.grid[0] >= GRID_PERIOD_S:
        context.grid = (now_s, orjson.dumps(grid_message(context.robot.state)))
    return context.grid[1]


def set_parameter(call: Call, change: SetParameter) -> list[ChangedValue]:
    """Change one live setting; return the values that changed."""
    return _changed_values(call.context.tuning.set(change.path, change.value))


def undo_parameter(call: Call, _: NoArguments) -> ChangedValue | list[ChangedValue]:
    """Undo the last change of settings; return the values that changed."""
    rows = _changed_values(call.context.tuning.undo())
    return rows[0] if len(rows) == 1 else rows


def save_toml(call: Call, _: NoArguments) -> str:
    """Return all settings as the text of a run file."""
    return call.context.tuning.saved()


def _refuse_if(reason: str | None) -> None:
    """Refuse a command for a reason, if there is one.

    Raises
    ------
    CommandError
        There is.
    """
    if reason is not None:
        raise CommandError(reason)


def _changed_values(changed: Sequence[Difference]) -> list[ChangedValue]:
    """Return the changes of plain values, as the page shows them."""
    plain = (bool, int, float, str, type(None))
    return [{"path": d.path, "value": d.after} for d in changed if isinstance(d.after, plain)]
