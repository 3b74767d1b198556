"""Teleoperation as a schema among others (Arkin 1991): the operator's hand on the stick is one more vector.

What the operator asks for is a velocity, and standing still, turning on the spot and backing are part of it, which
no vector can say; so the velocity goes to `behaviors.arbiter.limit_velocity` beside the vector. It holds for a moment only: a
hand that has left the stick, or a page that was closed, must not drive on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from behaviors.response import Response
from config.settings import TeleoperationConfig
from perception.percept import Percept

SCHEMA: Final = "teleoperation"


@dataclass(frozen=True, slots=True)
class Teleoperate:
    """A velocity that the operator's hand asks for: v forward in m/s, w counter-clockwise in rad/s."""

    v: float
    w: float
    valid_s: float = 0.25
    """For how long, s; never longer than the settings allow."""
    kind: Literal["teleoperate"] = "teleoperate"


TELEOPERATION_ENDED: Final = Teleoperate(0.0, 0.0)
"""Nobody's hand is on the stick: the robot stands."""


def teleoperation(percept: Percept, asked: Teleoperate, base_velocity_m_s: float) -> Response:
    """Return the operator's vector: along the heading, or against it, magnitude 1 for the base velocity."""
    magnitude = asked.v / base_velocity_m_s
    return Response(SCHEMA, magnitude * math.cos(percept.pose.theta), magnitude * math.sin(percept.pose.theta))


def is_expired(asked: Teleoperate, age_s: float, config: TeleoperationConfig) -> bool:
    """Say whether a velocity asked for `age_s` ago holds no longer."""
    return not 0.0 <= age_s < min(asked.valid_s, config.message_age_max_s)
