"""`echolocate ring-test`: each sensor by itself, and the motors."""

from __future__ import annotations

import sys
from typing import Annotated

from config.errors import WRONG_CALL, UserError
from runtime.cli.options import Count, Flag, RobotFile


def ring_test(
    port: str | None = None,
    /,
    *,
    robot: RobotFile = None,
    rounds: Count = 20,
    hand: Annotated[bool, Flag] = False,
    move: Annotated[bool, Flag] = False,
) -> int:
    """Fire each sensor of a robot by itself and report what it hears; with `--move`, try its motors.

    Sensors that hear each other are found by firing them as the robot file says, too. Exit status: 0 no fault
    found, 1 a fault, 3 no fault, but a sensor is not shown to hear: it heard nothing, or always the same; try again
    with `--hand`.

    Parameters
    ----------
    port
        Serial port of the robot; by default that of the robot file, or the only one of this computer.
    rounds
        How often each sensor fires.
    hand
        Ask for a hand before each sensor in turn: finds sensors whose wires are exchanged, a ring that is mounted
        turned, sensors that never hear an echo, and a servo that turns the wrong way or not at all.
    move
        Turn the wheels as well, for a second in each direction: put the robot on a block first.

    Raises
    ------
    UserError
        There is no robot, or it does not answer.
    """
    import asyncio

    from config.load import load_settings
    from runtime.cli.commands.robots.ring_trial import RingTest, only_port, with_single_firing

    if rounds < 1:
        raise UserError("--rounds: must be at least 1", WRONG_CALL)
    config = load_settings(None, (), robot=robot)
    link = config.link.model_copy(update={"port": port or config.link.port or only_port()})
    single = with_single_firing(config.model_copy(update={"link": link}))
    test = RingTest(single, sys.stdout.write, own=config.ring)
    return asyncio.run(test.run(rounds, move=move, hand=hand))
