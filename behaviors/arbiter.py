"""The arbiter: sums the schemas' vectors and returns a velocity within the base's limits, or a reason to stop.

Most schemas request a direction (`arbitrate`). Teleoperation requests a velocity (`limit_velocity`), which echoes can
only reduce. With incomplete or invalid inputs the decision is to stop. Neither moves the robot towards a direction in
which the ring has not looked (`behaviors.surroundings.field_of_view`), and neither chatters
(`behaviors.memory.commitment`).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

from behaviors.memory.commitment import Commitment
from behaviors.response import Response, summed
from behaviors.surroundings.clearance import stoppable_speed_m_s
from behaviors.surroundings.field_of_view import (
    UnseenWay,
    angle_to_look,
    presumed_ahead_rad,
    seen_speed_m_s,
    unseen_way,
)
from config.behaviors import ArbiterConfig
from config.robot import BodyConfig
from perception.percept import Percept, Twist, wrap_angle

NEGLIGIBLE: Final = 0.01
"""Least length of the sum that moves the robot; the direction of a shorter one is rounding noise. Chosen for this
program, as are the angle and speeds below."""

CAUTIOUS_ANGLE_RAD: Final = math.pi / 4.0
"""Angle off course at which the robot drives at its cautious velocity; from twice this on it turns on the spot."""


@dataclass(frozen=True, slots=True)
class Drive:
    """Drive at this velocity."""

    twist: Twist


@dataclass(frozen=True, slots=True)
class Stop:
    """Stop; the reason is a text for the operator."""

    reason: str


@dataclass(frozen=True, slots=True)
class Unseen(Stop):
    """Stop: the sensors have looked neither along the heading nor in the direction of the sum lately."""

    age_s: float
    """How long they have not, s; infinite if they never have."""
    sensors: tuple[int, ...] = ()
    """Those that should look there; empty if none does."""


Decision: TypeAlias = Drive | Stop


def arbitrate(
    responses: Sequence[Response],
    percept: Percept,
    body: BodyConfig,
    config: ArbiterConfig,
    expected: Sequence[str],
    turn_rad_s: tuple[float, float] = (-math.inf, math.inf),
    commitment: Commitment | None = None,
    run_s: float | None = None,
) -> Decision:
    """Return the velocity for the sum of all responses, or a reason to stop.

    The sum's length is clamped to 1. The speed is the base velocity times that length, reduced while the robot has to
    turn, and limited to what it can stop from before the nearest echo ahead, and before what it has seen ahead is too
    old. The base limits its own acceleration. A robot that does not see along its heading turns on the spot to a
    direction in which it does. One that knows nothing of a blind side of its course turns there first.

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
        Names of the schemas that must have responded.
    turn_rad_s
        The least and the greatest turning rate, rad/s; the base's limits hold as well.
    commitment
        Of the command before, if any: the side to which the robot turns.
    run_s
        Now, by the run's clock, s, where a turn to the other side waits a while; None where it does not.

    Returns
    -------
    Decision
        `Drive` with 0 ≤ v ≤ `speed_max_m_s` and abs(w) ≤ `turn_max_rad_s` of the body, both finite; or `Stop`.
    """
    error = _input_error(responses, percept, expected)
    if error is not None:
        return Stop(error)
    x, y = summed(responses)
    magnitude = min(1.0, math.hypot(x, y))
    if magnitude < NEGLIGIBLE:
        return Drive(Twist(0.0, 0.0))
    course = math.atan2(y, x)
    angle = wrap_angle(course - percept.pose.theta)
    look = None
    if not body.synchro:
        look = angle_to_look(percept, course, presumed_ahead_rad(percept, body, config.clearance_m))
    if look is not None:
        return Drive(Twist(0.0, max(-body.turn_max_rad_s, min(body.turn_max_rad_s, config.turn_gain_per_s * look))))
    speed = magnitude * _course_speed_m_s(abs(angle), config)
    w = config.turn_gain_per_s * (angle if commitment is None else commitment.kept_angle(angle, run_s))
    w = max(turn_rad_s[0], min(turn_rad_s[1], w))
    w = max(-body.turn_max_rad_s, min(body.turn_max_rad_s, w))
    seen = seen_speed_m_s(percept, body, config.clearance_m, w)
    if seen == 0.0 and (unseen := _unseen_ways(percept, course, body, config)) is not None:
        cables, mounting = "check the ring's cables and what covers it", "mount sensors whose beams cover the way"
        remedy = cables if unseen.sensors else mounting
        return Unseen(f"{unseen.reason}; {remedy}, then re-arm", unseen.age_s, unseen.sensors)
    stoppable = stoppable_speed_m_s(percept, body, config.clearance_m, config.cautious_velocity_m_s)
    v = min(speed, body.speed_max_m_s, stoppable, seen)
    # Not `v > limit or …`: only this form also refuses NaN.
    if not (0.0 <= v <= body.speed_max_m_s and abs(w) <= body.turn_max_rad_s):
        return _outside(v, w)
    return Drive(Twist(v, w))


def limit_velocity(
    requested: Twist,
    responses: Sequence[Response],
    percept: Percept,
    body: BodyConfig,
    config: ArbiterConfig,
    expected: Sequence[str],
) -> Decision:
    """Return the part of a requested velocity that is safe to drive, or a reason to stop.

    The schemas' vectors, the request's own included, are summed in the robot's frame. The component along the heading
    may reduce the requested speed to zero but never reverse it. The component across steers the robot while it drives
    forward, in proportion to its speed. Forward and backward, the speed is limited to what the robot can stop from
    before the nearest echo in that direction, and before what it has seen there is too old. Turning on the spot is
    not limited: it needs no room.

    Parameters
    ----------
    requested
        The velocity; its v divided by the base velocity is the request's vector along the heading.
    responses, percept, body, config, expected
        As for `arbitrate`.

    Returns
    -------
    Decision
        `Drive` with abs(v) ≤ `speed_max_m_s` and abs(w) ≤ `turn_max_rad_s`, both finite; or `Stop`.
    """
    error = _input_error(responses, percept, expected)
    if error is not None:
        return Stop(error)
    if not (_is_finite(requested.v) and _is_finite(requested.w)):
        return Stop(
            f"invalid velocity request ({_shown(requested.v)} m/s, {_shown(requested.w)} rad/s): expected two finite "
            "numbers; check the program that sent it"
        )
    c, s = math.cos(percept.pose.theta), math.sin(percept.pose.theta)
    x, y = summed(responses)
    along = config.base_velocity_m_s * (c * x + s * y)
    lateral = max(-1.0, min(1.0, c * y - s * x))
    w = requested.w
    if requested.v > 0.0:
        stoppable = stoppable_speed_m_s(percept, body, config.clearance_m, config.cautious_velocity_m_s)
        v = max(0.0, min(along, requested.v, body.speed_max_m_s, stoppable))
        w += config.turn_gain_per_s * lateral * v / config.base_velocity_m_s
        v = min(v, seen_speed_m_s(percept, body, config.clearance_m, w))
    else:
        behind = replace(percept, pose=replace(percept.pose, theta=percept.pose.theta + math.pi))
        stoppable = stoppable_speed_m_s(behind, body, config.clearance_m, config.cautious_velocity_m_s)
        seen = seen_speed_m_s(behind, body, config.clearance_m, w)
        v = min(0.0, max(along, requested.v, -body.speed_max_m_s, -stoppable, -seen))
    way = percept.pose.theta + (0.0 if v > 0.0 else math.pi)
    if angle_to_look(percept, way) is not None:
        v = max(-config.cautious_velocity_m_s, min(config.cautious_velocity_m_s, v))
    w = max(-body.turn_max_rad_s, min(body.turn_max_rad_s, w))
    if not (abs(v) <= body.speed_max_m_s and abs(w) <= body.turn_max_rad_s):
        return _outside(v, w)
    return Drive(Twist(v, w))


def _outside(v: float, w: float) -> Stop:
    return Stop(
        f"the arbiter computed a velocity outside the base's limits (v {v:g} m/s, w {w:g} rad/s), "
        "which is a bug in this program: keep the recording of this run and report it"
    )


def _unseen_ways(percept: Percept, course_rad: float, body: BodyConfig, config: ArbiterConfig) -> UnseenWay | None:
    """Return why neither the heading nor the course is seen; None if sensors look along one of them."""
    ahead = unseen_way(percept, percept.pose.theta, body, config.clearance_m)
    course = None if ahead is None else unseen_way(percept, course_rad, body, config.clearance_m)
    return None if ahead is None or course is None else min(ahead, course, key=lambda unseen: unseen.age_s)


def _course_speed_m_s(angle_rad: float, config: ArbiterConfig) -> float:
    """Return the base velocity on course, falling linearly to the cautious one at 45° and to zero at 90°."""
    cautious = min(config.cautious_velocity_m_s, config.base_velocity_m_s)
    if angle_rad < CAUTIOUS_ANGLE_RAD:
        share = angle_rad / CAUTIOUS_ANGLE_RAD
        return (1.0 - share) * config.base_velocity_m_s + share * cautious
    return max(0.0, 2.0 - angle_rad / CAUTIOUS_ANGLE_RAD) * cautious


def _input_error(responses: Sequence[Response], percept: Percept, expected: Sequence[str]) -> str | None:
    """Return why these inputs are invalid, None if they are valid."""
    given = [r.schema for r in responses]
    if given != [*expected] and sorted(given) != sorted(expected):
        return _schema_mismatch(Counter(given), Counter(expected))
    for r in responses:
        if not (_is_finite(r.x) and _is_finite(r.y)):
            return (
                f"the schema {r.schema} answered ({_shown(r.x)}, {_shown(r.y)}), which is not a finite vector: "
                "look for an axis left out, or for an echo or a pose that is not a number"
            )
    x, y = summed(responses)
    if not (math.isfinite(x) and math.isfinite(y)):
        return "the schemas' vectors are too large to add: look for an extreme gain or pose"
    pose = percept.pose
    if not all(map(math.isfinite, (pose.x, pose.y, pose.theta))):
        return f"the pose ({pose.x:g}, {pose.y:g}, {pose.theta:g}) is not finite: check the odometry, then re-arm"
    if not all(map(math.isfinite, percept.obstacles.ravel().tolist())):  # numpy's calls would take longer
        return "the place of an echo is not finite: check the ring's ranges and the odometry, then re-arm"
    return None


def _schema_mismatch(given: Counter[str], expected: Counter[str]) -> str:
    """Return which schema did not respond, or else which one responded without being asked."""
    if missing := sorted(expected - given):
        return f"no answer from the schema {', '.join(missing)}: the decision is incomplete, so the robot stops"
    surplus = ", ".join(sorted(given - expected))
    return f"the schema {surplus} answered without being asked, so the robot stops: check the schemas of the request"


def _is_finite(value: float) -> bool:
    """Return whether a component is a finite number; a schema from elsewhere may leave an axis out."""
    try:
        return math.isfinite(value)
    except (TypeError, OverflowError):  # not a number, or an integer beyond the range of floats
        return False


def _shown(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else repr(value)[:20]
