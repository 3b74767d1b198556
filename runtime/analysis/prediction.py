"""How well a map predicts readings that perception was not given: a measure of settings that needs no truth.

Some firings are withheld. What perception finds in the others makes a room, and the room says what every sensor of a
withheld firing should read. The score is a proper one, the mean logarithm of the probability that is given to what
was read: it rises with every object that is found where it is, and falls with one that is not there.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Final, get_args

import numpy as np

from config.errors import UserError
from config.settings import Settings
from config.world import WorldConfig
from drivers.messages import Firing, Floats
from perception.detected_object import DetectedObject
from perception.localization.room.expected_ranges import Beams, Reflection, expected_ranges
from perception.localization.room.range_likelihood import RangeModel, log_ratio
from perception.localization.room.room import room_of
from perception.sensor_mounts import mounts_array, mounts_at
from runtime.analysis.export.world_file import world_of
from runtime.cycle.summary import PerceivedRows

WITHHELD_SHARE: Final = 0.2
SEED: Final = 17
"""Of the choice of firings: the same for all settings, so that they are compared on the same readings."""
NOISES_M: Final = (0.01, 0.02, 0.05, 0.1)
DROPOUTS: Final = (0.05, 0.2, 0.5)
OUTLIERS: Final = (0.05, 0.2, 0.5)
"""Errors of readings, of which the likeliest are taken: neither the noise of the sensors nor how much of the place
has no model is known here, and the drift of the odometry looks like noise."""
CHUNK: Final = 2048
"""Readings predicted at a time, which bounds the memory."""


def withhold(firings: Iterable[Firing]) -> tuple[list[Firing], list[Firing]]:
    """Return the firings for perception, and those withheld from it, chosen at random but always the same."""
    given: list[Firing] = []
    withheld: list[Firing] = []
    rng = np.random.default_rng(SEED)
    for firing in firings:
        (withheld if rng.random() < WITHHELD_SHARE else given).append(firing)
    return given, withheld


def predicted_nat(settings: Settings, perceived: PerceivedRows, withheld: Sequence[Firing]) -> float:
    """Return the mean logarithm of the probability of a withheld reading, over that of one from anywhere.

    `perceived` is what perception of these settings found in the other firings. The unit is nat; 0 is what a map
    without any knowledge gets.

    Raises
    ------
    UserError
        No sensor fired in the withheld firings.
    """
    beams, measured = _readings(settings, withheld)
    if not len(measured):
        raise UserError("too few firings to withhold some of them and predict those")
    world = _found(settings, perceived)
    heard = measured[np.isfinite(measured)]
    # A setting in its place would change the scale of the score.
    window_m = float(heard.max()) if len(heard) else settings.ring.window_m
    best = -math.inf
    for reflection in get_args(Reflection):
        expected = _expected(world, beams, math.radians(settings.ring.beam_half_angle_deg), reflection)
        for noise_m, dropout, outliers in itertools.product(NOISES_M, DROPOUTS, OUTLIERS):
            if dropout + outliers < 1.0:
                model = RangeModel(settings.ring.resolution_m, window_m, 0.01, noise_m, dropout, outliers)
                best = max(best, float(log_ratio(model, measured, expected)[0].mean()))
    return best


def _readings(settings: Settings, firings: Sequence[Firing]) -> tuple[Beams, Floats]:
    """Return all sensors that fired, in odometry's frame, and the range that each read, m, inf for silence."""
    mounts, turning = mounts_array(settings.ring.mounts), settings.ring.turning
    parts: list[Floats] = [np.empty((0, 4))]
    for firing in firings:
        fired = ~np.isnan(firing.ranges_m)
        x, y, axis = mounts_at(firing, mounts, turning)[fired].T
        c, s = math.cos(firing.ring_yaw), math.sin(firing.ring_yaw)
        at_x, at_y = firing.pose.x + c * x - s * y, firing.pose.y + s * x + c * y
        parts.append(np.column_stack([at_x, at_y, axis + firing.ring_yaw, firing.ranges_m[fired]]))
    x, y, axis, measured = np.concatenate(parts).T
    return Beams(x, y, axis), measured


def _found(settings: Settings, perceived: PerceivedRows) -> WorldConfig:
    """Return what was perceived as a world."""
    walls = [[wall["x1"], wall["y1"], wall["x2"], wall["y2"]] for wall in perceived["walls"]]
    objects = [
        DetectedObject(one["model"], one["x"], one["y"], one["theta"], one["sigma"], one["support"], one["score"])
        for one in perceived["objects"]
    ]
    return world_of(objects, np.array(walls).reshape(-1, 4), settings.models)


def _expected(world: WorldConfig, beams: Beams, half_angle: float, reflection: Reflection) -> Floats:
    """Return the expected range of each sensor, m; inf everywhere in a world without surfaces."""
    if not (world.drum or world.sides_m()):
        return np.full(len(beams.x), np.inf)
    room = room_of(world)
    chunks = [Beams(*(part[i : i + CHUNK] for part in beams)) for i in range(0, len(beams.x), CHUNK)]
    return np.concatenate([expected_ranges(room, chunk, half_angle, reflection).range_m for chunk in chunks])
