"""A robot that wanders through a furnished room and then stands: what its ring hears, with exact poses."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bench.trials.furnished_rooms import furnished_room
from config.load import load_robot
from config.robot import FiringConfig, RingConfig, SensorConfig
from config.world import AcousticsConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, sensors
from drivers.messages import Firing, Pose

ACOUSTICS = (
    AcousticsConfig(model="specular"),
    AcousticsConfig(model="cone", noise_relative=0.01, dropout=0.05, outliers=0.03),
    AcousticsConfig(model="specular", noise_relative=0.01, dropout=0.05, outliers=0.03),
)
SPEED_M_S, TURN_RAD_S = 0.3, 0.8
"""Of the robot on its way, and on the spot."""


def ring_of(*bearings_deg: float) -> RingConfig:
    """Return a ring of a few sensors, which fire in two sets."""
    mounts = tuple(
        SensorConfig(x_m=0.3 * math.cos(math.radians(a)), y_m=0.3 * math.sin(math.radians(a)), angle_deg=a)
        for a in bearings_deg
    )
    every = range(len(mounts))
    sets = tuple(tuple(i for i in every if i % 2 == turn) for turn in range(2))
    base = load_robot("denning").ring
    given = base.model_dump(exclude_none=True, exclude={"count", "radius_m", "sensors", "firing"})
    return RingConfig(**given, sensors=mounts, firing=FiringConfig(sets=sets))


def ring_with_gaps(seed: int) -> RingConfig:
    """Return a ring of 8 to 19 sensors, 15° or more apart."""
    rng = np.random.default_rng([seed, 5])
    chosen = rng.choice(24, int(rng.integers(8, 20)), replace=False)
    return ring_of(*(15.0 * np.sort(chosen)).tolist())


@dataclass(frozen=True, slots=True)
class Wandering:
    """What is driven.

    Attributes
    ----------
    ring
        The sensors.
    seed
        Of the room, which has one of `ACOUSTICS` or its own, and of the way.
    drive_s, stand_s
        How long the robot drives, and stands after that.
    deaf
        A sensor that hears nothing.
    acoustics
        Of the room, instead.
    """

    ring: RingConfig
    seed: int
    drive_s: float
    stand_s: float = 0.0
    deaf: int | None = None
    acoustics: AcousticsConfig | None = None

    def firings(self) -> Iterator[Firing]:
        """Yield the firings."""
        rng, room, ring = np.random.default_rng([self.seed, 77]), furnished_room(self.seed), self.ring
        acoustics = self.acoustics or (*ACOUSTICS, room.world.acoustics)[self.seed % (len(ACOUSTICS) + 1)]
        scene, pattern = compile_scene(room.world), firing_pattern(ring)
        sonar = Sonar(ring, scene, acoustics, np.random.default_rng([self.seed, 3]))
        least_m, period_s = max(math.hypot(x, y) for x, y, _ in ring.mounts) + 0.15, pattern.step_period_s

        def is_clear(x: float, y: float, more_m: float = 0.0) -> bool:
            return bool(clearance(x, y, scene.circles, scene.segments) > least_m + more_m)

        places = (room.place(*rng.uniform(-0.45, 0.45, 2).tolist()) for _ in itertools.count())
        x, y = next(place for place in places if is_clear(*place, 0.1))
        yaw, turn, t = float(rng.uniform(-3.0, 3.0)), 0.0, 0.0
        for fired in itertools.cycle([sensors(mask) for mask in pattern.masks]):
            t += period_s
            if t > self.drive_s + self.stand_s:
                return
            ahead = (x + SPEED_M_S * period_s * math.cos(yaw), y + SPEED_M_S * period_s * math.sin(yaw))
            if t > self.drive_s:
                pass
            elif abs(turn) < 1e-9 and is_clear(*ahead):
                (x, y), yaw = ahead, yaw + float(rng.normal(0.0, 0.15)) * math.sqrt(period_s)
            else:
                if abs(turn) < 1e-9:
                    turn = float(rng.uniform(0.5, 2.5) * rng.choice((-1.0, 1.0)))
                step = math.copysign(min(abs(turn), TURN_RAD_S * period_s), turn)
                yaw, turn = yaw + step, turn - step
            pose = Pose(x, y, yaw)
            ranges = sonar.fire(pose, yaw, fired)
            if self.deaf is not None and self.deaf in fired:
                ranges[self.deaf] = math.inf
            yield Firing(t, pose, yaw, ranges)
