"""Robots drawn at random: 3 to 24 sensors whose beams overlap, touch or leave gaps, any size, limits and rates."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from config.load import load_settings
from config.robot import BodyConfig, RingConfig
from config.settings import Settings
from config.world import AcousticsConfig, BoxConfig, DrumConfig, StartConfig, WallConfig, WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene
from drivers.firing_pattern import FiringError
from runtime.support.pattern_check import refuse_undrivable

AT_A_TIME: Final = {"single": 1, "opposite_pairs": 2, "thirds": 3, "quadrants": 4}
START_M: Final = 0.5
"""Least distance from the rim to any surface at the start."""


def random_robot(seed: int, *overrides: str) -> Settings:
    """Return the settings of a robot that can drive at all; every fourth has a ring that looks only ahead."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 390]))
    settings = load_settings("room", [f"cycle.rate_hz={rng.choice([10.0, 20.0, 40.0])}", *overrides])
    while True:
        radius_m = float(rng.uniform(0.08, 0.4))
        body = BodyConfig(
            radius_m=radius_m,
            speed_max_m_s=float(rng.uniform(0.2, 1.0)),
            turn_max_rad_s=float(rng.uniform(0.5, 3.0)),
            acceleration_max_m_s2=float(rng.uniform(0.1, 2.0)),
            turn_acceleration_max_rad_s2=float(rng.uniform(1.0, 6.0)),
            synchro=bool(seed % 4 != 3 and rng.random() < 0.3),
        )
        ring = _random_ring(rng, radius_m, looks_ahead=seed % 4 == 3)
        chosen = settings.model_copy(update={"ring": ring, "body": body})
        try:
            refuse_undrivable(chosen)
        except FiringError:
            continue
        return chosen


def _random_ring(rng: np.random.Generator, radius_m: float, *, looks_ahead: bool) -> RingConfig:
    count = int(rng.integers(3, 25))
    count, step_deg = (min(count, 7) | 1, float(rng.uniform(15.0, 40.0))) if looks_ahead else (count, 360.0 / count)
    # Half of the rings have beams that just touch; the others' overlap, or leave gaps.
    width = float(rng.choice([1.0, 1.0, rng.uniform(1.0, 1.8), rng.uniform(0.6, 1.0)]))
    first = -(count // 2) if looks_ahead else 0
    angles = [step_deg * (first + i) for i in range(count)]
    presets = [name for name, times in AT_A_TIME.items() if count % times == 0 and (times == 1 or not looks_ahead)]
    return RingConfig.model_validate(
        {
            "sensors": [
                {
                    "x_m": 0.9 * radius_m * math.cos(math.radians(angle)),
                    "y_m": 0.9 * radius_m * math.sin(math.radians(angle)),
                    "angle_deg": angle,
                }
                for angle in angles
            ],
            "beam_half_angle_deg": min(80.0, 0.5 * step_deg * width),
            "resolution_m": float(rng.choice([0.0, 0.003, 0.03])),
            "range_min_m": 0.02,
            "range_max_m": float(rng.uniform(2.5, 8.0)),
            "firing": {"preset": str(rng.choice(presets)), "step_period_s": float(rng.uniform(0.02, 0.06))},
        }
    )


def random_furnished_room(seed: int, settings: Settings) -> WorldConfig:
    """Return a closed room with drums and boxes, whose surfaces are mirrors for odd seeds, and a start in it."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 391]))
    width_m, depth_m = rng.uniform(5.0, 10.0), rng.uniform(5.0, 10.0)
    skew = rng.uniform(-0.8, 0.8, (4, 2))
    corners = (np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (0.5 * width_m, 0.5 * depth_m) + skew).tolist()
    walls = tuple(
        WallConfig(x1_m=a[0], y1_m=a[1], x2_m=b[0], y2_m=b[1])
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)
    )
    inner = 0.4 * width_m, 0.4 * depth_m
    places = rng.uniform(np.negative(inner), inner, (4, 2)).tolist()
    drums = tuple(DrumConfig(x_m=x, y_m=y, radius_m=float(rng.uniform(0.1, 0.4))) for x, y in places[:2])
    boxes = tuple(
        BoxConfig(x_m=x, y_m=y, width_m=0.6, depth_m=0.4, angle_deg=float(rng.uniform(0.0, 180.0)))
        for x, y in places[2:]
    )
    acoustics = AcousticsConfig(
        model="specular" if seed % 2 else "cone", noise_relative=0.01, noise_m=0.003, dropout=0.03
    )
    world = WorldConfig(wall=walls, drum=drums, box=boxes, acoustics=acoustics)
    scene, room_m = compile_scene(world), settings.body.radius_m + START_M
    while True:
        x, y = rng.uniform(np.negative(inner), inner).tolist()
        is_inside = any(math.dist((x, y), (box.x_m, box.y_m)) < START_M for box in boxes)
        if not is_inside and clearance(x, y, scene.circles, scene.segments) > room_m:
            start = StartConfig(x_m=x, y_m=y, heading_deg=float(rng.uniform(0.0, 360.0)))
            return world.model_copy(update={"start": start})
