"""The handler of the command that describes a robot: its file, checked as `echolocate check` would."""

from __future__ import annotations

from dataclasses import asdict

from config.load import ConfigError, parse_text
from config.robot import RobotConfig
from config.robot_file import RobotDraft, robot_text
from config.settings import Settings
from runtime.console.commands.command import Call
from runtime.console.commands.command_error import CommandError
from runtime.console.commands.messages import DescribeRobot
from runtime.support.pattern_check import refuse_undrivable


def robot_file(call: Call, given: DescribeRobot) -> str:
    """Return the file of a robot.

    Raises
    ------
    UserError
        A value is out of its bounds, the ring cannot fire so, or the robot would not see where it drives.
    """
    text = robot_text(RobotDraft(**asdict(given)))
    try:
        robot = parse_text(RobotConfig, text, "robot")
        settings = call.context.tuning.current.model_dump() | robot.model_dump()
        refuse_undrivable(Settings.model_validate(settings))
    except ConfigError as error:
        raise CommandError("; ".join(line.removeprefix("robot: ") for line in error.problems)) from None
    except ValueError as error:
        raise CommandError(str(error)) from None
    return text
