"""`echolocate ros2`: a bridge between a run and ROS 2, in a process of its own."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Callable, Coroutine
from importlib.resources import files
from importlib.util import find_spec
from typing import Annotated, Any, Final

from cyclopts import Parameter

from config.errors import DONE, FAILED, UserError
from runtime.cli.options import Connect, Flag
from runtime.cli.start_signals import handled_by_loop
from runtime.support.console_address import find_console, list_consoles
from runtime.support.user_folders import state_folder

NO_ROS: Final = (
    "ROS 2 is not installed here: source its setup.bash and run echolocate with its version of Python, or "
    "pip install 'echolocate[ros2]'"
)


def ros2(
    *ros: Annotated[str, Parameter(allow_leading_hyphen=True)],
    connect: Connect = None,
    print_launch: Annotated[bool, Flag] = False,
) -> int:
    """Bridge a run and ROS 2: ranges, odometry, frames, objects out; velocities, goals, arm, disarm, halt in.

    Parameters
    ----------
    ros
        Arguments of ROS, as --ros-args -r __ns:=/robot1 -p cmd_vel_timeout:=0.2
    print_launch
        Print a launch file for `ros2 launch` instead.

    Raises
    ------
    UserError
        ROS 2 is not installed, or an argument of it is wrong.
    """
    if print_launch:
        sys.stdout.write((files("runtime.bridges.ros2") / "echolocate_launch.txt").read_text("utf-8"))
        return DONE
    if find_spec("rclpy") is None:
        raise UserError(NO_ROS, FAILED)
    import asyncio

    from runtime.bridges.ros2.bridge import run_bridge

    asyncio.run(until_interrupted(run_bridge(console_finder(connect), ros)))
    return DONE


def console_finder(connect: str | None) -> Callable[[], str]:
    """Return a function that returns the start URL of the run: this one, or that of this machine's newest run.

    Runs beside the newest one are named on standard error.
    """
    if connect is None and (listed := list_consoles(state_folder())) is not None:
        sys.stderr.write(f"echolocate: {listed}\n")
    return lambda: find_console(state_folder(), connect)


async def until_interrupted(work: Coroutine[Any, Any, None]) -> None:
    """Do something until SIGINT or SIGTERM comes."""
    import asyncio

    task = asyncio.create_task(work)
    ending = dict.fromkeys((signal.SIGINT, signal.SIGTERM), task.cancel)
    with handled_by_loop(ending), contextlib.suppress(asyncio.CancelledError):
        await task
