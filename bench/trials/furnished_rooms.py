"""Random rooms with doorways and drums, and drives through them, on which the mapping of walls is evaluated.

A room is a skewed rectangle at any angle; half of its walls have a doorway that stands open, and up to three drums
stand inside. Each seed gives one room and one drive: legs between random places, straight in even rooms, swerving in
odd ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from config.units import FOOT_M
from config.world import AcousticsConfig, DrumConfig, WallConfig, WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import Scene, compile_scene
from drivers.messages import Floats

ACOUSTICS: Final = AcousticsConfig(
    model="specular", noise_relative=0.01, dropout=0.05, outliers=0.03, outlier_max_m=15.0 * FOOT_M
)
WIDTH_M: Final = (10.0 * FOOT_M, 22.0 * FOOT_M)
DEPTH_M: Final = (10.0 * FOOT_M, 16.0 * FOOT_M)
SKEW_M: Final = 1.2 * FOOT_M
"""Greatest shift of a corner along either axis."""
OPENING_M: Final = (2.5 * FOOT_M, 3.5 * FOOT_M)
OPENING_FROM: Final = (0.25, 0.6)
"""Where a doorway begins, as a share of its wall."""
DRUM_RADIUS_M: Final = FOOT_M
DRUMS_MAX: Final = 3
DRUM_TO_WALL_M: Final = 0.9
DRUM_TO_DRUM_M: Final = 2.2 * FOOT_M + 0.9 - DRUM_RADIUS_M
"""Least distances from a drum's surface to a wall, and to another drum's centre: the robot passes between them."""
CLEAR_M: Final = 0.381 + 0.12
"""Least distance of the ring's centre from any surface: the ring's radius and some room."""
LEG_MIN_M: Final = 0.8
LEG_TRIES: Final = 50
"""Legs tried from a place before the drive begins again elsewhere."""
INNER: Final = 0.42
"""Places lie within this share of width and depth from the middle."""
SWERVE_M: Final = 0.1
SWERVE_WAVE_M: Final = 1.1
"""Amplitude and wavelength of a swerving leg."""


@dataclass(frozen=True, slots=True)
class FurnishedRoom:
    """A room, and the rectangle that it was made from.

    Attributes
    ----------
    world : WorldConfig
        Its walls, doorways left open, and its drums.
    width_m, depth_m, turn_rad : float
        The rectangle about the odometry's origin.
    """

    world: WorldConfig
    width_m: float
    depth_m: float
    turn_rad: float

    def place(self, across: float, along: float) -> tuple[float, float]:
        """Return the point (m) at these shares of width and depth from the middle."""
        x, y = across * self.width_m, along * self.depth_m
        c, s = math.cos(self.turn_rad), math.sin(self.turn_rad)
        return c * x - s * y, s * x + c * y


def furnished_room(seed: int, acoustics: AcousticsConfig = ACOUSTICS) -> FurnishedRoom:
    """Return a room.

    Parameters
    ----------
    seed : int
        Which room.
    acoustics : AcousticsConfig
        By default specular, with 1 % noise, 3 % outliers and 5 % drop-outs.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 14]))
    width_m, depth_m, turn_rad = (float(rng.uniform(*span)) for span in (WIDTH_M, DEPTH_M, (-math.pi, math.pi)))
    room = FurnishedRoom(WorldConfig(), width_m, depth_m, turn_rad)
    world = WorldConfig(wall=tuple(walls_with_openings(rng, room)), acoustics=acoustics)
    world = world.model_copy(update={"drum": _drums(rng, room, compile_scene(world))})
    return FurnishedRoom(world, width_m, depth_m, turn_rad)


def walls_with_openings(rng: np.random.Generator, room: FurnishedRoom) -> list[WallConfig]:
    """Return the walls of a skewed rectangle, counter-clockwise; half of them have a doorway.

    Parameters
    ----------
    rng : numpy.random.Generator
        Of the skew and the doorways.
    room : FurnishedRoom
        The rectangle.
    """
    corners = [
        np.array(room.place(a, b)) + rng.uniform(-SKEW_M, SKEW_M, 2)
        for a, b in ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
    ]
    walls: list[WallConfig] = []
    for begin, end in zip(corners, [*corners[1:], corners[0]], strict=True):
        walls += _wall_with_opening(rng, begin, end)
    return walls


def _wall_with_opening(rng: np.random.Generator, begin: Floats, end: Floats) -> list[WallConfig]:
    """Return a wall, or with equal probability the two parts of it beside a doorway."""
    length = float(np.hypot(*(end - begin)))
    cuts = [0.0, 1.0]
    if rng.random() < 0.5:
        opening = float(rng.uniform(*OPENING_FROM))
        cuts[1:1] = [opening, opening + float(rng.uniform(*OPENING_M)) / length]
    ends = [begin + cut * (end - begin) for cut in cuts]
    return [
        WallConfig(x1_m=float(a[0]), y1_m=float(a[1]), x2_m=float(b[0]), y2_m=float(b[1]))
        for a, b in zip(ends[::2], ends[1::2], strict=True)
    ]


def with_moved_wall(room: FurnishedRoom, off_m: float) -> FurnishedRoom:
    """Return a room whose first wall, both parts of it beside a doorway, stands farther out; its ends stay open.

    Parameters
    ----------
    room : FurnishedRoom
        The room.
    off_m : float
        How far the wall is moved, m; at least 0, so that no drum is in its way.
    """
    walls = room.world.wall
    ends = np.array([[[one.x1_m, one.y1_m], [one.x2_m, one.y2_m]] for one in walls])
    along = ends[0, 1] - ends[0, 0]
    out = np.array([along[1], -along[0]]) / np.hypot(*along)  # the corners run counter-clockwise
    is_part = (np.abs((ends - ends[0, 0]) @ out) < 1e-9).all(axis=1)
    ends += off_m * is_part[:, None, None] * out
    moved = tuple(WallConfig(x1_m=a[0], y1_m=a[1], x2_m=b[0], y2_m=b[1]) for a, b in ends.tolist())
    return replace(room, world=room.world.model_copy(update={"wall": moved}))


def _drums(rng: np.random.Generator, room: FurnishedRoom, scene: Scene) -> tuple[DrumConfig, ...]:
    """Return up to three drums with room to pass between them and the walls, none in the middle."""
    placed: list[tuple[float, float]] = []
    for _ in range(int(rng.integers(0, DRUMS_MAX + 1))):
        for _ in range(30):
            x, y = room.place(*rng.uniform(-0.5, 0.5, 2).tolist())
            is_clear = clearance(x, y, scene.circles, scene.segments) > DRUM_RADIUS_M + DRUM_TO_WALL_M
            is_apart = all(math.dist((x, y), other) > DRUM_TO_DRUM_M + DRUM_RADIUS_M for other in placed)
            if is_clear and is_apart and math.hypot(x, y) > DRUM_RADIUS_M:
                placed.append((x, y))
                break
    return tuple(DrumConfig(x_m=x, y_m=y, radius_m=DRUM_RADIUS_M) for x, y in placed)


def drive(room: FurnishedRoom, seed: int, step_m: float, length_m: float) -> Floats:
    """Return the poses of the ring at its firings: x, y (m) and direction (rad), shape (n, 3).

    Parameters
    ----------
    room : FurnishedRoom
        The room.
    seed : int
        Which drive.
    step_m : float
        Distance between firings.
    length_m : float
        Distance driven, at least.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 15]))
    scene = compile_scene(room.world)
    yaw = float(rng.uniform(-math.pi, math.pi))
    swerve = SWERVE_M if seed % 2 else 0.0
    here, driven, failed = _clear_place(rng, room, scene), 0.0, 0
    rows: list[Floats] = []
    while driven < length_m:
        failed += 1
        if failed > LEG_TRIES:  # hemmed in: begin elsewhere
            here, driven, failed, rows = _clear_place(rng, room, scene), 0.0, 0, []
        there = _clear_place(rng, room, scene)
        length = math.dist(here, there)
        steps = np.arange(0.0, length, step_m)
        if length < LEG_MIN_M:
            continue
        along = (np.array(there) - here) / length
        # The swerve fades at both ends, so that one leg goes on where the last one ended.
        sideways = swerve * np.sin(2.0 * math.pi * steps / SWERVE_WAVE_M) * np.minimum(1.0, 4.0 * (length - steps))
        leg = here + steps[:, None] * along + sideways[:, None] * np.array([-along[1], along[0]])
        if any(clearance(x, y, scene.circles, scene.segments) < CLEAR_M for x, y in leg.tolist()):
            continue
        rows.append(np.column_stack([leg, np.full(len(leg), yaw)]))
        here, driven, failed = there, driven + length, 0
    return np.concatenate(rows)


def _clear_place(rng: np.random.Generator, room: FurnishedRoom, scene: Scene) -> tuple[float, float]:
    """Return a place where the ring is clear of all surfaces."""
    while True:
        x, y = room.place(*rng.uniform(-INNER, INNER, 2).tolist())
        if clearance(x, y, scene.circles, scene.segments) >= CLEAR_M:
            return x, y
