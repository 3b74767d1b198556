"""A simple simulator for the motor schemas: discs and walls, ideal echoes, a base with limited acceleration.

It shares no code with the emulator, so that neither can hide a mistake of the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from behaviors import avoid_static_obstacle as avoid
from behaviors import move_ahead as ahead
from behaviors.arbiter import Drive, arbitrate
from config.behaviors import BehaviorsConfig
from config.robot import BodyConfig
from perception.percept import Percept, Pose
from tests.behaviors.views import EVERYWHERE

SENSORS = 24
HALF_BEAM_RAD = math.radians(12.0)
RANGE_MAX_M = 7.77
STEP_S = 0.05
FOOT = 0.3048
BODY = BodyConfig(radius_m=1.25 * FOOT, speed_max_m_s=0.6, turn_max_rad_s=1.5, synchro=True)

CONE = (-HALF_BEAM_RAD, -0.5 * HALF_BEAM_RAD, 0.0, 0.5 * HALF_BEAM_RAD, HALF_BEAM_RAD)
"""Directions of the rays of a cone, rad from its axis."""

Disc = tuple[float, float, float]
Wall = tuple[float, float, float, float]


@dataclass(frozen=True)
class World:
    """Discs (x, y, radius) and walls (x1, y1, x2, y2)."""

    discs: tuple[Disc, ...] = ()
    walls: tuple[Wall, ...] = ()

    def clearance(self, x: float, y: float) -> float:
        """Return the distance from a point to the nearest surface, m."""
        gaps = [math.hypot(x - cx, y - cy) - r for cx, cy, r in self.discs]
        for x1, y1, x2, y2 in self.walls:
            share = ((x - x1) * (x2 - x1) + (y - y1) * (y2 - y1)) / ((x2 - x1) ** 2 + (y2 - y1) ** 2)
            share = min(1.0, max(0.0, share))
            gaps.append(math.hypot(x - x1 - share * (x2 - x1), y - y1 - share * (y2 - y1)))
        return min(gaps, default=math.inf)

    def ray(self, x: float, y: float, angle: float) -> float:
        """Return the distance along a ray to the first surface within the ring's range, or infinity."""
        c, s = math.cos(angle), math.sin(angle)
        found = []
        for cx, cy, r in self.discs:
            ahead, across_m = c * (cx - x) + s * (cy - y), c * (cy - y) - s * (cx - x)
            if abs(across_m) < r:
                found.append(ahead - math.sqrt(r * r - across_m * across_m))
        for x1, y1, x2, y2 in self.walls:
            across = c * (y2 - y1) - s * (x2 - x1)
            if across != 0.0:
                share = (s * (x1 - x) - c * (y1 - y)) / across
                if 0.0 <= share <= 1.0:
                    found.append(c * (x1 + share * (x2 - x1) - x) + s * (y1 + share * (y2 - y1) - y))
        return min((far for far in found if 0.0 <= far < RANGE_MAX_M), default=math.inf)

    def echo(self, x: float, y: float, angle: float, *, wide: bool) -> float:
        """Return the range of a pencil beam, or of a cone: the nearest of five rays across it."""
        return min(self.ray(x, y, angle + off) for off in (CONE if wide else (0.0,)))


@dataclass
class Run:
    """The result of a drive."""

    clearance: float = math.inf
    """Least distance between the rim and any surface."""
    path: list[Pose] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)


def drive(
    world: World,
    start: Pose,
    config: BehaviorsConfig,
    seconds: float,
    *,
    wide: bool = False,
    noise: np.random.Generator | None = None,
) -> Run:
    """Drive with both schemas; in each step the ring, which does not turn, gives 24 echoes at once."""
    run, pose, v, w = Run(), start, 0.0, 0.0
    leg = ahead.Leg.starting_at(start)
    for _ in range(round(seconds / STEP_S)):
        percept = Percept(pose, echoes(world, pose, wide=wide, noise=noise), EVERYWHERE)
        response, leg = ahead.move_ahead(percept, leg, config.move_ahead)
        push = avoid.avoid_static_obstacle(percept, BODY.radius_m, config.avoid_static_obstacle)
        decision = arbitrate((response, push), percept, BODY, config.arbiter, (ahead.SCHEMA, avoid.SCHEMA))
        assert isinstance(decision, Drive), decision
        v += clamp(decision.twist.v - v, BODY.acceleration_max_m_s2 * STEP_S)
        w += clamp(decision.twist.w - w, BODY.turn_acceleration_max_rad_s2 * STEP_S)
        middle = pose.theta + 0.5 * w * STEP_S
        pose = Pose(
            pose.x + v * STEP_S * math.cos(middle), pose.y + v * STEP_S * math.sin(middle), pose.theta + w * STEP_S
        )
        run.clearance = min(run.clearance, world.clearance(pose.x, pose.y) - BODY.radius_m)
        run.path.append(pose)
        run.speeds.append(v)
    return run


def echoes(world: World, pose: Pose, *, wide: bool, noise: np.random.Generator | None) -> np.ndarray:
    """Return the echoes as points on the sensors' axes; with noise, ranges are also rounded to a tenth of a foot."""
    points = []
    for i in range(SENSORS):
        angle = 2.0 * math.pi * i / SENSORS
        x, y = pose.x + BODY.radius_m * math.cos(angle), pose.y + BODY.radius_m * math.sin(angle)
        r = world.echo(x, y, angle, wide=wide)
        if noise is not None and math.isfinite(r):
            r = max(0.5 * FOOT, round((r + noise.normal(0.0, 0.01)) / (0.1 * FOOT)) * 0.1 * FOOT)
        if math.isfinite(r):
            points.append((x + r * math.cos(angle), y + r * math.sin(angle)))
    return np.array(points, dtype=np.float64).reshape(-1, 2)


def clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


def hallway(shifts: tuple[tuple[float, float], ...] = ((0.0, 0.0),) * 6) -> World:
    """Return the paper's two rows of three drums, each moved by a shift, m."""
    places = [(x * FOOT, y * FOOT) for y in (4.0, -4.0) for x in (1.0, 4.0, 7.0)]
    return World(tuple((x + dx, y + dy, FOOT) for (x, y), (dx, dy) in zip(places, shifts, strict=True)))
