"""`echolocate probe`: which robots answer on which ports and on the local network, without moving anything."""

from __future__ import annotations

from typing import Final

from rich.console import Console

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.files import list_shipped, one_line
from runtime.cli.commands.offline_io import plain_console
from runtime.cli.options import RobotFile

NETWORK_S: Final = 2.0
"""How long runs on the local network may take to answer, s."""


def probe(
    port: str | None = None,
    /,
    *,
    robot: RobotFile = None,
) -> int:
    """Find out which robots answer on which ports, without moving anything, and which run on the local network.

    Parameters
    ----------
    port
        Serial port, or socket://host:port; by default all serial ports of this computer and the local network.
    robot
        Try this robot, file or name of a shipped one, instead of all shipped ones.

    Raises
    ------
    UserError
        This computer has no serial port and no run is found, or the robot file is invalid.
    """
    import asyncio

    from serial.tools.list_ports import comports

    from config.load import load_robot
    from runtime.cli.commands.robots.port_probe import probe_port, run_it

    ports = [port] if port is not None else sorted(str(found.device) for found in comports())
    output = plain_console()
    is_found = port is None and robot is None and show_network(output)
    if not ports and is_found:
        return DONE
    if not ports:
        raise UserError(
            "this computer has no serial port: plug the robot in, or name a port, as in `echolocate probe "
            "socket://192.168.0.5:8101`",
            FAILED if robot is None else WRONG_CALL,
        )
    robots = {name: load_robot(name) for name in (list_shipped("robots") if robot is None else (robot,))}
    for each in ports:
        finding = asyncio.run(probe_port(each, robots))
        is_found |= finding.robot is not None
        run = () if finding.robot is None else (f"run it: {run_it(each, finding.robot)}",)
        for line in (f"{one_line(each)}:", *(f"  {line}" for line in (*finding.said, *run))):
            output.print(line)
    return DONE if is_found else FAILED


def show_network(output: Console) -> bool:
    """Print the runs on the local network; return whether there is one."""
    import asyncio

    from runtime.bridges.local_network import find_robots

    try:
        robots = asyncio.run(find_robots(NETWORK_S))
    except OSError as error:
        output.print(f"the local network cannot be searched: {error}")
        return False
    if robots:
        output.print("on the local network:")
    for one in robots:
        output.print(f"  {one_line(one.name)}, {one_line(one.mode)}: {one.url} (version {one_line(one.version)})")
    return bool(robots)
