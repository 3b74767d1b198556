"""The section `[ros2]` of a robot file."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from config.families.ros2 import SENSORS_MAX, Ros2Config


def test_it_may_be_left_out() -> None:
    ros2 = Ros2Config()
    assert (ros2.ranges, ros2.odometry, ros2.base_frame, ros2.cmd_vel) == ((), "odom", "base_link", "cmd_vel")


@pytest.mark.parametrize(
    "wrong",
    [{"frames": ["a"] * (SENSORS_MAX + 1)}, {"odometry": ""}, {"deadman_s": 0.0}, {"odometry_period_s": 0.0}],
)
def test_values_out_of_bounds_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Ros2Config.model_validate(wrong)
