"""The speed beside echoes that the ring has lost although it came nearer to them: they may still be there."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from behaviors.surroundings.clearance import stoppable_speed_m_s
from config.settings import Settings
from drivers.messages import Twist
from perception.percept import Floats, Percept

CREEP_M_S: Final = 0.04
"""Speed that is always left, m/s: most of what falls silent is a mirror that left the beam, and a bumper bears it."""
LOST: Final = (
    "the ring hears nothing new any more, not even what it heard a moment ago: the robot drives slowly until it "
    "hears something; check the ring's power and cables"
)
UNHEARD: Final = (
    "the ring no longer hears what stood in the way, although the robot has come nearer: the robot drives slowly "
    "until the ring hears it again, or something behind it; if this returns, check that the ring hears what is near"
)


def limit_unheard(
    twist: Twist, percept: Percept, unheard: Floats, settings: Settings, *, is_ring_silent: bool
) -> tuple[Twist, str | None]:
    """Return a velocity on the same curve that is slow where it leads to what was lost, and the reason if it is less.

    Parameters
    ----------
    twist
        What the arbiter decided on.
    percept
        Of this cycle.
    unheard
        Places of the echoes, m.
    settings
        The base's limits and the arbiter's clearance.
    is_ring_silent
        Whether the ring has heard nothing since; then it is slow everywhere, as a wall goes on beside its last echo.
    """
    if abs(twist.v) <= CREEP_M_S or not len(unheard):
        return twist, None
    limit = CREEP_M_S
    if not is_ring_silent:
        pose, arbiter = percept.pose, settings.behaviors.arbiter
        heading = pose.theta if twist.v > 0.0 else pose.theta + math.pi
        ahead = replace(percept, pose=replace(pose, theta=heading), obstacles=unheard)
        stoppable = stoppable_speed_m_s(ahead, settings.body, arbiter.clearance_m, arbiter.cautious_velocity_m_s)
        limit = max(CREEP_M_S, stoppable)
    slow = twist.at_most(limit)
    return slow, None if slow == twist else LOST if is_ring_silent else UNHEARD
