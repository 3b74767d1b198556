"""The robot file of a robot with ROS, from its ranges, its frames and its odometry; without ROS itself."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from config.families.ros2 import SENSORS_MAX
from drivers.firing_pattern import time_of_flight_s
from drivers.ros_tf import Frame

DEPTH_MAX: Final = 32
"""Most frames between a sensor and the base."""
DISTINCT_S: Final = 0.005
"""Readings with stamps that differ by less count as one firing."""
STEP_MIN_S: Final = 0.02


class RobotFileError(ValueError):
    """What was heard does not make a robot file: what is missing, and what to do."""


@dataclass
class Heard:
    """What was heard of a robot."""

    topics: dict[str, str] = field(default_factory=dict)
    """The topic of each sensor's frame."""
    ranges: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """Least and greatest range (m) and whole beam width (rad) of each sensor's frame."""
    stamps_s: dict[str, list[float]] = field(default_factory=dict)
    """Stamps of the readings of each sensor's frame."""
    frames: dict[str, Frame] = field(default_factory=dict)
    """The newest transform of each frame to its parent."""
    odometry: str | None = None
    """Topic of the odometry."""
    base: str = "base_link"
    """The frame that it moves."""
    cmd_vel: str = "cmd_vel"
    """Topic for velocities."""
    is_stamped: bool = True
    """Whether they are `TwistStamped`."""
    odometry_s: list[float] = field(default_factory=list)
    """Its stamps."""


def robot_file(heard: Heard, *, radius_m: float, speed_m_s: float, turn_rad_s: float) -> dict[str, Any]:
    """Return the tables of the robot file.

    It was heard for some seconds. Radius and limits of the body are given, since no topic says them.

    Raises
    ------
    RobotFileError
        There are no ranges, no odometry, or no frames that lead from a sensor to the base.
    """
    if not heard.ranges:
        raise RobotFileError("no sensor_msgs/Range was heard; start the robot's sensors, or check ROS_DOMAIN_ID")
    if heard.odometry is None:
        raise RobotFileError("no nav_msgs/Odometry was heard; start the robot's base, or check ROS_DOMAIN_ID")
    if len(heard.ranges) > SENSORS_MAX:
        raise RobotFileError(
            f"{len(heard.ranges)} range sensors, and this driver takes {SENSORS_MAX}: stop the others"
        )
    mounts = {name: mount_of(name, heard.base, heard.frames) for name in heard.ranges}
    names = sorted(mounts, key=lambda name: (mounts[name][2] % (2.0 * math.pi), name))  # counter-clockwise from ahead
    limits = [limit for limit in heard.ranges.values() if 0.0 <= limit[0] < limit[1] < math.inf]
    if not limits:
        raise RobotFileError(
            "no sensor says between which ranges it measures: set min_range and max_range in its messages, or write "
            "the robot file by hand"
        )
    range_max_m = max(limit[1] for limit in limits)
    step_s = max(STEP_MIN_S, time_of_flight_s(range_max_m) + 1e-3, firing_period_s(heard.stamps_s.values()))
    return {
        "robot": {"driver": "ros2"},
        "ring": {
            "beam_half_angle_deg": round(math.degrees(max(limit[2] for limit in limits)) / 2.0, 3),
            "resolution_m": 0.001,
            "range_min_m": round(min(limit[0] for limit in limits), 4),
            "range_max_m": round(range_max_m, 4),
            "sensors": [
                {"x_m": round(x, 4), "y_m": round(y, 4), "angle_deg": round(math.degrees(angle), 3)}
                for x, y, angle in map(mounts.__getitem__, names)
            ],
            "firing": {"sets": [list(range(len(names)))], "step_period_s": round(step_s, 4)},
        },
        "body": {"radius_m": radius_m, "speed_max_m_s": speed_m_s, "turn_max_rad_s": turn_rad_s},
        "link": {"port": "ros2", "baud": 4_000_000},
        "ros2": {
            "ranges": sorted({heard.topics[name] for name in names}),
            "frames": names,
            "odometry": heard.odometry,
            "base_frame": heard.base,
            "cmd_vel": heard.cmd_vel,
            "cmd_vel_stamped": heard.is_stamped,
            "odometry_period_s": round(max(0.001, period_s(heard.odometry_s) or 0.05), 4),
        },
    }


def mount_of(name: str, base: str, frames: Mapping[str, Frame]) -> tuple[float, float, float]:
    """Return place (m) and direction (rad) of a frame in the base's, in the plane.

    Raises
    ------
    RobotFileError
        No frames lead from the one to the other.
    """
    point, axis, at = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), name
    for _ in range(DEPTH_MAX):
        if at == base:
            return point[0], point[1], math.atan2(axis[1], axis[0])
        frame = frames.get(at)
        if frame is None:
            break
        turned = rotated(point, frame.rotation)
        point = (turned[0] + frame.translation[0], turned[1] + frame.translation[1], turned[2] + frame.translation[2])
        axis, at = rotated(axis, frame.rotation), frame.parent.lstrip("/")
    raise RobotFileError(
        f"no frames of TF lead from the sensor {name!a} to {base!a}, only to {at!a}; start robot_state_publisher, or "
        f"write the sensors' places into a robot file"
    )


def rotated(p: Sequence[float], q: Sequence[float]) -> tuple[float, float, float]:
    """Return a point turned by a unit quaternion x, y, z, w."""
    x, y, z, w = q
    # v + 2 u × (u × v + w v), with u the vector part.
    cx, cy, cz = y * p[2] - z * p[1] + w * p[0], z * p[0] - x * p[2] + w * p[1], x * p[1] - y * p[0] + w * p[2]
    return (p[0] + 2.0 * (y * cz - z * cy), p[1] + 2.0 * (z * cx - x * cz), p[2] + 2.0 * (x * cy - y * cx))


def firing_period_s(stamps_s: Iterable[Sequence[float]]) -> float:
    """Return the time between two firings, s: between the stamps of all sensors, those within 5 ms taken as one."""
    every = sorted(stamp for stamps in stamps_s for stamp in stamps)
    firings = [b for a, b in zip([-math.inf, *every], every, strict=False) if b - a > DISTINCT_S]
    return period_s(firings) or 0.0


def period_s(stamps_s: Sequence[float]) -> float | None:
    """Return the mean time between stamps, s; None for fewer than two."""
    return (max(stamps_s) - min(stamps_s)) / (len(stamps_s) - 1) if len(stamps_s) > 1 else None
