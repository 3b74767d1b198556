"""One sensor on a servo: what a stand shows of drums and walls, and the drums of the paper's hall by a drive."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from operator import itemgetter
from typing import Final

import numpy as np

from config.load import load_settings
from config.robot import RingConfig
from config.settings import Settings
from config.units import FOOT_M
from config.world import AcousticsConfig, DrumConfig, WallConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, sensors
from drivers.messages import Firing, Floats, Pose
from perception.pipeline import Perception
from perception.stand import surfaces_of_stand
from runtime.simulation.open_loop import match_objects, perceive
from runtime.simulation.scenes import FROM_FT, TO_FT, halls

SPEED_M_S: Final = 0.15
ROUNDS: Final = 4
NOISE_M: Final = 0.002
NEAR_M: Final = 0.15
"""A surface found this near to the nearest point of a true one is that one."""
STANDS: Final = ("servo1", "denning")
MODELS: Final = ("specular", "cone")
DRUMS: Final = 2
RANGE_M: Final = (0.5, 1.4)
"""From the robot to the nearest points of drums and walls."""
APART: Final = math.radians(60.0)
"""Between the bearings of two of them at least, so that none hides another."""


def stand_scene(seed: int, model: str) -> tuple[WorldConfig, list[complex]]:
    """Return a world of two drums and two walls about a stand at the origin, and their nearest points, m."""
    rng = np.random.default_rng([seed, 43])
    bearings = rng.uniform(0.0, math.tau) + np.arange(4) * math.tau / 4 + rng.uniform(-0.1, 0.1, 4)
    ranges = rng.uniform(*RANGE_M, 4)
    # Walls opposite each other, and far enough from their ends that they have a nearest point.
    ranges[1::2] = RANGE_M[1] + rng.uniform(-0.2, 0.1, 2)
    points = ranges * np.exp(1j * bearings)
    drums, walls = [], []
    for k, point in enumerate(points):
        away = point / abs(point)
        if k % 2 == 0:
            radius = float(rng.uniform(0.15, 0.3))
            centre = point + radius * away
            drums.append(DrumConfig(x_m=centre.real, y_m=centre.imag, radius_m=radius))
        else:
            one, two = point + 0.8j * away, point - 0.8j * away
            walls.append(WallConfig(x1_m=one.real, y1_m=one.imag, x2_m=two.real, y2_m=two.imag))
    acoustics = AcousticsConfig.model_validate({"model": model, "noise_m": NOISE_M})
    return WorldConfig(drum=tuple(drums), wall=tuple(walls), acoustics=acoustics), points.tolist()


def fire(ring: RingConfig, world: WorldConfig, poses: Floats, seed: int) -> list[Firing]:
    """Return the firings of the pattern at poses, shape (n, 2): x, y (m), by a robot that looks along x."""
    sonar = Sonar(ring, compile_scene(world), world.acoustics, np.random.default_rng([seed, 44]))
    pattern = firing_pattern(ring)
    firings = []
    for k, (x, y) in enumerate(poses.tolist()):
        pose, mask = Pose(x, y, 0.0), pattern.masks[k % len(pattern.masks)]
        firings.append(Firing(k * pattern.step_period_s, pose, 0.0, sonar.fire(pose, 0.0, sensors(mask))))
    return firings


def measure_stands(seeds: Iterable[int], report: Callable[[str], None]) -> dict[str, dict[str, float]]:
    """Return the figures of stands, by robot and model of the reflection."""
    rows, seeds = {}, tuple(seeds)
    for robot in STANDS:
        ring = load_settings("room", robot=robot).ring
        for model in MODELS:
            found, false, errors, turns, total = 0, 0, list[float](), list[float](), 0
            for seed in seeds:
                report(f"stand: {robot}, {model}, {seed}")
                world, points = stand_scene(seed, model)
                still = np.zeros((ROUNDS * len(firing_pattern(ring).masks), 2))
                places = [
                    complex(*one.place(Pose(0.0, 0.0, 0.0)))
                    for one in surfaces_of_stand(ring, fire(ring, world, still, seed))
                ]
                for point in points:
                    near = [(abs(place - point), place) for place in places if abs(place - point) < NEAR_M]
                    found += bool(near)
                    if near:
                        _, best = min(near, key=itemgetter(0))
                        errors.append(abs(abs(best) - abs(point)))
                        turns.append(abs(math.degrees(np.angle(best / point))))
                false += sum(min(abs(place - point) for point in points) >= NEAR_M for place in places)
                total += len(points)
            rows[f"stand: {robot}, {model}"] = {
                "surfaces": total,
                "found": found,
                "false": false,
                "range, mm": 1e3 * float(np.mean(errors)) if errors else math.nan,
                "bearing, °": float(np.mean(turns)) if turns else math.nan,
            }
    return rows


def measure_drives(seeds: Iterable[int], report: Callable[[str], None]) -> dict[str, dict[str, float]]:
    """Return the figures of drives at .15 m/s through halls whose drums were moved, by model of the reflection."""
    rows = {}
    settings: Settings = load_settings("hallway", ["perception.method=bayes"], robot="servo1").of_log()
    step_m = SPEED_M_S * settings.ring.firing.step_period_s
    xs = np.arange(FROM_FT * FOOT_M, TO_FT * FOOT_M, step_m)
    poses = np.column_stack([xs, np.zeros(len(xs))])
    for model in MODELS:
        total, found, false, errors = 0, 0, 0, list[float]()
        for seed in seeds:
            for number, hall in enumerate(halls("moved", seed)):
                report(f"drive: {model}, seed {seed}, hall {number}")
                acoustics = AcousticsConfig.model_validate({"model": model, "noise_m": NOISE_M})
                world = hall.world.model_copy(update={"acoustics": acoustics})
                perception = Perception(settings.ring, settings.models, settings.perception)
                for firing in fire(settings.ring, world, poses, seed + number):
                    seen = perceive(perception, firing)
                drums, _, wrong = match_objects(world, seen, settings.models)
                total += len(drums)
                found += sum(row["error"] is not None for row in drums)
                false += wrong
                errors += [row["error"] / FOOT_M for row in drums if row["error"] is not None]
        rows[f"drive: servo1, {model}"] = {
            "drums": total,
            "found": found,
            "false": false,
            "error, ft": float(np.mean(errors)) if errors else math.nan,
            "worst, ft": max(errors, default=math.nan),
        }
    return rows
