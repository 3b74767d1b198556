"""Random rooms of walls for localisation: polygons of four to eight walls, 3 to 8 m across, and a stand in each.

A third are L- and T-shaped with right angles; the others have walls at any angle. Each seed gives one room.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from config.world import AcousticsConfig, PolygonConfig, WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene
from drivers.messages import Floats, Pose

ACOUSTICS: Final = AcousticsConfig(model="specular", noise_relative=0.01, dropout=0.05, outliers=0.03)

ACROSS_M: Final = (3.0, 8.0)
WALL_MIN_M: Final = 0.6
CLEAR_MIN_M: Final = 0.55
"""Least distance of the stand from a wall; the ring's radius is .381 m."""
CORNER_MIN_RAD: Final = math.radians(30.0)
"""Least angle between two walls that meet, and least bend from straight on."""


def random_room(seed: int, acoustics: AcousticsConfig = ACOUSTICS) -> tuple[WorldConfig, Pose]:
    """Return a room and a stand in it: the pose of the ring.

    Parameters
    ----------
    seed : int
        Which room.
    acoustics : AcousticsConfig
        By default specular, with 1 % noise, 3 % outliers and 5 % drop-outs.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 13]))
    while True:
        vertices = _right_angled(rng) if seed % 3 == 0 else _star(rng)
        across = float(max(math.dist(a, b) for a in vertices for b in vertices))
        vertices = vertices * (rng.uniform(*ACROSS_M) / across)
        if not _is_room(vertices) or (seed % 3 and not _is_inside(vertices, 0.0, 0.0)):
            continue
        turn = rng.uniform(-math.pi, math.pi)
        vertices = vertices @ np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        corners = tuple((float(a), float(b)) for a, b in vertices)
        world = WorldConfig(polygon=(PolygonConfig(vertices_m=corners),), acoustics=acoustics)
        scene = compile_scene(world)
        for _ in range(50):
            x, y = rng.uniform(vertices.min(axis=0), vertices.max(axis=0)).tolist()
            if _is_inside(vertices, x, y) and clearance(x, y, scene.circles, scene.segments) > CLEAR_MIN_M:
                return world, Pose(x, y, float(rng.uniform(-math.pi, math.pi)))


def _star(rng: np.random.Generator) -> Floats:
    """Return a polygon of four to eight corners, at any angles."""
    count = int(rng.integers(4, 9))
    angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, count))
    radii = rng.uniform(0.4, 1.0, count)
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])


def _right_angled(rng: np.random.Generator) -> Floats:
    """Return an L-shaped or a T-shaped room."""
    w, h = rng.uniform(0.6, 1.0, 2)
    a, b = rng.uniform(0.3, 0.7, 2) * (w, h)
    if rng.random() < 0.5:
        return np.array([(0, 0), (w, 0), (w, b), (a, b), (a, h), (0, h)])
    c = a * rng.uniform(0.2, 0.8)
    d = c + rng.uniform(0.3, 0.6) * (w - c)
    return np.array([(0, 0), (w, 0), (w, b), (d, b), (d, h), (c, h), (c, b), (0, b)])


def _is_room(vertices: Floats) -> bool:
    """Return whether a polygon keeps the limits on its walls and angles, and no two of its walls cross."""
    after = np.roll(vertices, -1, axis=0) - vertices
    before = np.roll(after, 1, axis=0)
    bend = np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1))
    round_once = abs(float(bend.sum()) - 2.0 * math.pi) < 1e-6
    angles = (np.abs(bend) > CORNER_MIN_RAD).all() and (np.abs(bend) < math.pi - CORNER_MIN_RAD).all()
    return bool(round_once and angles and np.hypot(*after.T).min() > WALL_MIN_M)


def _is_inside(vertices: Floats, x: float, y: float) -> bool:
    ax, ay = (vertices - (x, y)).T
    bx, by = np.roll(ax, -1), np.roll(ay, -1)
    turns = np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
    return bool(abs(turns.sum()) > math.pi)
