"""The commands that are clients of runs: `fleet`, `ros2`, `ros2-robot`, `foxglove`."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from runtime.cli.options import Count, Flag, Force

Connect = Annotated[
    str | None,
    Parameter(help="URL of the run, on another machine with its token; by default the newest run here."),
]


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
    """
    from runtime.cli.commands.ros2 import bridge_ros2, print_launch_file

    return print_launch_file() if print_launch else bridge_ros2(connect, ros)


def ros2_robot_command(
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
    """
    from runtime.cli.commands.ros2_robot import write_robot_file

    return write_robot_file(out, radius_m=radius, speed_m_s=speed, turn_rad_s=turn, seconds=seconds, force=force)


def fleet(
    *urls: str,
    host: str = "127.0.0.1",
    port: Count = 8764,
) -> int:
    """Serve one page for several runs: mode, battery and place of each, HALT for one and for all.

    Runs of this machine appear by themselves.

    Parameters
    ----------
    urls
        Start URLs of runs on other machines, with their tokens.
    host
        Address to listen on; the page has a token of its own.
    port
        TCP port; 0 takes any that is free.
    """
    from runtime.cli.commands.fleet import serve_fleet_page

    return serve_fleet_page(urls, host, port)


def foxglove(
    *,
    connect: Connect = None,
    host: str = "127.0.0.1",
    port: Count = 8766,
    allow_set: Annotated[bool, Flag] = False,
    print_layout: Annotated[bool, Flag] = False,
) -> int:
    """Serve a live run to Foxglove, with the topics of `export --to foxglove`.

    Parameters
    ----------
    host
        Address to listen on. Foxglove's protocol has no token: any program that reaches this port sees the run.
    port
        TCP port.
    allow_set
        Let Foxglove change settings of the run.
    print_layout
        Print a layout to import into Foxglove instead.
    """
    from runtime.cli.commands.foxglove import serve_live, write_layout

    return write_layout() if print_layout else serve_live(connect, host, port, allow_set=allow_set)
