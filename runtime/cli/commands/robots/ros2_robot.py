"""`echolocate ros2-robot`: the robot file of a robot that runs ROS 2."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from runtime.cli.commands.output_files import check_outputs, writing
from runtime.cli.commands.ros2 import NO_ROS
from runtime.cli.options import Force

if TYPE_CHECKING:
    from runtime.bridges.ros2.robot_file import Heard


def ros2_robot(
    *,
    out: str,
    radius: float,
    speed: float = 0.3,
    turn: float = 1.0,
    seconds: float = 5.0,
    force: Force = False,
) -> int:
    """Write the robot file of a robot that runs ROS 2, from its ranges, odometry and frames; nothing moves.

    Parameters
    ----------
    out
        File to write; then `echolocate run --robot FILE` runs the robot.
    radius
        Radius of its body, m.
    speed
        Largest speed to drive it at, m/s.
    turn
        Largest turning rate, rad/s.
    seconds
        How long to listen.

    Raises
    ------
    UserError
        ROS 2 is not installed, the robot lacks something, or the file cannot be written.
    """
    if not (radius > 0.0 and speed > 0.0 and turn > 0.0 and seconds > 0.0):
        raise UserError("--radius, --speed, --turn and --seconds must be above 0", WRONG_CALL)
    check_outputs({"--out": out}, force=force)
    if find_spec("rclpy") is None:
        raise UserError(NO_ROS, FAILED)
    from runtime.bridges.ros2.robot_listener import listen

    heard = listen(seconds)
    text = robot_file_text(heard, radius, speed, turn)
    with writing("--out", out):
        Path(out).write_text(text, "utf-8")
    sys.stdout.write(f"{out}: {len(heard.ranges)} sensors; run it with `echolocate run --robot {out}`\n")
    return DONE


def robot_file_text(heard: Heard, radius_m: float, speed_m_s: float, turn_rad_s: float) -> str:
    """Return the text of the robot file.

    Raises
    ------
    UserError
        The robot lacks something, or says what no robot can be.
    """
    import tomli_w
    from pydantic import ValidationError

    from config.robot import RobotConfig
    from runtime.bridges.ros2.robot_file import RobotFileError, robot_file

    try:
        tables: dict[str, Any] = robot_file(heard, radius_m=radius_m, speed_m_s=speed_m_s, turn_rad_s=turn_rad_s)
        RobotConfig.model_validate(tables)
    except RobotFileError as error:
        raise UserError(str(error), FAILED) from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise UserError(f"the robot's {'.'.join(map(str, first['loc']))}: {first['msg']}", FAILED) from error
    head = "# A robot with ROS 2, as `echolocate ros2-robot` heard it: check the body's size and limits.\n\n"
    return head + tomli_w.dumps(tables)
