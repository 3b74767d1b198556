"""Random closed rooms without a drum: four slanting walls and two boxes, or these and clutter.

What is reported as a drum there is false. Clutter is posts, barrels and three-sided pieces, none of a drum's radius.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from bench.trials.furnished_rooms import FurnishedRoom
from config.units import FOOT_M
from config.world import AcousticsConfig, BoxConfig, DrumConfig, PolygonConfig, WallConfig, WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene

NOISE_RELATIVE: Final = 0.003
WIDTH_M: Final = (5.0, 8.0)
DEPTH_M: Final = (4.0, 6.0)
SKEW_M: Final = 1.2 * FOOT_M
"""Greatest shift of a corner along either axis."""
BOXES: Final = 2
BOX_M: Final = (0.3, 0.95)
"""Sides of a box: too short for the ring to be clear of all of them inside."""
CLUTTER: Final = (3, 6)
"""Least and greatest number of pieces."""
POST_M: Final = (0.03, 0.2)
BARREL_M: Final = (0.42, 0.7)
PIECE_M: Final = (0.1, 0.45)
"""Radii of posts and barrels, and distances of a piece's corners from its middle. A drum's radius is .305 m."""
APART_M: Final = 0.05
"""Least distance between two objects, and from a wall."""
MIDDLE_M: Final = 0.6
"""Free room about the middle, so that the drive has a place to begin."""


def drumless_room(
    seed: int,
    acoustics: AcousticsConfig,
    is_cluttered: bool,
    spans_m: tuple[tuple[float, float], tuple[float, float]] = (WIDTH_M, DEPTH_M),
) -> FurnishedRoom:
    """Return a room.

    Parameters
    ----------
    seed : int
        Which room.
    acoustics : AcousticsConfig
        Its acoustics.
    is_cluttered : bool
        Whether clutter stands in it besides the boxes.
    spans_m : tuple of tuple of float
        Least and greatest width and depth.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 16]))
    width_m, depth_m, turn_rad = (float(rng.uniform(*span)) for span in (*spans_m, (-math.pi, math.pi)))
    room = FurnishedRoom(WorldConfig(acoustics=acoustics), width_m, depth_m, turn_rad)
    corners = [
        np.array(room.place(a, b)) + rng.uniform(-SKEW_M, SKEW_M, 2)
        for a, b in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
    ]
    walls = tuple(
        WallConfig(x1_m=float(a[0]), y1_m=float(a[1]), x2_m=float(b[0]), y2_m=float(b[1]))
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)
    )
    world = room.world.model_copy(update={"wall": walls})
    pieces = BOXES + (int(rng.integers(*CLUTTER, endpoint=True)) if is_cluttered else 0)
    for k in range(pieces):
        world = _with_piece(rng, room, world, is_box=k < BOXES)
    return FurnishedRoom(world, width_m, depth_m, turn_rad)


def _with_piece(
    rng: np.random.Generator, room: FurnishedRoom, world: WorldConfig, *, is_box: bool
) -> WorldConfig:  # fmt: skip
    """Return the world with one more box, or piece of clutter."""
    scene = compile_scene(world)
    while True:
        x, y = room.place(*rng.uniform(-0.5, 0.5, 2).tolist())
        kind, piece, reach = _box(rng, x, y) if is_box else _clutter(rng, x, y)
        if math.hypot(x, y) < reach + MIDDLE_M:
            continue
        if clearance(x, y, scene.circles, scene.segments) < reach + APART_M:
            continue
        return world.model_copy(update={kind: (*getattr(world, kind), piece)})


def _box(rng: np.random.Generator, x: float, y: float) -> tuple[str, BoxConfig, float]:
    """Return the list of the world that a box goes to, the box, and how far it reaches from (x, y), m."""
    width, depth = rng.uniform(*BOX_M, 2).tolist()
    angle = float(rng.uniform(0.0, 90.0))
    box = BoxConfig(x_m=x, y_m=y, width_m=width, depth_m=depth, angle_deg=angle)
    return "box", box, 0.5 * math.hypot(width, depth)


def _clutter(
    rng: np.random.Generator, x: float, y: float
) -> tuple[str, DrumConfig | PolygonConfig, float]:  # fmt: skip
    """Return the same of a post, a barrel or a three-sided piece."""
    kind = int(rng.integers(3))
    if kind < 2:
        radius = float(rng.uniform(*(POST_M, BARREL_M)[kind]))
        return "drum", DrumConfig(x_m=x, y_m=y, radius_m=radius), radius
    angles = float(rng.uniform(0.0, 2.0 * math.pi)) + np.array([0.0, 1.0, 2.0]) * 2.0 * math.pi / 3.0
    radii = rng.uniform(*PIECE_M, 3)
    vertices = zip((x + radii * np.cos(angles)).tolist(), (y + radii * np.sin(angles)).tolist(), strict=True)
    return "polygon", PolygonConfig(vertices_m=tuple(vertices)), float(radii.max())
