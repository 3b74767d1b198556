"""The speed beside echoes that the ring has lost although it came nearer to them: they may still be there."""

from __future__ import annotations

import math
from typing import Final

from behaviors.surroundings.clearance import stoppable_speed_m_s
from config.settings import Settings
from drivers.messages import Pose, Twist
from perception.obstacle_echoes.unheard_echoes import UnheardEchoes
from perception.percept import Percept

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
    twist: Twist, percept: Percept, unheard: UnheardEchoes, settings: Settings
) -> tuple[Twist, str | None]:
    """Return a velocity on the same curve that is slow where it leads to what was lost, and the reason if it is less.

    Parameters
    ----------
    twist
        What the arbiter decided on.
    percept
        Of this cycle.
    unheard
        The echoes. Where the whole ring has heard nothing since, it is slow everywhere, as a wall goes on beside its
        last echo.
    settings
        The base's limits and the arbiter's clearance.
    """
    if abs(twist.v) <= CREEP_M_S or not len(points := unheard.points()):
        return twist, None
    limit, is_ring_silent = CREEP_M_S, unheard.is_ring_silent
    if not is_ring_silent:
        pose, arbiter = percept.pose, settings.behaviors.arbiter
        heading = pose.theta if twist.v > 0.0 else pose.theta + math.pi
        ahead = Percept(Pose(pose.x, pose.y, heading), points, percept.field_of_view)
        stoppable = stoppable_speed_m_s(ahead, settings.body, arbiter.clearance_m, arbiter.cautious_velocity_m_s)
        limit = max(CREEP_M_S, stoppable)
    slow = twist.at_most(limit)
    return slow, None if slow == twist else LOST if is_ring_silent else UNHEARD
