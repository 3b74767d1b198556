"""What listening sensors change in the halls: first sure fixes, wrong names on the way, drums found, cost.

The robot drives as in `runtime.simulation.scenes`, but its ring fires by its own pattern, a step at a time.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Final

import numpy as np

from config.load import load_robot, load_settings
from config.robot import RingConfig
from config.settings import Settings
from config.units import FOOT_M
from config.world import DrumConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import cross_pairs, firing_pattern, sensors
from drivers.messages import CrossPaths, Firing, Pose
from perception.bayes.memory.parameters import NAMED_SIGMA_MAX_M
from perception.detected_object import DetectedObject
from perception.pipeline import Perception
from runtime.simulation.evaluation import GATE_M
from runtime.simulation.first_fix import EARLY_FIX_M, ROUNDING_M, FirstFixTracker
from runtime.simulation.open_loop import RADIUS_TOLERANCE_M, match_objects, perceive
from runtime.simulation.scene_names import SceneName
from runtime.simulation.scenes import FROM_FT, SPEED_M_S, TO_FT, Hall, halls

FLAT: Final = ("wall", "inside corner")
"""Objects that have no centre."""
SCENES: Final[tuple[SceneName, ...]] = ("moved", "noisy", "jit10", "halls")


def rings() -> dict[str, RingConfig]:
    """Return the rings that are compared: with listeners, the same without, and the Denning's, by name."""
    ears = load_robot("ears").ring
    deaf = ears.firing.model_copy(update={"listen": None, "listen_preset": None})
    return {
        "ears": ears,
        "ears, no listeners": ears.model_copy(update={"firing": deaf}),
        "denning": load_robot("denning").ring,
    }


def octets() -> dict[str, RingConfig]:
    """Return the ring with listeners that fires octets, the other sixteen listening, and the same without them."""
    ears = load_robot("ears").ring
    fired = {"sets": (tuple(range(0, 24, 3)),), "rotations": 3, "listen": None}
    return {
        name: ears.model_copy(update={"firing": ears.firing.model_copy(update={**fired, "listen_preset": preset})})
        for name, preset in (("16 listeners", "neighbours"), ("no listeners", None))
    }


def poses(hall: Hall, step_s: float) -> Iterator[tuple[float, Pose, float]]:
    """Yield time (s), pose and direction of the ring (rad) at every step of the firing pattern.

    Parameters
    ----------
    hall
        The hall. Between the points of its path the robot drives straight.
    step_s
        Seconds between two firings.
    """
    path = np.array(hall.path or ((FROM_FT * FOOT_M, 0.0, 0.0), (TO_FT * FOOT_M, 0.0, 0.0)))
    driven = np.concatenate([[0.0], np.hypot(*np.diff(path[:, :2], axis=0).T).cumsum()])
    yaw = np.unwrap(path[:, 2])
    for k in range(int(driven[-1] / SPEED_M_S / step_s) + 1):
        at = SPEED_M_S * step_s * k
        x, y, turned = (float(np.interp(at, driven, column)) for column in (path[:, 0], path[:, 1], yaw))
        yield step_s * k, Pose(x, y, 0.0), turned


def firings(ring: RingConfig, hall: Hall, seed: int) -> Iterator[Firing]:
    """Yield what a ring hears that fires by its own pattern on a drive through a hall, at exact poses.

    Parameters
    ----------
    ring
        The sensors and their pattern.
    hall
        The world and the path.
    seed
        Of the noise.
    """
    acoustics = hall.world.acoustics
    sonar = Sonar(
        ring, compile_scene(hall.world), acoustics, np.random.default_rng(np.random.SeedSequence([seed, 1]))
    )
    pattern, axes = firing_pattern(ring), tuple(mount.angle_rad for mount in ring.mounts)
    listening = pattern.listeners or (0,) * len(pattern.masks)
    for k, (t_s, pose, yaw) in enumerate(poses(hall, pattern.step_period_s)):
        fired, heard = pattern.masks[k % len(pattern.masks)], listening[k % len(pattern.masks)]
        found = sonar.fire(pose, yaw, sensors(fired), None, sensors(heard))
        ranges, paths = np.full(len(found), math.nan), None
        ranges[list(sensors(fired))] = found[list(sensors(fired))]
        if heard:
            pairs = np.array(cross_pairs(axes, fired, heard), np.int64)
            paths = CrossPaths(pairs[:, 0].copy(), pairs[:, 1].copy(), found[pairs[:, 1]])
        yield Firing(t_s, pose, yaw, ranges, paths)


def is_drum(one: DetectedObject, drums: Sequence[DrumConfig], radii: Sequence[float]) -> bool:
    """Return whether a drum of one of these radii (m) stands where an object was reported."""
    return any(
        math.dist((one.x, one.y), (drum.x_m, drum.y_m)) <= GATE_M
        and any(abs(drum.radius_m - radius) <= RADIUS_TOLERANCE_M for radius in radii)
        for drum in drums
    )


def early_percent(fixes: Sequence[float | None]) -> float:
    """Return how many of the first fixes (m before the drum) are early ones, per cent; NaN without any."""
    early = [fix is not None and fix >= EARLY_FIX_M - ROUNDING_M for fix in fixes]
    return 100.0 * float(np.mean(early)) if early else math.nan


def is_placed(one: DetectedObject) -> bool:
    """Return whether the place of an object is as sure as that of a named drum must be, whatever its kind."""
    return one.model not in FLAT and one.sigma <= NAMED_SIGMA_MAX_M


def measure(
    name: SceneName, settings: Settings, seeds: Sequence[int], tell: Callable[[str], None]
) -> dict[str, float]:
    """Return the figures of one scene with one ring.

    Parameters
    ----------
    name, settings, seeds
        The scene, the ring with models and perception, and the seeds.
    tell
        Called with each step.
    """
    fixes: list[float | None] = []
    placed: list[float | None] = []
    took_ms: list[float] = []
    radii = [model.arc_radius_m for model in settings.models if model.arc_radius_m is not None]
    there = found = false = wrong = drives = 0
    for seed in seeds:
        for i, hall in enumerate(halls(name, seed)):
            tell(f"{name} {seed}.{i}")
            perception = Perception(settings.ring, settings.models, settings.perception)
            drums = () if hall.path else hall.world.drum
            tracker, places = FirstFixTracker(drums), FirstFixTracker(drums)
            names, seen = set[int | None](), tuple[DetectedObject, ...]()
            for firing in firings(settings.ring, hall, 1000 * seed + i):
                begin_s = time.thread_time()
                seen = perceive(perception, firing)
                took_ms.append(1e3 * (time.thread_time() - begin_s))
                tracker.update(float(firing.pose.x), seen)
                if drums:
                    places.update(float(firing.pose.x), filter(is_placed, perception.labelled_objects()))
                names |= {one.number for one in seen if not is_drum(one, hall.world.drum, radii)}
            rows, _, more = match_objects(hall.world, seen, settings.models)
            fixes += tracker.fixes()
            placed += places.fixes()
            there, found = there + len(rows), found + sum(row["estimate"] is not None for row in rows)
            false, wrong, drives = false + more, wrong + len(names), drives + 1
    return {
        "halls": drives, "drums": there, "found": found, "false": false,
        "4 ft before %": early_percent(fixes), "placed by then %": early_percent(placed),
        "median ft": float(np.median([fix for fix in fixes if fix is not None])) / FOOT_M if fixes else math.nan,
        "wrong names a hall": wrong / drives, "firing ms, p50": float(np.median(took_ms)),
        "mean": float(np.mean(took_ms)),
    }  # fmt: skip


def costs(name: SceneName, seeds: Sequence[int]) -> dict[str, dict[str, float]]:
    """Return the processor time of a firing of eight sensors with sixteen listeners and without, ms.

    Both drive through a hall together and take turns, firing by firing, so that a slow spell counts for both.

    Parameters
    ----------
    name, seeds
        The scene and the seeds; of a scene of many halls the first one counts.
    """
    took_ms: dict[str, list[float]] = {}
    for seed in seeds:
        hall = halls(name, seed)[0]
        drives = []
        for with_listeners, ring in octets().items():
            settings = settings_of(ring)
            perception = Perception(settings.ring, settings.models, settings.perception)
            took = took_ms.setdefault(f"{name}, {with_listeners}", [])
            drives.append((perception, took, firings(ring, hall, 1000 * seed)))
        is_over = False
        while not is_over:
            for perception, took, coming in drives:
                if (firing := next(coming, None)) is None:
                    is_over = True
                    continue
                begin_s = time.thread_time()
                perceive(perception, firing)
                took.append(1e3 * (time.thread_time() - begin_s))
    return {
        name: {"firings": len(took), "ms, p50": float(np.median(took)), "mean": float(np.mean(took)),
               "p99": float(np.percentile(took, 99.0))}
        for name, took in took_ms.items()
    }  # fmt: skip


def settings_of(ring: RingConfig, sure: float | None = None) -> Settings:
    """Return the settings of the halls with another ring, and the probability from which on models are reported."""
    options = [] if sure is None else [f"perception.bayes.report_probability{near}={sure}" for near in ("", "_near")]
    return load_settings("hallway", ["perception.method=bayes", *options]).model_copy(update={"ring": ring})
