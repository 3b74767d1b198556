"""The one list of all console commands: name, arguments, permission and handler of each."""

from __future__ import annotations

import functools
from types import MappingProxyType
from typing import Any, Final

from behaviors.teleoperation import Teleoperate
from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    LiftArea,
    MoveObject,
    PinSegments,
    PlaceModel,
    PlaceRobot,
    RejectObject,
)
from runtime.console.commands import (
    async_commands,
    file_commands,
    handlers,
    place_commands,
    robot_commands,
    settings_commands,
)
from runtime.console.commands import messages as arguments
from runtime.console.commands.command import Command, Permission, always
from runtime.console.commands.messages import MessageReader, NoArguments
from runtime.cycle.drive_requests import Legs


def _is_moving(request: Teleoperate) -> bool:
    """Return whether a velocity is not zero: zero stops the robot, however late it comes."""
    return request.v != 0.0 or request.w != 0.0


TOKEN, CONTROL = Permission.TOKEN, Permission.CONTROL

_ALL: Final[tuple[Command[Any], ...]] = (
    Command("halt", NoArguments, TOKEN, handlers.request_mode),
    Command("arm", NoArguments, CONTROL, handlers.request_mode, always),
    Command("disarm", NoArguments, CONTROL, handlers.request_mode),
    Command("take_control", NoArguments, TOKEN, handlers.take_control),
    Command("release_control", NoArguments, CONTROL, handlers.release_control),
    Command("grant_control", arguments.GrantControl, CONTROL, handlers.grant_control),
    Command("legs", Legs, CONTROL, handlers.follow_legs, always),
    Command("goal", arguments.SetGoal, CONTROL, handlers.set_goal, always),
    Command("start_mission", arguments.StartMission, CONTROL, handlers.start_mission, always),
    Command("run_mission", arguments.RunMission, CONTROL, handlers.run_mission, always),
    Command("read_mission", arguments.ReadMission, TOKEN, handlers.read_mission),
    Command("set_route", arguments.SetRoute, CONTROL, handlers.set_route, always),
    Command("save_route", arguments.SaveRoute, TOKEN, handlers.save_route),
    Command("hold_mission", NoArguments, CONTROL, handlers.edit_mission),
    Command("resume_mission", NoArguments, CONTROL, handlers.edit_mission, always),
    Command("skip_step", NoArguments, CONTROL, handlers.edit_mission, always),
    Command("teleoperate", Teleoperate, CONTROL, handlers.teleoperate, _is_moving),
    Command("clear_map", ClearMap, CONTROL, handlers.edit, always, survives_stop=True),
    Command("delete_segments", DeleteSegments, CONTROL, handlers.edit, always, survives_stop=True),
    Command("pin_segments", PinSegments, CONTROL, handlers.edit, always, survives_stop=True),
    Command("place_model", PlaceModel, CONTROL, handlers.edit, always, survives_stop=True),
    Command("move_object", MoveObject, CONTROL, handlers.edit, always, survives_stop=True),
    Command("reject_object", RejectObject, CONTROL, handlers.edit, always, survives_stop=True),
    Command("lift_area", LiftArea, CONTROL, handlers.edit, always, survives_stop=True),
    Command("undo_edit", NoArguments, CONTROL, handlers.undo_edit, always, survives_stop=True),
    Command("set_places", place_commands.SetPlaces, CONTROL, place_commands.set_places, always, survives_stop=True),
    Command("undo_places", NoArguments, CONTROL, place_commands.undo_places, always, survives_stop=True),
    Command("go_to_place", place_commands.GoToPlace, CONTROL, place_commands.go_to_place, always),
    Command("read_places", place_commands.ReadPlaces, TOKEN, place_commands.read_places),
    Command("save_map", place_commands.SaveMap, TOKEN, place_commands.save_map),
    Command("place_robot", PlaceRobot, CONTROL, handlers.edit, always, survives_stop=True),
    Command("confirm_object", ConfirmObject, CONTROL, handlers.edit, always, survives_stop=True),
    Command("evidence", arguments.GetEvidence, TOKEN, handlers.get_evidence),
    Command("show_grid", NoArguments, TOKEN, handlers.show_grid),
    Command("load_model", arguments.LoadModel, CONTROL, async_commands.load_model, always, survives_stop=True),
    Command("robot_file", arguments.DescribeRobot, TOKEN, robot_commands.robot_file),
    Command("load_map", arguments.LoadMap, CONTROL, async_commands.load_map, always, survives_stop=True),
    Command("set_parameter", arguments.SetParameter, CONTROL, handlers.set_parameter, always, survives_stop=True),
    Command("undo_parameter", NoArguments, CONTROL, handlers.undo_parameter, always, survives_stop=True),
    Command("list_settings", NoArguments, TOKEN, settings_commands.list_settings),
    Command("read_settings", settings_commands.ReadSettings, TOKEN, settings_commands.read_settings),
    Command("check_settings", settings_commands.CheckSettings, TOKEN, settings_commands.check_settings),
    Command("change_settings", settings_commands.ChangeSettings, TOKEN, settings_commands.change_settings),
    Command("save_settings", settings_commands.SaveSettings, CONTROL, settings_commands.save_settings),
    Command("restart_run", NoArguments, CONTROL, settings_commands.restart_run, always),
    Command("save_toml", NoArguments, TOKEN, handlers.save_toml),
    Command("pause", NoArguments, CONTROL, async_commands.pause),
    Command("resume", NoArguments, CONTROL, async_commands.resume, always),
    Command("single_step", NoArguments, CONTROL, async_commands.single_step, always),
    Command("set_speed", arguments.SetSpeed, CONTROL, async_commands.set_speed),
    Command("record", arguments.Record, CONTROL, async_commands.record),
    Command("bookmark", arguments.AddBookmark, CONTROL, async_commands.add_bookmark),
    Command("undo_bookmark", NoArguments, CONTROL, async_commands.undo_bookmark),
    Command("list_recordings", NoArguments, TOKEN, async_commands.list_recordings),
    Command("open_recording", arguments.OpenRecording, TOKEN, async_commands.open_recording),
    Command("seek_recording", arguments.SeekRecording, TOKEN, async_commands.seek_recording),
    Command("play_recording", arguments.PlayRecording, TOKEN, async_commands.play_recording),
    Command("step_recording", arguments.StepRecording, TOKEN, async_commands.step_recording),
    Command("close_recording", NoArguments, TOKEN, async_commands.close_recording),
    Command("rename_recording", arguments.RenameRecording, CONTROL, file_commands.rename_recording),
    Command("pin_recording", arguments.PinRecording, CONTROL, file_commands.pin_recording),
    Command("undo_file", NoArguments, CONTROL, file_commands.undo_file),
    Command("delete_recording", arguments.DeleteRecording, CONTROL, file_commands.delete_recording),
    Command("make_files", arguments.MakeFiles, TOKEN, file_commands.make_files),
    Command("list_jobs", NoArguments, TOKEN, file_commands.list_jobs),
    Command("cancel_job", arguments.CancelJob, TOKEN, file_commands.cancel_job),
)

COMMANDS: Final = MappingProxyType({command.name: command for command in _ALL})


@functools.cache
def reader() -> MessageReader:
    """Return what reads the messages of all commands; making it takes 30 ms, so a start does not wait for it."""
    return MessageReader({command.name: command.type for command in _ALL})
