"""What a robot can do beside driving and measuring, and what follows for its safety where it cannot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from config.robot import BodyConfig
from drivers.base_model import stop_s
from drivers.messages import Twist

CAPABILITIES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "deadman": "it has no deadman of its own, so only this program stops it: after kill -9, or with its cable "
        "unplugged, it drives on until it is switched off",
        "latch": "it does not hold a halt by itself, so any other program that sends it velocities moves it",
        "bumper": "it reports no contact: what the sonar does not hear is driven against until the odometry stands",
        "stop_button": "it does not report its stop button: pressed, the base counts as blocked, and nothing holds "
        "it once it is pulled out again",
        "motor_fault": "it reports no motor fault: a failed motor is found by the odometry only, after a second",
        "battery": "it does not report a low battery: watch its voltage yourself",
        "checksum": "its line has no checksum: noise can pass as a range or as a pose",
        "stamps": "its measurements have no times of its own: they count as of their arrival, and while the line is "
        "late the echoes are drawn and avoided where the robot is by then",
        "acknowledgement": "it does not show which command it obeys: one that no longer receives is found by its "
        "motion only",
        "restart": "it does not show a restart: its odometry begins again at zero as a jump",
        "pattern": "its firing pattern cannot be changed while it runs",
    }
)
"""Every capability, with what follows from its absence."""


def missing(has: Iterable[str]) -> dict[str, str]:
    """Return what a robot lacks that has what its family lists in `HAS`, with what follows.

    Raises
    ------
    ValueError
        One of them is no capability.
    """
    named = set(has)
    if unknown := sorted(named - CAPABILITIES.keys()):
        raise ValueError(f"no capability: {', '.join(unknown)}; there are {', '.join(CAPABILITIES)}")
    return {name: text for name, text in CAPABILITIES.items() if name not in named}


class MovesOn(NamedTuple):
    """How far a base at full speed moves after the last command, in the worst case that its robot file allows."""

    deadman_s: float
    """Until it begins to stop by itself, s."""
    brakes_s: float
    """From there to standstill, s."""
    way_m: float

    @property
    def lasts_s(self) -> float:
        """From the last command to standstill, s."""
        return self.deadman_s + self.brakes_s


def moves_on(body: BodyConfig, deadman_s: float | None) -> MovesOn | None:
    """Return how far a base moves after `kill -9`; None if it never stops by itself.

    Without a command the base begins to stop after `deadman_s`; None if it never does.
    """
    if deadman_s is None:
        return None
    v, brakes_s = body.speed_max_m_s, stop_s(Twist(body.speed_max_m_s, body.turn_max_rad_s), body)
    return MovesOn(deadman_s, brakes_s, v * deadman_s + 0.5 * v * v / body.acceleration_max_m_s2)


def after_kill(body: BodyConfig, deadman_s: float | None) -> str:
    """Return what `kill -9` of this program, or an unplugged cable, means for a base; arguments as of `moves_on`."""
    found = moves_on(body, deadman_s)
    if found is None:
        return "kill -9 leaves it moving until it is switched off: it has no deadman of its own"
    return (
        f"kill -9 leaves it moving for at most {found.lasts_s:.2f} s and {found.way_m:.2f} m, from "
        f"{body.speed_max_m_s:g} m/s: its deadman ends after {found.deadman_s:g} s, and it brakes for "
        f"{found.brakes_s:.2f} s"
    )
