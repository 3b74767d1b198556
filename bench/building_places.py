"""The place without a map in real buildings: worlds of a laser's walls, driven along the laser's way and back.

The ring is that of `bench.laser_rooms`; it fires every 0.1 m of way, or 0.15 rad of a turn on the spot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from bench.laser_rooms import RING, LaserLog, read_carmen, walls_around, world_walls
from bench.real_places import followed, place_errors
from bench.real_rooms import Row
from bench.trials.known_room_trials import drifting_odometry
from config.load import load_settings
from config.world import AcousticsConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Floats, Pose, wrap_angle

WAY_M: Final = 110.0
"""Of the way out."""
STEP_M: Final = 0.1
STEP_RAD: Final = 0.15
CARRIED_M: Final = 4.0
"""Scans farther apart than this are not of one drive."""
AROUND_M: Final = 8.0
"""Walls so far from the way are heard."""
FIRING_S: Final = 0.3


def measure(logs: Iterable[Path], starts: int, tell: Callable[[str], None]) -> dict[str, Row]:
    """Follow so many drives in each building, among cones and among mirrors; return errors in m and shares."""
    rows: dict[str, Row] = {}
    settings = load_settings(None).model_copy(update={"ring": RING})
    for file in logs:
        log = read_carmen(file)
        walls = world_walls(log)
        for k in range(starts):
            truth = way_out_and_back(log, k * len(log.poses) // (2 * starts))
            for acoustics in (AcousticsConfig(model="cone"), AcousticsConfig(model="specular")):
                name = f"{file.name.split('.')[0]} {k + 1}, {acoustics.model}"
                tell(name)
                firings = drive(walls, truth, acoustics, k)
                odometry = np.array([(one.pose.x, one.pose.y, one.pose.theta) for one in firings])
                rows[name] = {"firings": len(firings), **place_errors(followed(settings, firings), odometry, truth)}
    return rows


def way_out_and_back(log: LaserLog, first: int) -> Floats:
    """Return the poses of a drive along the laser's way from a scan on, and back, shape (n, 3), m and rad."""
    places, way = [log.poses[first, :2]], 0.0
    for a, b in pairwise(log.poses[first:, :2]):
        apart = math.dist(a, b)
        if way >= WAY_M or apart > CARRIED_M:
            break
        steps = round(apart / STEP_M)
        places += [a + (b - a) * (k + 1) / steps for k in range(steps)]
        way += apart
    line = np.concatenate([places, places[-2::-1]])
    headings = np.arctan2(*np.gradient(line, axis=0)[:, ::-1].T)
    poses = [(*line[0], headings[0])]
    for (x, y), heading in zip(line[1:].tolist(), headings[1:].tolist(), strict=True):
        before_x, before_y, before = poses[-1]
        turn = wrap_angle(heading - before)
        count = math.ceil(abs(turn) / STEP_RAD)
        poses += [(before_x, before_y, before + turn * (k + 1) / count) for k in range(count - 1)]
        poses.append((x, y, before + turn))
    return np.array(poses)


def drive(walls: Floats, truth: Floats, acoustics: AcousticsConfig, seed: int) -> list[Firing]:
    """Return the firings along a way, with odometry that drifts.

    Parameters
    ----------
    walls : (n, 4) float
        The building's, m.
    truth : (k, 3) float
        The poses.
    acoustics : AcousticsConfig
        How the walls answer.
    seed : int
        Of odometry's errors and of the acoustics.
    """
    low, high = truth[:, :2].min(axis=0) - AROUND_M, truth[:, :2].max(axis=0) + AROUND_M
    scene = compile_scene(WorldConfig(wall=walls_around(walls, low, high), acoustics=acoustics))
    sonar = Sonar(RING, scene, acoustics, np.random.default_rng(np.random.SeedSequence([seed, 42])))
    reported = drifting_odometry(truth, np.random.default_rng(np.random.SeedSequence([seed, 43])))
    return [
        Firing(FIRING_S * k, pose, pose.theta, sonar.fire(Pose(*true), true[2], range(len(RING.mounts))))
        for k, (pose, true) in enumerate(zip(reported, truth.tolist(), strict=True))
    ]
