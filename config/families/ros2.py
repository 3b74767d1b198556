"""The section `[ros2]` of a robot file: the topics and frames of a robot that runs ROS 2."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from pydantic import Field

from config.strict import Strict, TomlList

SENSORS_MAX = 24
"""Most sensors of such a robot: as many as a mask of the ring-and-base protocol has bits."""

Name: TypeAlias = Annotated[str, Field(min_length=1, max_length=200)]


class Ros2Config(Strict):
    """Topics and frames of a robot that runs ROS 2; `echolocate ros2-robot` writes them."""

    ranges: Annotated[TomlList[Name], Field(max_length=SENSORS_MAX)] = ()
    """Topics of `sensor_msgs/Range`: one for each sensor, or one for all of them."""
    frames: Annotated[TomlList[Name], Field(max_length=SENSORS_MAX)] = ()
    """The frame of each sensor, in the order of the ring."""
    zero_is_silence: bool = False
    """Whether a range of 0 or below means that nothing was heard; else such a reading is not used."""
    odometry: Name = "odom"
    """Topic of `nav_msgs/Odometry`."""
    base_frame: Name = "base_link"
    """The frame that the odometry moves, and in which the ring lists its sensors."""
    cmd_vel: Name = "cmd_vel"
    """Topic for velocities."""
    cmd_vel_stamped: bool = True
    """Whether velocities are `geometry_msgs/TwistStamped`; else `Twist`."""
    odometry_period_s: float = Field(default=0.05, ge=0.001, le=1.0)
    """Time between two messages of the odometry, s."""
    group_s: float = Field(default=0.005, ge=0.0, le=1.0)
    """Readings stamped within this time count as one firing, s."""
    deadman_s: float = Field(default=0.3, ge=0.05, le=2.0)
    """A velocity of zero is sent this long after the last one of the run, s."""
