"""The arbiter: adds the schemas' vectors and answers with a velocity the base can drive, or with a reason to stop.

Most schemas ask for a direction (`arbitrate`); an operator's hand asks for a velocity (`limit_velocity`), which the echoes
only ever take from. A decision that lacks a part is a stop, never a guess: what comes out is either within every
limit or no velocity.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from behaviors.clearance import stoppable_speed_m_s
from behaviors.response import Response
from config.robot import BodyConfig
from config.settings import ArbiterConfig
from perception.percept import Percept, Twist, wrap_angle

NEGLIGIBLE: Final = 0.01
"""A sum below this is no drive_request to move: schemas in balance leave a residue whose direction is noise."""

CAUTIOUS_ANGLE_RAD: Final = math.pi / 4.0
"""Off course by this much the robot goes at its cautious velocity; off by twice this it turns on the spot."""


@dataclass(frozen=True, slots=True)
class Drive:
    """Drive at this velocity."""

    twist: Twist


@dataclass(frozen=True, slots=True)
class Stop:
    """Stop, for this reason; a text for the operator."""

    reason: str


Decision: TypeAlias = Drive | Stop


def arbitrate(
    responses: Sequence[Response],
    percept: Percept,
    body: BodyConfig,
    config: ArbiterConfig,
    expected: Sequence[str],
) -> Decision:
    """Return the velocity for the sum of all responses, or why there is none.

    The sum's magnitude is clamped to 1; the speed is the base velocity times it, less the more the robot has to
    turn, and never more than it can stop from before the nearest echo ahead. The base limits its acceleration
    itself.

    Parameters
    ----------
    responses
        One of each schema, in any order.
    percept
        Pose and obstacles of this cycle.
    body
        Limits of the base.
    config
        Velocities and turning gain.
    expected
        Names of the schemas that must have answered.

    Returns
    -------
    Decision
        `Drive` with 0 ≤ v ≤ `speed_max_m_s` and abs(w) ≤ `turn_max_rad_s`, both finite; or `Stop`.
    """
    complaint = _complaint(responses, percept, expected)
    if complaint is not None:
        return Stop(complaint)
    x, y = sum(r.x for r in responses), sum(r.y for r in responses)
    magnitude = min(1.0, math.hypot(x, y))
    if magnitude < NEGLIGIBLE:
        return Drive(Twist(0.0, 0.0))
    angle = wrap_angle(math.atan2(y, x) - percept.pose.theta)
    speed = magnitude * _course_speed_m_s(abs(angle), config)
    v = min(speed, body.speed_max_m_s, stoppable_speed_m_s(percept, body, config.clearance_m))
    w = max(-body.turn_max_rad_s, min(body.turn_max_rad_s, config.turn_gain_per_s * angle))
    # Not `v > limit or …`: only this form also refuses NaN.
    if not (0.0 <= v <= body.speed_max_m_s and abs(w) <= body.turn_max_rad_s):
        return _outside(v, w)
    return Drive(Twist(v, w))


def limit_velocity(
    asked: Twist,
    responses: Sequence[Response],
    percept: Percept,
    body: BodyConfig,
    config: ArbiterConfig,
    expected: Sequence[str],
) -> Decision:
    """Return what may be driven of a velocity that is asked for, or why nothing may.

    The vectors of the schemas, the asker's own among them, are added and seen from the robot. What lies along the
    heading holds the speed to less than asked for, down to a standstill and never into going the other way; what lies
    across steers a robot that goes forward, the more the faster it goes. Forward or back it is never faster than what
    it can stop from before the nearest echo that way. One that only turns is left to turn: it needs no room.

    Parameters
    ----------
    asked
        The velocity; its v divided by the base velocity is the asker's vector along the heading.
    responses, percept, body, config, expected
        As for `arbitrate`.

    Returns
    -------
    Decision
        `Drive` with abs(v) ≤ `speed_max_m_s` and abs(w) ≤ `turn_max_rad_s`, both finite; or `Stop`.
    """
    complaint = _complaint(responses, percept, expected)
    if complaint is not None:
        return Stop(complaint)
    if not (_is_finite(asked.v) and _is_finite(asked.w)):
        return Stop(f"the velocity asked for ({_shown(asked.v)}, {_shown(asked.w)}) is none: look at who asks for it")
    c, s = math.cos(percept.pose.theta), math.sin(percept.pose.theta)
    x, y = sum(r.x for r in responses), sum(r.y for r in responses)
    along = config.base_velocity_m_s * (c * x + s * y)
    aside = max(-1.0, min(1.0, c * y - s * x))
    w = asked.w
    if asked.v > 0.0:
        fastest = min(asked.v, body.speed_max_m_s, stoppable_speed_m_s(percept, body, config.clearance_m))
        v = max(0.0, min(along, fastest))
        w += config.turn_gain_per_s * aside * v / config.base_velocity_m_s
    else:
        pose = replace(percept.pose, theta=percept.pose.theta + math.pi)
        behind = stoppable_speed_m_s(replace(percept, pose=pose), body, config.clearance_m)
        v = min(0.0, max(along, asked.v, -body.speed_max_m_s, -behind))
    w = max(-body.turn_max_rad_s, min(body.turn_max_rad_s, w))
    if not (abs(v) <= body.speed_max_m_s and abs(w) <= body.turn_max_rad_s):
        return _outside(v, w)
    return Drive(Twist(v, w))


def _outside(v: float, w: float) -> Stop:
    return Stop(
        f"the arbiter worked out a velocity outside the base's limits (v {v:g} m/s, w {w:g} rad/s), "
        "which is a fault of this program: keep the recording of this run and report it"
    )


def _course_speed_m_s(angle_rad: float, config: ArbiterConfig) -> float:
    """Return base velocity on course, falling linearly to the cautious one and on to zero at a right angle."""
    cautious = min(config.cautious_velocity_m_s, config.base_velocity_m_s)
    if angle_rad < CAUTIOUS_ANGLE_RAD:
        share = angle_rad / CAUTIOUS_ANGLE_RAD
        return (1.0 - share) * config.base_velocity_m_s + share * cautious
    return max(0.0, 2.0 - angle_rad / CAUTIOUS_ANGLE_RAD) * cautious


def _complaint(responses: Sequence[Response], percept: Percept, expected: Sequence[str]) -> str | None:
    """Return why these inputs allow no decision, None where they do."""
    given = [r.schema for r in responses]
    if sorted(given) != sorted(expected):
        return _roll_call(Counter(given), Counter(expected))
    for r in responses:
        if not (_is_finite(r.x) and _is_finite(r.y)):
            return (
                f"the schema {r.schema} answered ({_shown(r.x)}, {_shown(r.y)}), which is no vector: "
                "look for an axis left out, or for an echo or a pose that is not a number"
            )
    if not (math.isfinite(sum(r.x for r in responses)) and math.isfinite(sum(r.y for r in responses))):
        return "the schemas' vectors are too large to add: look for a gain or a pose that is out of all proportion"
    pose = percept.pose
    if not all(map(math.isfinite, (pose.x, pose.y, pose.theta))):
        return f"the pose ({pose.x:g}, {pose.y:g}, {pose.theta:g}) is not a place: check the odometry, then re-arm"
    if not np.isfinite(percept.obstacles).all():
        return "an echo is not a finite point: check the ring's ranges and the odometry, then re-arm"
    return None


def _roll_call(given: Counter[str], expected: Counter[str]) -> str:
    """Return who is missing, or else who is there without being asked."""
    if missing := sorted(expected - given):
        return f"no answer from the schema {', '.join(missing)}: the decision lacks a part, so the robot stops"
    surplus = ", ".join(sorted(given - expected))
    return f"the schema {surplus} answered without being asked: its vector belongs to no decision"


def _is_finite(value: float) -> bool:
    """Say whether a component is a finite number; schemas are other people's code, and one may leave an axis out."""
    try:
        return math.isfinite(value)
    except (TypeError, OverflowError):  # no number at all, or a whole one beyond any float
        return False


def _shown(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else repr(value)[:20]
