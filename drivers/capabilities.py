"""What a robot can do beside driving and measuring, and what follows for its safety where it cannot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final

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
    """Return what a robot lacks, with what follows.

    Parameters
    ----------
    has
        What it has, as a driver's family lists it in `HAS`.

    Raises
    ------
    ValueError
        One of them is no capability.
    """
    named = set(has)
    if unknown := sorted(named - CAPABILITIES.keys()):
        raise ValueError(f"no capability: {', '.join(unknown)}; there are {', '.join(CAPABILITIES)}")
    return {name: text for name, text in CAPABILITIES.items() if name not in named}
