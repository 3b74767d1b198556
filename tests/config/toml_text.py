"""TOML text of a table, and one table with a valid value for every setting."""

from __future__ import annotations

import copy
import datetime
import math
from typing import Any

REGULAR_RING = {
    "count": 24,
    "radius_m": 0.381,
    "beam_half_angle_deg": 12.0,
    "resolution_m": 0.03048,
    "range_min_m": 0.1524,
    "range_max_m": 7.7724,
    "firing": {"preset": "octets", "rotations": 1, "step_period_s": 0.05, "window_m": 7.0},
}
BODY = {
    "radius_m": 0.4,
    "speed_max_m_s": 0.5,
    "turn_max_rad_s": 1.0,
    "acceleration_max_m_s2": 0.5,
    "turn_acceleration_max_rad_s2": 2.0,
    "synchro": True,
}
ARCOS = {
    "subclasses": ["p3dx"],
    "distance_factor": 0.485,
    "velocity_factor": 0.6154,
    "range_factor": 0.268,
    "turn_factor": 0.0034,
    "discs": [0, 1],
}
RFLEX = {
    "name": "B21r",
    "distance_factor": 103000.0,
    "angle_factor": 35000.0,
    "range_factor": 1474.0,
    "banks": [12, 12],
    "first_bank": 6,
    "ping_delay_us": 1250,
    "bumpers": [64, 65],
    "bumper_mask": 255,
    "fail_safe_s": 0.5,
    "battery_low_v": 21.0,
}
ROS2 = {
    "ranges": ["/sonar/s00", "/sonar/s01"],
    "frames": ["sonar_00", "sonar_01"],
    "odometry": "/odom",
    "base_frame": "base_footprint",
    "cmd_vel": "/cmd_vel",
    "cmd_vel_stamped": False,
    "odometry_period_s": 0.02,
    "group_s": 0.01,
    "deadman_s": 0.25,
}
ROBOT: dict[str, Any] = {
    "ring": REGULAR_RING,
    "body": BODY,
    "link": {"port": "/dev/ttyS0", "baud": 9600},
    "arcos": ARCOS,
    "rflex": RFLEX,
    "ros2": ROS2,
}
MODEL: dict[str, Any] = {
    "name": "corner",
    "vertices_m": [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]],
    "closed": False,
    "arc_radius_m": 1.0,
}
PLACES: dict[str, Any] = {
    "place": [{"name": "charger", "x_m": 1.0, "y_m": 2.0, "heading_deg": 90.0}],
    "no_go_line": [{"name": "stairs", "points_m": [[0.0, 0.0], [1.0, 0.0]]}],
    "no_go_area": [{"name": "rug", "vertices_m": [[5.0, 5.0], [6.0, 5.0], [6.0, 6.0]]}],
    "speed_area": [{"name": "ward", "vertices_m": [[7.0, 5.0], [8.0, 5.0], [8.0, 6.0]], "speed_max_m_s": 0.1}],
}
WORLD: dict[str, Any] = {
    **PLACES,
    "drum": [{"x_m": 1.0, "y_m": 2.0, "radius_m": 0.3}],
    "wall": [{"x1_m": 0.0, "y1_m": 3.0, "x2_m": 5.0, "y2_m": 3.0}],
    "box": [{"x_m": -2.0, "y_m": 2.0, "width_m": 1.0, "depth_m": 0.5, "angle_deg": 30.0}],
    "polygon": [{"vertices_m": [[5.0, 5.0], [6.0, 5.0], [6.0, 6.0]]}],
    "start": {"x_m": -2.0, "y_m": 0.0, "heading_deg": 0.0},
    "acoustics": {"model": "cone", "noise_relative": 0.01},
    "odometry": {"scale": 1.0},
}
STUDY: dict[str, Any] = {
    "scenes": ["clean"],
    "seeds": 2,
    "models": ["drum"],
    "sets": ["cycle.rate_hz=20.0"],
    "vary": [{"setting": "ring.beam_half_angle_deg", "values": [8.0, 12.0]}],
    "objectives": ["recall"],
}
MISSION: dict[str, Any] = {
    "name": "errand",
    "about": "Goes there and back.",
    "endless": False,
    "step": [
        {
            "name": "out",
            "schemas": [
                {"name": "move_to_goal", "x_m": 1.0, "y_m": 2.0},
                {"name": "wander"},
                {"name": "follow_wall"},
                {"name": "follow_valley"},
                {"name": "leave_canyon"},
                {"name": "avoid_past"},
                {"name": "noise"},
                {"name": "swirl"},
            ],
            "until": [
                {"when": "reached", "go": "next"},
                {"when": "seen", "object": "wall"},
                {"when": "unseen", "object": "wall"},
                {"when": "time", "after_s": 9.0},
                {"when": "way", "after_m": 9.0},
                {"when": "bumper"},
                {"when": "lost"},
                {"when": "stuck"},
                {"when": "unreachable"},
            ],
        },
        {"name": "round", "schemas": [{"name": "turn", "heading_deg": 90.0}]},
        {"name": "along", "schemas": [{"name": "stay_on_path", "points_m": [[0.0, 0.0], [1.0, 0.0]]}]},
        {"name": "dock", "schemas": [{"name": "approach_object", "object": "wall"}]},
        {"name": "look", "schemas": [{"name": "search"}]},
        {"name": "on", "schemas": [{"name": "move_ahead", "distance_m": 1.0}]},
    ],
}
RUN: dict[str, Any] = {
    **ROBOT,
    "models": [MODEL],
    "world": WORLD,
    "places": copy.deepcopy(PLACES),
    "cycle": {},
    "perception": {
        "grid": {"method": "directed"},
        "segments": {},
        "map": {},
        "clusters": {},
        "relaxation": {},
        "recognition": {},
    },
    "behaviors": {"move_ahead": {}, "avoid_static_obstacle": {}, "arbiter": {}},
    "log": {},
    "goal": {"x_m": 1.0, "y_m": 2.0, "heading_deg": 90.0},
}
"""A run file that names no other file."""


def irregular(robot: dict[str, Any]) -> dict[str, Any]:
    """Return the table with its ring and firing sets listed one by one."""
    table = copy.deepcopy(robot)
    del table["ring"]["count"], table["ring"]["radius_m"], table["ring"]["firing"]["preset"]
    table["ring"]["sensors"] = [
        {"x_m": 0.1, "y_m": 0.1, "angle_deg": 90.0},
        {"x_m": 0.1, "y_m": -0.1, "angle_deg": 0.0},
    ]
    table["ring"]["firing"]["sets"] = [[0], [1]]
    return table


def toml(value: Any) -> str:
    """Return a value as TOML, tables inline."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return quoted(value)
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, datetime.date):
        return value.isoformat()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{quoted(k)} = {toml(v)}" for k, v in value.items()) + "}"
    return "[" + ", ".join(toml(v) for v in value) + "]"


def document(table: dict[str, Any]) -> str:
    """Return a table as a TOML file."""
    return "".join(f"{quoted(key)} = {toml(value)}\n" for key, value in table.items())


def quoted(text: str) -> str:
    escaped = (f"\\u{ord(c):04x}" if ord(c) < 0x20 or c in '"\\\x7f' else c for c in text)
    return '"' + "".join(escaped) + '"'
