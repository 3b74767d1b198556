"""Messages about a line whose other end is a program: it has no cable, no power switch and no emergency switch.

Drivers write their messages for a robot: what happened; likely cause: next action. What happened is true of an
emulated robot too. Cause and action are not where they name hardware, and are replaced here by the program's.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

from behaviors.arbiter import Unseen
from config.robot import RingConfig
from drivers.driver import LineState
from drivers.firing_pattern import firing_pattern

HARDWARE: Final = re.compile(r"\b(cable|power|plug|plugged|unplugged|restart the robot|emergency switch)\b")
"""What the other end lacks if it is a program."""

EXCESS: Final = re.compile(r"\b(many|more|corrupt)\b")
"""What a program that is stopped or late does not cause."""

PSEUDO_TERMINALS: Final = "/dev/pts/"

FIRST_LOOK_PATTERNS: Final = 2.0
"""How often the firing pattern may go round until the ring has looked ahead: each sensor fires once in a round, and
its echo arrives during the next."""
FIRST_LOOK: Final = "the ring has only just started to fire: the robot stands until all sensors have looked ahead"


class LineMessages(Protocol):
    """Words messages about the line of a run."""

    def message(self, text: str) -> str:
        """Return a driver's or a line's message with the cause and the action that fit."""

    def problem(self, state: LineState, text: str | None) -> str | None:
        """Return why the line is not ready, None where nothing is known; `text` is the driver's reason."""


class RobotLine:
    """Leaves messages about the line to a robot as the driver has them."""

    def message(self, text: str) -> str:
        """Return the message as it is."""
        return text

    def problem(self, _state: LineState, text: str | None) -> str | None:
        """Return the driver's reason as it is."""
        return text


ROBOT_LINE: Final = RobotLine()


@dataclass(frozen=True, slots=True)
class ProgramLine:
    """Words messages about a line to a program.

    Parameters
    ----------
    program : str
        What it is, as a user knows it.
    action : str
        What to do if it has ended.
    has_ended : callable
        Returns whether it is known to have ended.
    """

    program: str
    action: str
    has_ended: Callable[[], bool] = lambda: False

    def message(self, text: str) -> str:
        """Return the message; where it names hardware, cause and action are the program's."""
        what, _, rest = text.partition("; ")
        if not HARDWARE.search(rest):
            return text
        if EXCESS.search(what) and not self.has_ended():
            return f"{what}; {self.program} is faulty, or its faults file asks for this: {self.action}"
        return f"{what}; {self._cause(is_closed=False)}"

    def problem(self, state: LineState, text: str | None) -> str | None:
        """Return why the line is not ready."""
        if state is LineState.CLOSED and (text is None or HARDWARE.search(text)):
            return f"the line to {self.program} is closed; {self._cause(is_closed=True)}"
        return None if text is None else self.message(text)

    def _cause(self, *, is_closed: bool) -> str:
        """Return the likely cause of trouble on the line to a program, and the next action."""
        if self.has_ended():
            return f"{self.program} has ended: {self.action}"
        if is_closed:
            return f"{self.program} has ended, or its faults file cuts the line: {self.action} if it does not return"
        return (
            f"{self.program} is stopped or late, likely because the machine is overloaded, or its faults file asks "
            f"for this: end other programs, then re-arm"
        )


def messages_on(port: str | None) -> LineMessages:
    """Return what words messages about the line at a port; behind a pseudo-terminal is a program, as an emulator."""
    if port is None or not os.path.realpath(port).startswith(PSEUDO_TERMINALS):
        return ROBOT_LINE
    return ProgramLine(f"the program at the other end of {port}", "start it again")


def blind_reason(blind_s: float, line_problem: str | None, *, fires: bool) -> str:
    """Return why the robot stops that has heard nothing usable for `blind_s` seconds."""
    likely = line_problem or "check the ring's power and cable"
    if not fires:
        return f"the ring has not reported for {blind_s:.1f} s: {likely}, then re-arm"
    return (
        f"the ring fires, but no sensor has given a usable range for {blind_s:.1f} s, as all are masked or "
        f"report faults: {likely}, then re-arm"
    )


def unseen_reason(unseen: Unseen, fired_s: float, ring: RingConfig) -> str:
    """Return why the robot stands that does not see its way; one that has just started needs time, and no check.

    Parameters
    ----------
    unseen
        The arbiter's decision.
    fired_s
        Time since the ring's first firing on this line, s.
    ring
        The robot's.
    """
    is_new = unseen.sensors and math.isinf(unseen.age_s)
    if is_new and fired_s <= FIRST_LOOK_PATTERNS * firing_pattern(ring).cycle_s:
        return FIRST_LOOK
    return unseen.reason
