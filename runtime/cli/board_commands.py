"""The commands that find a robot and try it: `probe`, `firmware` and `ring-test`."""

from __future__ import annotations

from typing import Annotated, Literal

from runtime.cli.options import Count, Flag, Force, RobotFile


def firmware(*, board: Literal["pico", "esp32"], out: str, force: Force = False) -> int:
    """Write the firmware of a ring and base that anybody can build, and the robot file that matches it.

    Pins and geometry are in robot_config.py. One that is in the folder already is kept: edit it and call this again.

    Parameters
    ----------
    board
        Raspberry Pi Pico (RP2040), or ESP32; both with MicroPython.
    out
        Folder for the files.
    force
        Overwrite files that were changed there, robot_config.py excepted.
    """
    from runtime.cli.commands.firmware import write_firmware

    return write_firmware(board, out, force=force)


def ring_test_command(
    port: str | None = None,
    /,
    *,
    robot: RobotFile = None,
    rounds: Count = 20,
    move: Annotated[bool, Flag] = False,
) -> int:
    """Fire each sensor of a robot by itself and report what it hears; with `--move`, try its motors.

    Parameters
    ----------
    port
        Serial port of the robot; by default that of the robot file, or the only one of this computer.
    rounds
        How often each sensor fires.
    move
        Turn the wheels as well, for a second in each direction: put the robot on a block first.
    """
    from runtime.cli.commands.ring_test import check_ring

    return check_ring(port, robot=robot, rounds=rounds, move=move)


def probe_command(
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
    """
    from runtime.cli.commands.probe import probe

    return probe(port, robot=robot)
