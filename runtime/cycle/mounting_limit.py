"""The speed beside what stands ahead if the ring is mounted turned, until the motion has excluded that.

The ranges show how a ring is mounted only after some way (`perception.ring_faults.mounting`), and a robot whose ring
is turned may meet a wall before. So it drives as the worst of the mountings allows that are not yet excluded: the
echoes, turned about the ring's centre, limit the speed at which it comes nearer to them. The turn stays as it was
decided, so the curve becomes narrower: turning on the spot comes nearer to nothing, and a curve that is slowed down
as a whole would hold the robot beside what it should turn from. In free space nothing changes.
"""

from __future__ import annotations

import math
from typing import Final

from config.settings import Settings
from drivers.messages import Pose, Twist
from perception.ring_faults.monitor import RingMonitor
from runtime.cycle.unheard_limit import CREEP_M_S

MOUNTED: Final = (
    "the robot drives slowly for its first way beside what it hears, until the changes of the ranges show that the "
    "ring is mounted as the robot file says"
)
DOUBTED: Final = (
    "the ranges change as if the ring were mounted turned: the robot drives slowly until more of them decide it; if "
    "this lasts, check how the ring is mounted, its cables and the order of its sensors"
)
ARM_DOUBTED: Final = (
    "the ranges change as if the sensor looked elsewhere than its servo should turn it: the robot drives slowly "
    "until more of them decide it; if this lasts, check how its arm sits on the servo"
)


def limit_by_mounting(
    twist: Twist, why: str | None, pose: Pose, monitor: RingMonitor, settings: Settings
) -> tuple[Twist, str | None]:
    """Return a velocity with the same turn that is slow beside what may be ahead, and the reason if it is less.

    Parameters
    ----------
    twist, why
        What was decided on, and why it is slow, if it is.
    pose
        The robot's by its odometry.
    monitor
        Knows which mountings are excluded.
    settings
        The base's limits and the arbiter's clearance.
    """
    if abs(twist.v) <= CREEP_M_S:
        return twist, why
    if monitor.is_doubted:
        return Twist(math.copysign(CREEP_M_S, twist.v), twist.w), ARM_DOUBTED if settings.ring.has_servo else DOUBTED
    body, speed = settings.body, abs(twist.v)
    reach_m, brake_m_s2 = body.radius_m + settings.behaviors.arbiter.clearance_m, 2.0 * body.acceleration_max_m_s2
    way = pose.theta + (0.0 if twist.v > 0.0 else math.pi)
    c, s, limit = math.cos(way), math.sin(way), speed
    for x, y in monitor.possible_obstacles().tolist():
        dx, dy = x - pose.x, y - pose.y
        ahead, lateral, away = c * dx + s * dy, c * dy - s * dx, math.hypot(dx, dy)
        if ahead > 0.0:
            closing = math.sqrt(brake_m_s2 * max(0.0, away - reach_m))
            if abs(lateral) >= body.radius_m:  # it is passed
                closing = max(CREEP_M_S, closing)
            limit = min(limit, closing * away / ahead)
    if limit >= speed:
        return twist, why
    return Twist(math.copysign(max(CREEP_M_S, limit), twist.v), twist.w), MOUNTED
