"""What the operator wants driven, and which schemas are asked for it.

A wish moves nothing by itself: it is looked at in DRIVE only. Leaving DRIVE takes a goal and the hand from the stick
away, so that nothing goes on by itself after a re-arm; the legs of the settings are what a robot drives that nobody
told anything.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from behaviors.arbiter import Decision, Drive, arbitrate, limit
from behaviors.avoid_static_obstacle import SCHEMA as AVOID
from behaviors.avoid_static_obstacle import avoid_static_obstacle
from behaviors.move_ahead import SCHEMA as AHEAD
from behaviors.move_ahead import Leg, move_ahead
from behaviors.move_to_goal import SCHEMA as TO_GOAL
from behaviors.move_to_goal import Goal, move_to_goal
from behaviors.response import Response
from behaviors.teleoperation import HANDS_OFF, Teleoperate, is_over, teleoperation
from behaviors.teleoperation import SCHEMA as BY_HAND
from config.settings import Settings
from drivers.messages import Twist
from perception.percept import Percept

STANDSTILL: Final = Twist(0.0, 0.0)
PLACE_MAX_M: Final = 10_000.0
"""A goal farther off than this along an axis is a slip of the pen; nobody drives ten kilometres by sonar."""
SUM: Final = "sum"


@dataclass(frozen=True, slots=True)
class Legs:
    """Ahead, as `behaviors.move_ahead` is set."""

    kind: Literal["legs"] = "legs"


Wish: TypeAlias = Legs | Goal | Teleoperate


@dataclass(frozen=True, slots=True)
class Driven:
    """What came of a wish in one cycle."""

    decision: Decision
    vectors: tuple[Response, ...]
    """What the schemas answered, and their sum, named so."""
    wish: Wish
    """As it stands now: a goal may be reached, a hand gone."""
    leg: Leg
    standing: str | None = None
    """Why the robot stands though it may drive; a text for the operator."""


def why_not(wish: Wish) -> str | None:
    """Return why a wish is none, None where it is good."""
    match wish:
        case Goal(x, y):
            if not (abs(x) <= PLACE_MAX_M and abs(y) <= PLACE_MAX_M):
                return f"the goal ({x:g}, {y:g}) is no place: give metres in the odometry's frame"
        case Teleoperate(v, w, valid_s):
            if not (math.isfinite(v) and math.isfinite(w) and valid_s >= 0.0):
                return f"the velocity ({v:g}, {w:g}) for {valid_s:g} s is none: give m/s, rad/s and seconds"
    return None


def after_a_stop(wish: Wish) -> Wish:
    """Return what is left of a wish once the robot has stopped driving: the legs, or nothing."""
    return wish if isinstance(wish, Legs) else HANDS_OFF


def drive(wish: Wish, wished_s: float, now_s: float, leg: Leg, percept: Percept, settings: Settings) -> Driven:
    """Ask the schemas that the wish names, and the arbiter.

    Parameters
    ----------
    wish : Wish
        What is wanted.
    wished_s, now_s : float
        When that was said, and now, by the host's clock.
    leg : Leg
        The way under way, for `Legs`.
    percept : Percept
        What the robot sees.
    settings : Settings
        The run's.
    """
    behaviors, body = settings.behaviors, settings.body
    away = avoid_static_obstacle(percept, body.radius_m, behaviors.avoid_static_obstacle)
    if isinstance(wish, Teleoperate):
        # Of the cycles that are in time the last one is to stop: the next one would be late.
        age_s = now_s - wished_s
        if wish != HANDS_OFF and is_over(wish, age_s + 1.0 / settings.cycle.rate_hz, behaviors.teleoperation):
            wish = HANDS_OFF
        hand = teleoperation(percept, wish, behaviors.arbiter.base_velocity_m_s)
        both = behaviors.teleoperation.avoid
        responses, expected = ((hand, away), (BY_HAND, AVOID)) if both else ((hand,), (BY_HAND,))
        decision = limit(Twist(wish.v, wish.w), responses, percept, body, behaviors.arbiter, expected)
        nobody = "nobody is at the controls: drive by hand, name a goal, or go on with the legs"
        return Driven(decision, shown(responses, decision), wish, leg, nobody if wish == HANDS_OFF else None)
    if isinstance(wish, Goal):
        to_goal, wish = move_to_goal(percept, wish, behaviors.move_to_goal)
        responses = (to_goal, away)
        decision = arbitrate(responses, percept, body, behaviors.arbiter, (TO_GOAL, AVOID))
        if wish.reached and isinstance(decision, Drive):
            there = f"the goal ({wish.x:.2f} m, {wish.y:.2f} m) is reached"
            return Driven(Drive(STANDSTILL), shown(responses, decision), wish, leg, there)
        return Driven(decision, shown(responses, decision), wish, leg)
    ahead, leg = move_ahead(percept, leg, behaviors.move_ahead)
    decision = arbitrate((ahead, away), percept, body, behaviors.arbiter, (AHEAD, AVOID))
    standing = "the leg is done" if leg.done else None
    return Driven(decision, shown((ahead, away), decision), wish, leg, standing)


def shown(responses: tuple[Response, ...], decision: Decision) -> tuple[Response, ...]:
    """Return the responses and, last, their sum; nothing where they allowed no decision and may be no vectors."""
    if not isinstance(decision, Drive):
        return ()
    return (*responses, Response(SUM, sum(r.x for r in responses), sum(r.y for r in responses)))
