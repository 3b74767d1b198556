"""The handler of the command that describes a robot: its file, checked as `echolocate check` would."""

from __future__ import annotations

from typing import Any, Final

from config.errors import UserError
from config.load import ConfigError, parse_text
from config.robot import RobotConfig
from config.robot_file import robot_text
from config.settings import Settings
from runtime.console.commands.command import Call
from runtime.console.commands.command_error import CommandError
from runtime.console.commands.messages import DescribeRobot
from runtime.support.pattern_check import refuse_undrivable

HEAD: Final = ("A robot described in the operator console, m and degrees. `echolocate settings` lists every key.",)


def robot_file(call: Call, given: DescribeRobot) -> str:
    """Return the file of a robot.

    Raises
    ------
    CommandError
        A value is out of its bounds, the ring cannot fire so, or the robot would not see where it drives.
    """
    text = robot_text(_tables(given), HEAD)
    try:
        robot = parse_text(RobotConfig, text, "robot")
        settings = call.context.tuning.current.model_dump() | robot.model_dump()
        refuse_undrivable(Settings.model_validate(settings))
    except ConfigError as error:
        raise CommandError("; ".join(line.removeprefix("robot: ") for line in error.problems)) from None
    except (UserError, ValueError) as error:
        raise CommandError(str(error)) from None
    return text


def _tables(given: DescribeRobot) -> dict[str, dict[str, Any]]:
    sensors = given.sensors
    is_regular = sensors is None
    return {
        "robot": {"name": given.name or None, "driver": given.driver},
        "ring": {
            "count": given.count if is_regular else None,
            "radius_m": given.radius_m if is_regular else None,
            "sensors": None if sensors is None else [{"x_m": x, "y_m": y, "angle_deg": a} for x, y, a in sensors],
            "beam_half_angle_deg": given.beam_half_angle_deg,
            "resolution_m": given.resolution_m,
            "range_min_m": given.range_min_m,
            "range_max_m": given.range_max_m,
            "firing": {"preset": given.preset, "step_period_s": given.step_period_s},
        },
        "body": {
            "radius_m": given.body_radius_m,
            "speed_max_m_s": given.speed_max_m_s,
            "turn_max_rad_s": given.turn_max_rad_s,
            "synchro": given.synchro,
        },
    }
