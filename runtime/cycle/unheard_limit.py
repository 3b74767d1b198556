"""The speed beside echoes that the ring has lost, or that its sensors heard elsewhere, and before its first echo."""

from __future__ import annotations

import math
from typing import Final

from behaviors.surroundings.clearance import stoppable_speed_m_s
from behaviors.teleoperation import Teleoperate
from config.robot import PASSAGE_M
from config.settings import Settings
from drivers.messages import Pose, Twist
from perception.obstacle_echoes.remembered_echoes import REMEMBERED_S
from perception.obstacle_echoes.unheard_echoes import UnheardEchoes
from perception.percept import Percept
from runtime.cycle.drive_requests import DriveRequest

CREEP_M_S: Final = 0.04
"""Speed that is always left, m/s: most of what falls silent is a mirror that left the beam, and a bumper bears it."""
LOST_AHEAD_M: Final = 0.4
"""A ring that hears nothing nearer than this to the clearance before what it heard must have failed, m."""
LOST: Final = (
    "the ring hears nothing new, not even what it heard a moment ago: the robot drives slowly until it does; beside "
    "smooth walls that is so for moments, but if it lasts, check the ring's power and cables"
)
UNHEARD: Final = (
    "the ring no longer hears what stood in the way, although the robot has come nearer: the robot drives slowly "
    "until the ring hears it again, or something behind it; if this returns, check that the ring hears what is near"
)
REMEMBERED: Final = (
    f"something was heard ahead in the last {REMEMBERED_S:.0f} s, and hardly anything since by the sensors that look "
    f"there now: the robot drives slowly there until one of them hears again, twice, and then nothing there, or "
    f"something behind it, at most so long; if this returns, check that they hear (`echolocate ring-test`)"
)


def lost_ahead(
    unheard: UnheardEchoes, pose: Pose, has_unknown: bool, request: DriveRequest, settings: Settings
) -> str | None:
    """Return why the robot must stop before what a silent ring heard last; None if it need not.

    One that is about to look to its blind sides stands and does that first: few sensors often hear nothing.

    Parameters
    ----------
    unheard
        The echoes.
    pose
        The robot's, in odometry's frame.
    has_unknown
        Whether there are directions of which nothing is known.
    request
        What is driven; by teleoperation the robot does not look round by itself.
    settings
        The base and the arbiter's clearance.
    """
    if has_unknown and not (settings.body.synchro or isinstance(request, Teleoperate)):
        return None
    clear_m = settings.body.radius_m + settings.behaviors.arbiter.clearance_m
    lost_m = unheard.take_ahead(pose, clear_m + LOST_AHEAD_M, clear_m)
    if lost_m is None:
        return None
    return (
        f"the ring hears nothing any more, not even what stood {lost_m:.1f} m ahead: unless that is gone, check the "
        f"ring's power and cables, then re-arm"
    )


def limit_unheard(
    twist: Twist, percept: Percept, unheard: UnheardEchoes, settings: Settings, slow_reason: str | None
) -> tuple[Twist, str | None]:
    """Return a velocity on the same curve that is slow where it leads to what was lost, and the reason if it is less.

    So it is at what is remembered, where a wall goes on that the ring heard before it heard nothing, and everywhere
    for a reason that `EchoWatch` gives, which is also given while the robot turns.

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
    slow_reason
        As of `EchoWatch`.
    """
    if abs(twist.v) <= CREEP_M_S:
        return twist, slow_reason if twist.w else None
    if slow_reason is not None or unheard.is_ring_silent:
        limit, reason = CREEP_M_S, slow_reason or LOST
    else:
        pose = percept.pose if twist.v > 0.0 else percept.pose.compose(Pose(0.0, 0.0, math.pi))
        limit, reason = _limit_ahead(pose, percept, unheard, settings)
    slow = twist.at_most(max(CREEP_M_S, limit))
    return slow, None if slow == twist else reason


def _limit_ahead(pose: Pose, percept: Percept, unheard: UnheardEchoes, settings: Settings) -> tuple[float, str]:
    """Return the speed from which a robot stops before what was lost or is remembered ahead, m/s, and why."""
    body, arbiter = settings.body, settings.behaviors.arbiter
    to_wall_m = unheard.presumed_way_m(pose, body.radius_m + PASSAGE_M)
    limits = [(math.sqrt(2.0 * body.acceleration_max_m_s2 * to_wall_m), LOST)]
    remembered = unheard.remembered.ahead(pose, body.radius_m + arbiter.clearance_m)
    for places, reason in ((unheard.points(), UNHEARD), (remembered, REMEMBERED)):
        if len(places):
            ahead = Percept(pose, places, percept.field_of_view)
            speed = stoppable_speed_m_s(ahead, body, arbiter.clearance_m, arbiter.cautious_velocity_m_s)
            limits.append((speed, reason))
    return min(limits)
