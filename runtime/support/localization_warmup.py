"""Runs the kernels that find where the robot is once: parts of `runtime.support.kernel_warmup`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from config.settings import Settings
    from drivers.messages import Firing

WARM_UP_FIRINGS: Final = 24
"""Firings of a drive that between them run every kernel."""


def _firings(settings: Settings, count: int, step_m: float, turn_rad: float = 0.0) -> Iterator[Firing]:
    """Yield the firings of a drive, of which every other one hears nothing."""
    import numpy as np

    from drivers.messages import Firing, Pose

    for k in range(count):
        ranges = np.full(len(settings.ring.mounts), 0.7 if k % 2 else math.inf)
        yield Firing(0.1 * k, Pose(step_m * k, 0.0, turn_rad * k), 0.0, ranges)


def find_echo_lag(settings: Settings) -> None:
    """Drive until a lag of ranges behind odometry was looked for."""
    from perception.localization.submaps.echo_lag import lag_of

    lag_of(_firings(settings, 2 * WARM_UP_FIRINGS, 0.11), settings.ring)


def correct_drift(settings: Settings) -> None:
    """Drive past landmarks that vanish; enter every kind of range, match maps of the way, and move the ring."""
    import numpy as np

    from drivers.messages import Pose
    from perception.localization.drift.drift_correction import DriftCorrection, SeenObject
    from perception.localization.drift.landmark_tracker import LandmarkTracker
    from perception.localization.submaps.submap_graph import SubmapGraph

    drift, graph = DriftCorrection(settings.ring), SubmapGraph(settings.ring)
    objects = [SeenObject(k, 2.0 * math.cos(k), 2.0 * math.sin(k), 0.3) for k in range(1, 5)]
    for k, firing in enumerate(_firings(settings, 2 * WARM_UP_FIRINGS, 0.15, 0.1)):
        drift.learn(objects[k // 12 :])
        drift.observe(firing)
        graph.observe(firing)
        while graph.can_refine:
            graph.refine()
    LandmarkTracker(settings.ring).displace(Pose(0.0, 0.0, 0.0), np.zeros((3, 3)))


def find_in_room(settings: Settings) -> None:
    """Drive through a small room until a search of it is over."""
    import numpy as np

    from perception.localization.known_room.known_room import SEARCH_M, KnownRoom
    from perception.localization.room.room import make_room

    walls = np.array([[-1.0, -1.0, 2.0, -1.0], [2.0, -1.0, 2.0, 1.0], [2.0, 1.0, -1.0, 1.0]])
    known_room = KnownRoom(make_room(walls, np.array([[1.0, 0.5, 0.2]])), settings.ring)
    for firing in _firings(settings, WARM_UP_FIRINGS, 2.0 * SEARCH_M[0] / WARM_UP_FIRINGS):
        known_room.observe(firing)
        while known_room.can_refine:
            known_room.refine()
    known_room.localized()
