"""What one stand of the ring shows of a surface: its kind, its place and its direction, in random scenes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Final, Literal, TypeAlias

import numpy as np

from config.robot import RingConfig
from config.world import AcousticsConfig, BoxConfig, DrumConfig, WallConfig, WorldConfig
from drivers.emulator.acoustics import CONVEX_EDGE_REACH_M
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import cross_pairs, firing_pattern, sensors
from drivers.messages import Pose
from perception.echo_kind import EchoKind, echo_kind

Scene: TypeAlias = Literal["wall", "corner", "edge", "drum", "post"]
SCENES: Final[tuple[Scene, ...]] = ("wall", "corner", "edge", "drum", "post")
RIGHT: Final = {
    "wall": {"plane"},
    "corner": {"corner"},
    "edge": {"edge", "convex"},
    "drum": {"cylinder", "convex"},
    "post": {"cylinder", "edge", "convex"},
}
"""Kinds that name a scene rightly. A post is an edge but for its radius; `convex` leaves open which of them it is."""
NEAR_M, FAR_M = 0.5, 3.0
TENTH_FT_M: Final = 0.03048
GATE_M: Final = 0.06
"""Half paths that differ by more from those over a point in the surface's direction are of another surface. A wall's
differ by 4 cm at the shortest range and the longest baseline."""
NEAR_BEARING: Final = math.radians(24.0)


def world_of(scene: Scene, bearing: float, range_m: float, noise_m: float, rng: np.random.Generator) -> WorldConfig:
    """Return a world with one surface whose nearest point lies at this bearing and range from the origin."""
    acoustics = AcousticsConfig(model="specular", noise_m=noise_m)
    c, s = math.cos(bearing), math.sin(bearing)
    x, y = range_m * c, range_m * s
    if scene == "wall":
        wall = WallConfig(x1_m=x - 4 * s, y1_m=y + 4 * c, x2_m=x + 4 * s, y2_m=y - 4 * c)
        return WorldConfig(wall=(wall,), acoustics=acoustics)
    if scene == "corner":
        turned = [bearing + math.pi + way * math.pi / 4 for way in (-1, 1)]
        walls = (WallConfig(x1_m=x, y1_m=y, x2_m=x + 4 * math.cos(t), y2_m=y + 4 * math.sin(t)) for t in turned)
        return WorldConfig(wall=tuple(walls), acoustics=acoustics)
    if scene == "edge":
        side = 0.6
        centre = range_m + side * math.sqrt(0.5)
        degrees = math.remainder(math.degrees(bearing) + 45.0, 360.0)
        box = BoxConfig(x_m=centre * c, y_m=centre * s, width_m=side, depth_m=side, angle_deg=degrees)
        return WorldConfig(box=(box,), acoustics=acoustics)
    radius = float(rng.uniform(0.25, 0.35)) if scene == "drum" else float(rng.uniform(0.03, 0.08))
    drum = DrumConfig(x_m=(range_m + radius) * c, y_m=(range_m + radius) * s, radius_m=radius)
    return WorldConfig(drum=(drum,), acoustics=acoustics)


def hear(
    ring: RingConfig, world: WorldConfig, bearing: float, rounds: int, rng: np.random.Generator
) -> EchoKind | None:
    """Return what a stand of some rounds of the firing pattern says of the surface near a bearing."""
    sonar = Sonar(ring, compile_scene(world), world.acoustics, rng)
    pattern, mounts = firing_pattern(ring), ring.mounts
    axes = tuple(mount.angle_rad for mount in mounts)
    rows = []
    for fired, heard in list(zip(pattern.masks, pattern.listeners, strict=True)) * rounds:
        found = sonar.fire(Pose(0.0, 0.0, 0.0), 0.0, sensors(fired), None, sensors(heard))
        for j, i in [(i, i) for i in sensors(fired)] + list(cross_pairs(axes, fired, heard)):
            if math.isfinite(found[i]) and abs(math.remainder(axes[j] - bearing, 2 * math.pi)) <= NEAR_BEARING:
                rows.append((mounts[j].x_m, mounts[j].y_m, mounts[i].x_m, mounts[i].y_m, float(found[i])))
    readings = np.array(rows).reshape(-1, 5)
    if not len(readings):
        return None
    transmitters, listeners = readings[:, 0:2] @ [1.0, 1j], readings[:, 2:4] @ [1.0, 1j]
    towards = complex(math.cos(bearing), math.sin(bearing))
    own = readings[transmitters == listeners]
    if not len(own):
        return None
    ahead = own[np.argmax((transmitters[transmitters == listeners] * np.conj(towards)).real)]
    point = (complex(ahead[0], ahead[1]) * towards.conjugate()).real * towards + ahead[4] * towards
    expected = 0.5 * (abs(point - transmitters) + abs(point - listeners))
    readings = readings[abs(expected - readings[:, 4]) <= GATE_M + ring.resolution_m]
    noise_m, step_m = max(world.acoustics.noise_m, 1e-4), ring.resolution_m
    return echo_kind(readings[:, :2], readings[:, 2:4], readings[:, 4], noise_m, step_m)


def measure(
    ring: RingConfig, rounds: int, scenes: int, first: int, tell: Callable[[str], None]
) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """Return the confusion table, and the figures of all scenes.

    Parameters
    ----------
    ring
        The ring and its firing pattern.
    rounds
        Rounds of the firing pattern in a stand.
    scenes
        Scenes of each kind.
    first
        Seed of the first one.
    tell
        Called with each step.
    """
    counts: dict[str, Counter[str]] = {scene: Counter() for scene in SCENES}
    ranges, bearings, places, total, right, silent = [], [], [], 0, 0, 0
    for k in range(scenes):
        for scene in SCENES:
            tell(f"one stand: {scene} {k}")
            rng = np.random.default_rng([first + k, SCENES.index(scene)])
            bearing = float(rng.uniform(-math.pi, math.pi))
            reach = CONVEX_EDGE_REACH_M - 0.02 if scene == "edge" else FAR_M
            radius = ring.radius_m or 0.0
            range_m = radius + float(rng.uniform(NEAR_M, reach))
            found = hear(ring, world_of(scene, bearing, range_m, 1e-3, rng), bearing, rounds, rng)
            if found is None:
                silent += 1
                continue
            total += 1
            counts[scene][found.kind] += 1
            right += found.kind in RIGHT[scene]
            ranges.append(abs(found.range_m - range_m))
            bearings.append(abs(math.remainder(found.bearing - bearing, 2 * math.pi)))
            places.append(math.hypot(ranges[-1], range_m * bearings[-1]))
    unknown = sum(count["unknown"] for count in counts.values())
    figures = {
        "scenes": float(total), "too few readings": float(silent), "right %": 100.0 * right / total,
        "unknown %": 100.0 * unknown / total, "wrong %": 100.0 * (total - right - unknown) / total,
        "range mm": 1e3 * float(np.median(ranges)), "place mm": 1e3 * float(np.median(places)),
        "bearing °": math.degrees(float(np.median(bearings))),
    }  # fmt: skip
    kinds = ("plane", "corner", "edge", "cylinder", "convex", "unknown")
    return {scene: {kind: float(counts[scene][kind]) for kind in kinds} for scene in SCENES}, figures
