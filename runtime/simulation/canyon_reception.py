"""Whether a robot could know of a canyon before it is in: where on its way the back is first heard.

An oracle for the drives of `runtime.simulation.canyon_trials`: it fires the ring without noise on the straight way to
the goal, with the back wall and without it. Before the place where a range differs, a canyon and a corridor that goes
on sound alike.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from config.settings import Settings
from config.world import AcousticsConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Pose
from runtime.simulation.canyon_worlds import CanyonWorld

STEP_M: Final = 0.05
BACK: Final = 1
"""The back among the walls of a canyon."""
IN_TIME_M: Final = 1.0
"""A back is heard in time if it is heard so far before the mouth: an echo counts once it has stayed for .4 m of the
way (`behaviors.surroundings.blocked_ahead.STAYS_FOR_M`), and at .3 m/s and .3 rad/s a turn by 90° takes .6 m."""


def back_heard_m(settings: Settings, place: CanyonWorld) -> float | None:
    """Return how far before the mouth the back of a canyon is first heard, m; None if it is not."""
    acoustics = AcousticsConfig(model=place.world.acoustics.model)
    walls = place.world.wall
    worlds = (WorldConfig(wall=walls), WorldConfig(wall=(*walls[:BACK], *walls[BACK + 1 :])))
    rings = [Sonar(settings.ring, compile_scene(world), acoustics, np.random.default_rng(0)) for world in worlds]
    sensors = list(range(len(settings.ring.mounts)))
    start, goal = place.start, place.goal
    first, last = place.local(start.x, start.y), place.local(*goal)
    for before_m in np.arange(-first[0], 0.0, -STEP_M).tolist():
        share = (-before_m - first[0]) / (last[0] - first[0])
        x, y = start.x + share * (goal[0] - start.x), start.y + share * (goal[1] - start.y)
        heard, without = (ring.fire(Pose(x, y, start.theta), start.theta, sensors) for ring in rings)
        if not np.array_equal(heard, without, equal_nan=True):
            return float(before_m)
    return None
