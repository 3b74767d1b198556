"""A robot file from what a robot with ROS says of itself."""

from __future__ import annotations

import math

import pytest

from config.robot import RobotConfig
from drivers.registry import make_driver
from drivers.ros_tf import Frame, planar
from runtime.bridges.ros2.robot_file import Heard, RobotFileError, firing_period_s, mount_of, robot_file, rotated

TIPPED = Frame(0, "mast", "us1", (0.0, 0.1, 0.0), (math.sin(0.1), 0.0, 0.0, math.cos(0.1)))


def heard() -> Heard:
    frames = [planar(0, "ring", "us0", 0.2, 0.0, 0.0), TIPPED, planar(0, "ring", "mast", 0.0, 0.0, 0.5 * math.pi)]
    frames.append(planar(0, "/base", "ring", 0.05, 0.0, 0.0))
    return Heard(
        topics={"us0": "/us", "us1": "/us"},
        ranges={"us0": (0.1, 4.0, 0.4), "us1": (0.05, 3.0, 0.5)},
        stamps_s={"us0": [1.0, 1.1, 1.2], "us1": [1.001, 1.101]},
        frames={frame.child: frame for frame in frames},
        odometry="/odom",
        base="base",
        cmd_vel="/r1/cmd_vel",
        is_stamped=False,
        odometry_s=[1.0, 1.02, 1.04],
    )


def test_the_file_is_valid_and_lists_the_sensors_with_their_places() -> None:
    tables = robot_file(heard(), radius_m=0.3, speed_m_s=0.4, turn_rad_s=1.0)
    config = RobotConfig.model_validate(tables)
    make_driver(config)
    assert config.ros2.frames == ("us0", "us1")
    assert config.ring.mounts[0] == pytest.approx((0.25, 0.0, 0.0))
    assert config.ring.mounts[1] == pytest.approx((-0.05, 0.0, 0.5 * math.pi), abs=1e-4)
    assert (config.ring.range_min_m, config.ring.range_max_m) == (0.05, 4.0)
    assert config.ring.firing.step_period_s == pytest.approx(0.1)
    assert (config.ros2.odometry_period_s, config.ros2.cmd_vel_stamped) == (0.02, False)
    assert config.ros2.cmd_vel == "/r1/cmd_vel"


def test_a_sensor_without_limits_leaves_them_to_the_others() -> None:
    part = heard()
    part.ranges["us0"] = (math.nan, math.inf, 0.4)
    tables = robot_file(part, radius_m=0.3, speed_m_s=0.4, turn_rad_s=1.0)
    assert (tables["ring"]["range_min_m"], tables["ring"]["range_max_m"]) == (0.05, 3.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ranges": {}}, "no sensor_msgs/Range"),
        ({"odometry": None}, "no nav_msgs/Odometry"),
        ({"frames": {}}, "no frames of TF lead from the sensor 'us0' to 'base', only to 'us0'"),
        ({"ranges": {"us0": (0.0, 0.0, 0.4), "us1": (math.nan, 4.0, 0.5)}}, "between which ranges it measures"),
        ({"ranges": {f"u{k}": (0.1, 4.0, 0.4) for k in range(25)}}, "25 range sensors"),
    ],
)
def test_what_is_missing_is_said_in_a_line(change: dict[str, object], message: str) -> None:
    part = heard()
    for name, value in change.items():
        setattr(part, name, value)
    with pytest.raises(RobotFileError, match=message):
        robot_file(part, radius_m=0.3, speed_m_s=0.4, turn_rad_s=1.0)


def test_frames_in_a_circle_lead_nowhere() -> None:
    with pytest.raises(RobotFileError, match="no frames of TF"):
        mount_of("a", "base", {"a": planar(0, "b", "a", 0, 0, 0), "b": planar(0, "a", "b", 0, 0, 0)})


def test_a_quarter_turn_about_each_axis() -> None:
    s = math.sqrt(0.5)
    assert rotated((1.0, 0.0, 0.0), (0.0, 0.0, s, s)) == pytest.approx((0.0, 1.0, 0.0))
    assert rotated((0.0, 1.0, 0.0), (s, 0.0, 0.0, s)) == pytest.approx((0.0, 0.0, 1.0))
    assert rotated((0.0, 0.0, 1.0), (0.0, s, 0.0, s)) == pytest.approx((1.0, 0.0, 0.0))


def test_sensors_that_fire_in_turn_have_a_short_period() -> None:
    assert firing_period_s([[0.0, 0.1], [0.05, 0.15]]) == pytest.approx(0.05)
    assert firing_period_s([[1.0]]) == 0.0
