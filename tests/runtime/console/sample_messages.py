"""A sample message of every command, and what it results in."""

from __future__ import annotations

from typing import Any

from behaviors.missions.mission import Mission, route
from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from config.load import load_mission
from config.route import mission_text
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
from runtime.cycle.drive_requests import Legs
from runtime.cycle.inputs import Request

ROBOT_REQUESTS: list[tuple[dict[str, Any], object]] = [
    ({"type": "halt"}, Request.HALT),
    ({"type": "arm"}, Request.ARM),
    ({"type": "disarm"}, Request.DISARM),
    ({"type": "legs"}, Legs()),
    ({"type": "goal", "x": 1, "y": -2.5}, Goal(1.0, -2.5)),
    ({"type": "goal", "x": 1, "y": 0, "heading": 1.5, "frame": "odom"}, Goal(1.0, 0.0, heading=1.5)),
    ({"type": "run_mission", "toml": mission_text(load_mission("mow"), "")}, Mission(load_mission("mow"))),
    ({"type": "start_mission", "name": "patrol"}, Mission(load_mission("patrol"))),
    (
        {"type": "set_route", "waypoints": [[1, 0, None], [1, 1.5, 90]], "frame": "odom"},
        route(((1.0, 0.0, None), (1.0, 1.5, 90.0)), "odom"),
    ),
    ({"type": "teleoperate", "v": 0.2, "w": -1}, Teleoperate(0.2, -1.0, 0.25)),
]
"""With what the robot's process is asked for."""
EDITS: list[tuple[dict[str, Any], object]] = [
    ({"type": "clear_map"}, ClearMap()),
    ({"type": "delete_segments", "numbers": [3, 1]}, DeleteSegments((3, 1))),
    ({"type": "pin_segments", "numbers": [2], "pinned": True}, PinSegments((2,), pinned=True)),
    (
        {"type": "place_model", "model": "semicircle", "x": 1.0, "y": 2.0, "theta": 0.5},
        PlaceModel("semicircle", 1.0, 2.0, 0.5),
    ),
    ({"type": "move_object", "object": 4, "x": 1.0, "y": 2.0, "theta": 0}, MoveObject(4, 1.0, 2.0, 0.0)),
    ({"type": "place_robot", "x": 1.0, "y": 2.0, "theta": 0.5}, PlaceRobot(1.0, 2.0, 0.5)),
    ({"type": "reject_object", "object": 4}, RejectObject(4)),
    ({"type": "lift_area", "area": 2}, LiftArea(2)),
    ({"type": "confirm_object", "object": 4}, ConfirmObject(4)),
]
"""With the edit that the next cycle carries out."""
ASYNC_COMMANDS: list[tuple[dict[str, Any], str]] = [
    ({"type": "pause"}, "pause"),
    ({"type": "resume"}, "resume"),
    ({"type": "single_step"}, "single_step"),
    ({"type": "set_speed", "factor": 2}, "speed 2.0"),
    ({"type": "record", "on": True}, "record True"),
    ({"type": "bookmark", "text": "here"}, "bookmark here"),
    ({"type": "undo_bookmark"}, "undo_bookmark"),
    ({"type": "list_recordings"}, "recordings"),
    ({"type": "open_recording", "file": "run.mcap"}, "open run.mcap"),
    ({"type": "seek_recording", "s": 1.5}, "seek 1.5"),
    ({"type": "play_recording", "speed": 1}, "play 1.0"),
    ({"type": "step_recording", "cycles": -3}, "step -3"),
    ({"type": "close_recording"}, "close_recording"),
]
"""With what the stub of time control, recording and replay notes."""
ROBOT: dict[str, Any] = {
    "type": "robot_file", "name": "my robot", "driver": "denning", "count": 16, "radius_m": 0.2, "sensors": None,
    "beam_half_angle_deg": 12, "resolution_m": 0.01, "range_min_m": 0.1, "range_max_m": 4, "preset": "quadrants",
    "step_period_s": 0.05, "body_radius_m": 0.22, "speed_max_m_s": 0.5, "turn_max_rad_s": 1.5, "synchro": False,
}  # fmt: skip
"""A robot as the page describes it."""
OTHERS: list[dict[str, Any]] = [
    ROBOT,
    {"type": "set_places", "places": {"place": [{"name": "charger", "x_m": 1, "y_m": -2.5}]}},
    {"type": "undo_places"},
    {"type": "go_to_place", "name": "charger"},
    {"type": "read_places", "text": ""},
    {"type": "save_map", "format": "toml"},
    {"type": "rename_recording", "file": "run.mcap", "to": "dock"},
    {"type": "pin_recording", "file": "run.mcap", "pinned": True},
    {"type": "undo_file"},
    {"type": "delete_recording", "file": "run.mcap"},
    {"type": "make_files", "kind": "map", "file": "run.mcap"},
    {"type": "list_jobs"},
    {"type": "cancel_job", "job": 1},
    {"type": "load_map", "toml": "wall = 1"},
    {"type": "hold_mission"},
    {"type": "read_mission", "toml": "name = 1"},
    {"type": "save_route", "name": "a", "waypoints": [[1, 0, None]], "frame": "odom"},
    {"type": "resume_mission"},
    {"type": "skip_step"},
    {"type": "take_control"},
    {"type": "release_control"},
    {"type": "grant_control", "client": 2},
    {"type": "evidence", "object": 1},
    {"type": "show_grid"},
    {"type": "load_model", "toml": "name = 1"},
    {"type": "set_parameter", "path": "behaviors.arbiter.base_velocity_m_s", "value": 0.4},
    {"type": "undo_parameter"},
    {"type": "undo_edit"},
    {"type": "save_toml"},
    {"type": "list_settings"},
    {"type": "read_settings", "file": 0},
    {"type": "check_settings", "file": 0, "toml": "robot = 1"},
    {"type": "change_settings", "file": 0, "toml": "robot = 1", "path": "skippy.trim", "value": 1.5},
    {"type": "save_settings", "file": 0, "toml": "robot = 1", "digest": "0" * 64},
    {"type": "restart_run"},
]
ALL: list[dict[str, Any]] = [
    *(message for table in (ROBOT_REQUESTS, EDITS, ASYNC_COMMANDS) for message, _ in table),
    *OTHERS,
]
