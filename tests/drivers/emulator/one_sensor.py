"""Worlds of a few surfaces, and one sensor that listens in them; shared by the tests of the emulator's ring."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from config.robot import RingConfig, SensorConfig
from config.world import AcousticsConfig, DrumConfig, WallConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Pose

BEAM_DEG = 12.0


def wall(x1: float, y1: float, x2: float, y2: float) -> WallConfig:
    return WallConfig(x1_m=x1, y1_m=y1, x2_m=x2, y2_m=y2)


def drum(x: float, y: float, radius: float) -> DrumConfig:
    return DrumConfig(x_m=x, y_m=y, radius_m=radius)


def ring(**changes: Any) -> RingConfig:
    """One sensor in the middle, looking forward, exact, with a long window."""
    settings: dict[str, Any] = {
        "sensors": (SensorConfig(x_m=0.0, y_m=0.0, angle_deg=0.0),),
        "beam_half_angle_deg": BEAM_DEG,
        "resolution_m": 0.0,
        "range_min_m": 0.0,
        "range_max_m": 50.0,
    }
    return RingConfig(**settings | changes)


def hear(world: WorldConfig, theta_deg: float = 0.0, x: float = 0.0, y: float = 0.0, seed: int = 0) -> float:
    sonar = Sonar(ring(), compile_scene(world), world.acoustics, np.random.default_rng(seed))
    theta = math.radians(theta_deg)
    return float(sonar.fire(Pose(x, y, theta), theta)[0])


def world_of(model: str, **surfaces: Any) -> WorldConfig:
    acoustics = AcousticsConfig.model_validate({"model": model})
    return WorldConfig(acoustics=acoustics, **surfaces)
