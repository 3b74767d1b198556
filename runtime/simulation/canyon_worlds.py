"""Worlds with a box canyon between the robot and its goal, as Balch and Arkin (1993) drew them, at random sizes.

Three walls form a U: a back and two sides as long as the canyon is deep. The robot starts before the mouth and looks
at the goal, which lies behind the back wall, so that the straight way leads in. Each seed gives one world.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

import numpy as np

from config.world import AcousticsConfig, OdometryConfig, StartConfig, WallConfig, WorldConfig
from drivers.messages import Pose

DEPTH_M: Final = (1.0, 8.0)
WIDTH_M: Final = (1.0, 4.0)
BEFORE_M: Final = (1.5, 4.0)
"""Distance of the start from the mouth."""
BEHIND_M: Final = (1.2, 2.5)
"""Distance of the goal from the back wall."""
OFF_AXIS: Final = 0.4
"""Start and goal lie at most this share of the width beside the axis."""
HEADING_RAD: Final = math.radians(20.0)
"""Greatest angle between the robot's first heading and the goal's direction."""
ARC_POINTS: Final = 181
"""Points of each half circle of the shortest way."""
ODOMETRY: Final = OdometryConfig(scale=1.01, heading_rad_per_sqrt_m=math.radians(0.3))

Reflection: TypeAlias = Literal["specular", "cone"]


@dataclass(frozen=True, slots=True)
class CanyonWorld:
    """A canyon, a start and a goal."""

    world: WorldConfig
    """The walls, and the start."""
    depth_m: float
    width_m: float
    """Of the canyon."""
    mouth: Pose
    """The middle of the mouth, looking in."""
    goal: tuple[float, float]
    """In the world's frame, m."""

    @property
    def start(self) -> Pose:
        """Where the robot starts."""
        start = self.world.start
        return Pose(start.x_m, start.y_m, math.radians(start.heading_deg))

    def local(self, x: float, y: float) -> tuple[float, float]:
        """Return a place's distance behind the mouth and to the left of the axis, m."""
        seen = self.mouth.inverse().compose(Pose(x, y, 0.0))
        return seen.x, seen.y

    def goal_in_odometry(self) -> tuple[float, float]:
        """Return the goal as seen from the start, where odometry begins, m."""
        seen = self.start.inverse().compose(Pose(*self.goal, 0.0))
        return seen.x, seen.y

    def shortest_m(self, room_m: float) -> float:
        """Return the length of the shortest way round the canyon that keeps `room_m` to its walls.

        A taut string from the start to the goal is the upper hull of both and of discs about the walls' ends.
        """
        start, goal = self.local(self.start.x, self.start.y), self.local(*self.goal)
        angles = np.linspace(0.0, math.pi, ARC_POINTS)
        arc = room_m * np.column_stack([np.cos(angles), np.sin(angles)])
        ways = []
        for side in (1.0, -1.0):
            ends = [(along, 0.5 * self.width_m) for along in (0.0, self.depth_m)]
            points = np.concatenate([arc + end for end in ends] + [[(start[0], side * start[1])]])
            ways.append(_taut_m([*sorted(map(tuple, points.tolist())), (goal[0], side * goal[1])]))
        return min(ways)


def canyon_world(seed: int, reflection: Reflection = "specular") -> CanyonWorld:
    """Return a world by its number; its walls are mirrors, or each point of theirs answers."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 29]))
    depth, width, before, behind = (float(rng.uniform(*span)) for span in (DEPTH_M, WIDTH_M, BEFORE_M, BEHIND_M))
    start_y, goal_y = (rng.uniform(-OFF_AXIS, OFF_AXIS, 2) * width).tolist()
    x, y = rng.uniform(-5.0, 5.0, 2).tolist()
    mouth = Pose(x, y, float(rng.uniform(-math.pi, math.pi)))
    ends = [
        mouth.compose(Pose(u, v, 0.0))
        for u, v in (
            (0.0, 0.5 * width),
            (depth, 0.5 * width),
            (depth, -0.5 * width),
            (0.0, -0.5 * width),
        )
    ]
    walls = tuple(WallConfig(x1_m=a.x, y1_m=a.y, x2_m=b.x, y2_m=b.y) for a, b in itertools.pairwise(ends))
    start, goal = mouth.compose(Pose(-before, start_y, 0.0)), mouth.compose(Pose(depth + behind, goal_y, 0.0))
    heading = math.atan2(goal.y - start.y, goal.x - start.x) + float(rng.uniform(-HEADING_RAD, HEADING_RAD))
    world = WorldConfig(
        wall=walls,
        start=StartConfig(x_m=start.x, y_m=start.y, heading_deg=math.degrees(math.remainder(heading, math.tau))),
        acoustics=AcousticsConfig(model=reflection, noise_relative=0.01, dropout=0.05, outliers=0.03),
        odometry=ODOMETRY,
    )
    return CanyonWorld(world, depth, width, mouth, (goal.x, goal.y))


def _taut_m(points: list[tuple[float, float]]) -> float:
    """Return the length of the upper hull of points in ascending order of x, from the first to the last, m."""
    hull: list[tuple[float, float]] = []
    for x, y in points:
        while len(hull) > 1:
            (ax, ay), (bx, by) = hull[-2:]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) < 0.0:
                break
            hull.pop()
        hull.append((x, y))
    return sum(math.dist(a, b) for a, b in itertools.pairwise(hull))
