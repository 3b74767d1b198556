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
        Time since it arrived, s; negative if the clock went back.
    config
        Its `message_age_max_s` limits the validity.
    """
    return not 0.0 <= age_s < min(requested.valid_s, config.message_age_max_s)
