"""The move-ahead schema (Arkin 1989): a unit vector along a fixed heading.

Progress is state, and behaviours hold none: the leg is passed in and returned with each call, so that a replay that
starts from the same leg drives the same way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from behaviors.response import Response
from config.behaviors import MoveAheadConfig
from config.bounded import Coordinate
from perception.percept import Percept, Pose

SCHEMA: Final = "move_ahead"


@dataclass(frozen=True, slots=True)
class Leg:
    """The current leg: its start (m, odometry's frame), whether it leads outbound, and whether it is finished."""

    origin_x: Coordinate
    origin_y: Coordinate
    outbound: bool = True
    done: bool = False
    gave_up: bool = False
    """Whether it ended because the robot came hardly farther."""

    @classmethod
    def starting_at(cls, pose: Pose) -> Leg:
        """Return the leg of a drive that starts at `pose`."""
        return cls(pose.x, pose.y)


def move_ahead(percept: Percept, leg: Leg, config: MoveAheadConfig) -> tuple[Response, Leg]:
    """Return the schema's vector and the leg for the next call.

    Distance is measured along the heading only, so that a detour around an obstacle does not shorten the leg. A
    finished leg stays finished even if the robot is pushed back: motion does not resume by itself.

    Parameters
    ----------
    percept
        Only the pose is used.
    leg
        The leg so far; ``Leg.starting_at(pose)`` at the start of a drive.
    config
        Gain, direction, and what happens after `distance_m`.
    """
    direction = math.radians(config.move_ahead_direction_deg)
    ux, uy = math.cos(direction), math.sin(direction)
    leg = _advance(leg, _out_m(percept.pose, leg, ux, uy), config)
    if leg.done:
        return Response(SCHEMA, 0.0, 0.0), leg
    magnitude = config.move_ahead_gain if leg.outbound else -config.move_ahead_gain
    return Response(SCHEMA, magnitude * ux, magnitude * uy), leg


def along_m(pose: Pose, leg: Leg, config: MoveAheadConfig) -> float:
    """Return how far the robot is from the leg's start in the direction in which the leg leads now, m."""
    direction = math.radians(config.move_ahead_direction_deg)
    out = _out_m(pose, leg, math.cos(direction), math.sin(direction))
    return out if leg.outbound else -out


def _out_m(pose: Pose, leg: Leg, ux: float, uy: float) -> float:
    """Return how far the robot is from the leg's start in the direction of the unit vector (ux, uy), m."""
    return (pose.x - leg.origin_x) * ux + (pose.y - leg.origin_y) * uy


def given_up(leg: Leg, config: MoveAheadConfig) -> Leg:
    """Return a leg on which the robot comes no farther: it turns back where legs do, and ends otherwise."""
    if config.at_end == "turn_back" and config.distance_m is not None:
        return replace(leg, outbound=not leg.outbound)
    return replace(leg, done=True, gave_up=True)


def _advance(leg: Leg, progress_m: float, config: MoveAheadConfig) -> Leg:
    if config.distance_m is None or leg.done:
        return leg
    if leg.outbound and progress_m >= config.distance_m:
        return replace(leg, done=True) if config.at_end == "stop" else replace(leg, outbound=False)
    if not leg.outbound and progress_m <= 0.0:
        return replace(leg, outbound=True)
    return leg
