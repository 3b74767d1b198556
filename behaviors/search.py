"""The search schema: covers an area line by line, or in a square that grows, until a condition ends the step.

The lines follow from the pose at which the step begins. A corner of them that cannot be reached, as something stands
there or in the way, is left out after a while, so that the search goes on. Memory: `index` is the next corner,
`x` the least distance to it so far (m), `since_s` when that last shrank.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from behaviors.response import Response
from behaviors.schema_call import Answer, Memory, Scene
from config.mission_step import SearchUse
from perception.percept import Pose

SCHEMA: Final = "search"
REACHED_M: Final = 0.25
"""A corner of the lines counts as reached within this distance, m."""
GAIN_M: Final = 0.05
"""Coming nearer by less than this is no progress, m."""
GIVEN_UP_S: Final = 6.0
"""A corner to which the robot has come no nearer for so long is left out, s."""


def search(scene: Scene, memory: Memory, use: SearchUse) -> Answer:
    """Return a vector to the next corner of the lines, and whether the last one is behind.

    Parameters
    ----------
    scene
        Pose, echoes, and the pose at which the step began.
    memory
        The next corner, and the progress towards it.
    use
        Pattern, area, spacing and gain.
    """
    corners = lines(use)
    while memory.index < len(corners):
        there = scene.start.compose(Pose(*corners[memory.index], 0.0))
        dx, dy = there.x - scene.percept.pose.x, there.y - scene.percept.pose.y
        away = math.hypot(dx, dy)
        if not memory.is_set or away < memory.x - GAIN_M:
            memory = replace(memory, x=away, since_s=scene.step_s, is_set=True)
        is_late = scene.step_s - memory.since_s >= GIVEN_UP_S
        if away > REACHED_M and not is_late and not _is_occupied(scene, there):
            rest_m = sum(map(math.dist, corners[memory.index :], corners[memory.index + 1 :]))
            response = Response(SCHEMA, use.gain * dx / away, use.gain * dy / away)
            return Answer(response, memory, remaining_m=away + rest_m)
        memory = Memory(memory.index + 1)
    return Answer(Response(SCHEMA, 0.0, 0.0), memory, has_arrived=True, remaining_m=0.0)


def lines(use: SearchUse) -> list[tuple[float, float]]:
    """Return the corners of the lines in order, m, in the frame of the robot as the step begins."""
    if use.pattern == "lawn_mower":
        count = math.ceil(use.width_m / use.spacing_m) + 1
        corners = []
        for i in range(count):
            y = min(i * use.spacing_m, use.width_m)
            ends = [(0.0, y), (use.depth_m, y)]
            corners += ends if i % 2 == 0 else ends[::-1]
        return corners
    corners, x, y, i = [], 0.0, 0.0, 0
    while True:
        # Sides of 1, 1, 2, 2, 3, 3, … spacings, each a quarter turn on from the one before.
        length = (i // 2 + 1) * use.spacing_m
        dx, dy = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[i % 4]
        x, y, i = x + length * dx, y + length * dy, i + 1
        if abs(x) > use.depth_m / 2.0 + 1e-9 and abs(y) > use.width_m / 2.0 + 1e-9:
            return corners
        corners.append(
            (
                max(-use.depth_m / 2.0, min(use.depth_m / 2.0, x)),
                max(-use.width_m / 2.0, min(use.width_m / 2.0, y)),
            )
        )


def _is_occupied(scene: Scene, there: Pose) -> bool:
    """Return whether an echo came from so near a place that the robot has no room there."""
    away = np.hypot(scene.percept.obstacles[:, 0] - there.x, scene.percept.obstacles[:, 1] - there.y)
    room_m = scene.body.radius_m + scene.behaviors.arbiter.clearance_m - REACHED_M
    return bool((away < room_m).any())
