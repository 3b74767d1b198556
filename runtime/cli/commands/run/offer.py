"""The offer of `echolocate run` without a port: the robot that is plugged in, instead of the emulated one."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path
from typing import NamedTuple, TextIO

from rich.console import Console

from config.files import list_shipped, one_line
from config.load import load_robot
from config.robot import RobotConfig


class Offered(NamedTuple):
    """A robot that is plugged in."""

    port: str
    robot: str | None
    """The name of its robot file; None if it is the robot of the run."""


def plugged_in() -> list[str]:
    """Return the serial ports of USB devices, each of which may be a robot; after a restart none: it asks nothing."""
    from serial.tools.list_ports import comports

    from runtime.support.restart import is_restart

    return [] if is_restart() else sorted(one_line(found.device) for found in comports() if found.vid is not None)


def ask_for_robot(ports: list[str], chosen: RobotConfig | None, console: Console, answers: TextIO) -> Offered | None:
    """Look for robots on ports, ask whether to run the only one, and return it; None to go on with the emulator.

    Nothing moves, and a port that another program has open is left alone: its robot may be driving. Several robots
    are listed with their commands.

    Parameters
    ----------
    ports
        The ports, as `plugged_in` returns them.
    chosen
        The robot of the run file or the command line, the only one to look for; None for all shipped ones.
    console
        Where the question is printed.
    answers
        Where the answer is read.
    """
    from runtime.cli.commands.robots.port_probe import probe_port, run_it

    own = "this run's robot"
    robots = {own: chosen} if chosen is not None else {name: load_robot(name) for name in list_shipped("robots")}
    found = list[tuple[str, str, str]]()
    for port in ports:
        if _is_open_elsewhere(port):
            console.print(f"{port} is in use by another program: not looked at")
            continue
        console.print(f"looking for a robot on {port}; nothing moves")
        finding = asyncio.run(probe_port(port, robots))
        if finding.robot is not None:
            found.append((port, finding.robot, finding.said[0]))
    for port, name, text in found:
        command = run_it(port, name) if chosen is None else f"the same command with --port {port}"
        console.print(f"{port}: {text}; run it: {command}")
    if len(found) != 1:
        return None
    ((port, name, _),) = found
    console.print("run this robot now? It stands until it is armed; otherwise an emulated robot runs. [y/N] ", end="")
    if answers.readline().strip().lower() not in {"y", "yes"}:
        return None
    return Offered(port, name if chosen is None else None)


def _is_open_elsewhere(port: str) -> bool:
    """Return whether another program of this user has a port open; where there is no /proc, that is not known."""
    device, own = Path(port).resolve(), str(os.getpid())
    others = [process for process in Path("/proc").glob("[0-9]*") if process.name != own]
    return any(device in _open_files(process) for process in others)


def _open_files(process: Path) -> set[Path]:
    try:
        return {_target(descriptor) for descriptor in (process / "fd").iterdir()}
    except OSError:  # it has just ended, or is another user's
        return set()


def _target(descriptor: Path) -> Path:
    try:
        return descriptor.readlink()
    except OSError:  # it has just been closed
        return descriptor
