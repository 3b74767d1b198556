"""Teleoperation as one of the schemas (Arkin 1991): the operator's velocity is one more vector.

A velocity includes standing still, turning on the spot and driving backwards, which a vector cannot express; so it
also goes to `behaviors.arbiter.limit_velocity`. It is valid for a short time only: the robot must not drive on after
the operator releases the stick or closes the page.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from behaviors.response import Response
from config.behaviors import TeleoperationConfig
from perception.percept import Percept

SCHEMA: Final = "teleoperation"


@dataclass(frozen=True, slots=True)
class Teleoperate:
    """A velocity that the operator requests: v forward in m/s, w counter-clockwise in rad/s."""

    v: float
    w: float
    valid_s: float = 0.25
    """How long it is valid, s; the settings limit this."""
    kind: Literal["teleoperate"] = "teleoperate"


TELEOPERATION_ENDED: Final = Teleoperate(0.0, 0.0)
"""Teleoperation has ended: the robot stops within one cycle."""


def teleoperation(percept: Percept, requested: Teleoperate, base_velocity_m_s: float) -> Response:
    """Return the operator's vector: along the heading or against it, length 1 for the base velocity.

    Parameters
    ----------
    percept
        Only the heading is used.
    requested
        The operator's velocity.
    base_velocity_m_s
        Speed for a vector of length 1, m/s.
    """
    magnitude = requested.v / base_velocity_m_s
    return Response(SCHEMA, magnitude * math.cos(percept.pose.theta), magnitude * math.sin(percept.pose.theta))


def is_expired(requested: Teleoperate, age_s: float, config: TeleoperationConfig) -> bool:
    """Return whether a velocity requested `age_s` ago is no longer valid.

    Parameters
    ----------
    requested
        The operator's velocity.
    age_s
        Its age at the time that counts, s: a cycle asks for that of the next one. Negative if the clock went
        back.
    config
        Its `message_age_max_s` limits the validity.
    """
    return not 0.0 <= age_s < min(requested.valid_s, config.message_age_max_s)


def blocked_by(percept: Percept, v: float, body_radius_m: float) -> str | None:
    """Return what is nearest on the way of an operator's velocity, and what to do; None if nothing is on that side.

    Parameters
    ----------
    percept
        Pose and obstacles of this cycle.
    v
        The operator's speed, m/s: its sign says to which side.
    body_radius_m
        The robot's edge is this far from its pose, m.
    """
    pose, sign, nearest = percept.pose, math.copysign(1.0, v), None
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    for number, (x, y) in enumerate(percept.obstacles.tolist()):
        dx, dy = x - pose.x, y - pose.y
        ahead, left = c * dx + s * dy, c * dy - s * dx
        if sign * ahead > 0.0:
            distance_m = math.hypot(dx, dy)
            # What lies to the side pushes less against the way.
            found = (distance_m * distance_m / abs(ahead), distance_m, math.degrees(math.atan2(left, ahead)), number)
            nearest = found if nearest is None else min(nearest, found)
    if nearest is None:
        return None
    _, distance_m, bearing_deg, number = nearest
    what = "a no-go line" if number >= len(percept.obstacles) - percept.no_go else "an obstacle"
    side, other = ("left" if bearing_deg >= 0.0 else "right"), ("back" if v > 0.0 else "forward")
    return (
        f"blocked by {what} {max(0.0, distance_m - body_radius_m):.2f} m from the robot's edge, "
        f"{abs(bearing_deg):.0f}° {side} of its front: turn away, or drive {other}"
    )
