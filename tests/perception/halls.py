"""Drives down a hall with exact poses: firings for perception without robot, line or clock."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from config.load import load_settings, load_world
from config.settings import Settings
from config.world import WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Pose

FT = 0.3048


def settings(**perception: object) -> Settings:
    """The shipped settings by the paper's method, with parts of perception replaced."""
    shipped = load_settings("hallway")
    return shipped.model_copy(
        update={"perception": shipped.perception.model_copy(update={"method": "paper", **perception})}
    )


def drums(*places_ft: tuple[float, float]) -> WorldConfig:
    """The shipped hall with other drums, places in feet."""
    hall = load_world("hallway")
    return hall.model_copy(
        update={"drum": tuple(hall.drum[0].model_copy(update={"x_m": x * FT, "y_m": y * FT}) for x, y in places_ft)}
    )


def drive(
    world: WorldConfig, x_ft: tuple[float, float] = (-6.0, 14.0), begin_s: float = 0.0, y_ft: float = 0.0
) -> Iterator[Firing]:
    """Firings of octets every 50 ms at 0.3 m/s along y = `y_ft`, poses in world coordinates."""
    ring = load_settings("hallway").ring
    sonar = Sonar(ring, compile_scene(world), world.acoustics, np.random.default_rng(0))
    for k in itertools.count():
        x = x_ft[0] * FT + 0.015 * k
        if x > x_ft[1] * FT:
            return
        fired = [i for i in range(24) if i % 3 == k % 3]
        pose = Pose(x, y_ft * FT, 0.0)
        yield Firing(begin_s + 0.05 * k, pose, 0.0, sonar.fire(pose, 0.0, fired))
