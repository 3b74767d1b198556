"""Furnished, imperfect rooms: bent walls, doorways with frames, shelves, tables, chairs, people, mixed surfaces.

Rooms in which recognition is tuned and tested with what real ones have: a wall bends by 1 to 3 cm, shelves stand 10
cm before it, legs stand in the way of what is behind them, and each surface answers in its own way. A room has drums
or none; what is reported as a drum elsewhere is false.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from types import MappingProxyType
from typing import Final

import numpy as np

from bench.trials.furnished_rooms import DRUM_RADIUS_M, FurnishedRoom, walls_with_openings
from bench.trials.shortest_way import CELL_M, free_space, shortest_way
from config.world import AcousticsConfig, BoxConfig, DrumConfig, Surface, WallConfig, WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene
from drivers.messages import Floats

WIDTH_M: Final = (5.0, 10.0)
DEPTH_M: Final = (3.6, 6.0)
"""Sizes of rooms in which the ranges of a ring are spread as in real ones (`range_statistics`)."""
BEND_M: Final = (0.01, 0.03)
"""How far the middle of a wall is off its line: walls of real rooms that a laser saw bend so."""
FRAME_M: Final = (0.1, 0.16)
"""Sides of a doorway's frame, along its wall and across."""
BEFORE_WALL_M: Final = 0.1
"""How far the front of a shelf or a curtain stands before its wall."""
SHELF_DEPTH_M: Final = 0.06
SHELF_M: Final = (0.8, 2.0)
"""Length of a shelf or of a curtain."""
TABLE_M: Final = ((0.9, 1.6), (0.6, 0.9))
CHAIR_M: Final = ((0.36, 0.44), (0.36, 0.44))
"""Distances of legs along the two sides."""
LEG_M: Final = (0.012, 0.03)
PERSON_M: Final = (0.05, 0.07)
STANCE_M: Final = (0.18, 0.35)
"""Radius of a person's legs, and their distance."""
BOX_M: Final = (0.3, 0.8)
COUNTS: Final = MappingProxyType({"shelf": (1, 3), "curtain": (0, 1), "table": (1, 2), "chair": (2, 5),
                                  "person": (0, 2), "box": (1, 3)})  # fmt: skip
"""Least and greatest number of each kind."""
TO_DRUM_M: Final = 0.4
APART_M: Final = 0.1
"""Least distances of furniture from a drum, and from any other surface."""
DRUM_TO_WALL_M: Final = 0.3
DRUM_TO_DRUM_M: Final = 1.0
"""Least distances from a drum's surface to a wall and another drum's surface."""
CLEAR_M: Final = 0.381 + 0.05
"""Least distance of the ring's centre from any surface: the ring's radius and little room."""
PLACES: Final = 8
"""Of so many places the drive goes to the one farthest from where it has been."""
INSIDE: Final = 0.47
"""The drive stays within this share of width and depth from the middle: it does not leave by a doorway."""
MIDDLE_M: Final = 0.6
"""Free room about the middle, so that the drive has a place to begin."""
TRIES: Final = 200
"""Places tried for a piece before the room is made again, or the piece left out."""
MIXTURE: Final[tuple[Surface, ...]] = ("specular", "specular", "cone", "rays")
"""Surfaces of a mixed room, by their share."""

ERRORS: Final = MappingProxyType({"noise_relative": 0.01, "dropout": 0.03, "outliers": 0.01, "late": 0.2})
MIRROR_DROPOUT: Final = 0.07
"""Mirrors miss more. With these, ranges are silent, late and repeated as often as real ones (`range_statistics`)."""
JITTER: Final = MappingProxyType({"jitter_m": 0.03, "jitter_rad": math.radians(0.3)})
"""How far poses of real robots jump from one firing to the next."""
MODELS: Final[Mapping[str, Mapping[str, str | float]]] = MappingProxyType(
    {
        "ray": {"model": "rays", "rays": 1},
        "3 rays": {"model": "rays", "rays": 3},
        "10 rays": {"model": "rays", "rays": 10},
        "cone": {"model": "cone"},
        "mirrors": {"model": "specular", "dropout": MIRROR_DROPOUT},
        "mixture": {"model": "specular", "dropout": MIRROR_DROPOUT},
        "mixture, jitter": {"model": "specular", "dropout": MIRROR_DROPOUT, **JITTER},
    }
)
"""Acoustics by which a room is heard; in those of a mixture each object has a surface of its own."""


def imperfect_room(seed: int, model: str = "mixture", drums: int = 3) -> FurnishedRoom:
    """Return a room; its shape and furniture depend on the seed and the number of drums only.

    Parameters
    ----------
    seed : int
        Which room.
    model : str
        A name of `MODELS`.
    drums : int
        How many drums stand in it.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 41]))
    acoustics = AcousticsConfig.model_validate({**ERRORS, **MODELS[model]})
    while True:
        room = _empty_room(rng)
        world = _with_drums(rng, room, drums)
        if world is not None:
            break
    for kind, (least, most) in COUNTS.items():
        for _ in range(int(rng.integers(least, most, endpoint=True))):
            world = _with_piece(rng, room, world, kind)
    if model.startswith("mixture"):
        world = _with_surfaces(np.random.default_rng(np.random.SeedSequence([seed, 42])), world)
    world = world.model_copy(update={"acoustics": acoustics})
    return FurnishedRoom(world, room.width_m, room.depth_m, room.turn_rad)


def _empty_room(rng: np.random.Generator) -> FurnishedRoom:
    """Return a room of bent walls and doorways with their frames."""
    width_m, depth_m, turn_rad = (float(rng.uniform(*span)) for span in (WIDTH_M, DEPTH_M, (-math.pi, math.pi)))
    room = FurnishedRoom(WorldConfig(), width_m, depth_m, turn_rad)
    walls, frames = [], []
    for wall in walls_with_openings(rng, room):
        bend = float(rng.uniform(*BEND_M)) * (1.0 if rng.random() < 0.5 else -1.0)
        length = math.hypot(wall.x2_m - wall.x1_m, wall.y2_m - wall.y1_m)
        walls.append(wall.model_copy(update={"bend_m": bend if length > 10.0 * BEND_M[1] else 0.0}))
    ends = [(wall.x1_m, wall.y1_m) for wall in walls] + [(wall.x2_m, wall.y2_m) for wall in walls]
    for wall in walls:
        angle_deg = math.degrees(math.atan2(wall.y2_m - wall.y1_m, wall.x2_m - wall.x1_m))
        for x, y in ((wall.x1_m, wall.y1_m), (wall.x2_m, wall.y2_m)):
            if sum(math.dist((x, y), end) < 1e-6 for end in ends) == 1:  # at a doorway
                frames.append(
                    BoxConfig(x_m=x, y_m=y, width_m=FRAME_M[0], depth_m=FRAME_M[1], angle_deg=angle_deg)
                )  # fmt: skip
    world = WorldConfig(wall=tuple(walls), box=tuple(frames))
    return FurnishedRoom(world, width_m, depth_m, turn_rad)


def _with_drums(rng: np.random.Generator, room: FurnishedRoom, count: int) -> WorldConfig | None:
    """Return the world with so many drums, none in the middle; None if they do not fit."""
    world = room.world
    for _ in range(count):
        scene = compile_scene(world.model_copy(update={"drum": ()}))
        for _ in range(TRIES):
            x, y = room.place(*rng.uniform(-0.5, 0.5, 2).tolist())
            is_apart = all(
                math.dist((x, y), (d.x_m, d.y_m)) > DRUM_TO_DRUM_M + 2.0 * DRUM_RADIUS_M for d in world.drum
            )
            is_clear = clearance(x, y, scene.circles, scene.segments) > DRUM_RADIUS_M + DRUM_TO_WALL_M
            if is_apart and is_clear and math.hypot(x, y) > DRUM_RADIUS_M + MIDDLE_M:
                drum = DrumConfig(x_m=x, y_m=y, radius_m=DRUM_RADIUS_M)
                world = world.model_copy(update={"drum": (*world.drum, drum)})
                break
        else:
            return None
    return world


def _with_piece(rng: np.random.Generator, room: FurnishedRoom, world: WorldConfig, kind: str) -> WorldConfig:
    """Return the world with one more piece of furniture, if there is a place for it."""
    if kind in ("shelf", "curtain"):
        return _before_wall(rng, world, kind)
    scene = compile_scene(world)
    for _ in range(TRIES):
        x, y = room.place(*rng.uniform(-0.5, 0.5, 2).tolist())
        angle = float(rng.uniform(0.0, math.pi))
        if kind == "box":
            width, depth = rng.uniform(*BOX_M, 2).tolist()
            reach = 0.5 * math.hypot(width, depth)
            piece = BoxConfig(x_m=x, y_m=y, width_m=width, depth_m=depth, angle_deg=math.degrees(angle))
            added: dict[str, object] = {"box": (*world.box, piece)}
        else:
            legs, radius = _legs(rng, kind, x, y, angle)
            reach = max(math.dist((x, y), leg) for leg in legs) + radius
            round_legs = tuple(DrumConfig(x_m=a, y_m=b, radius_m=radius) for a, b in legs)
            added = {"drum": (*world.drum, *round_legs)}
        is_apart = clearance(x, y, scene.circles, scene.segments) > reach + APART_M
        drums = [d for d in world.drum if d.radius_m == DRUM_RADIUS_M]
        is_off = all(math.dist((x, y), (d.x_m, d.y_m)) > reach + d.radius_m + TO_DRUM_M for d in drums)
        if is_apart and is_off and math.hypot(x, y) > reach + MIDDLE_M:
            return world.model_copy(update=added)
    return world


def _legs(
    rng: np.random.Generator, kind: str, x: float, y: float, angle: float
) -> tuple[list[tuple[float, float]], float]:  # fmt: skip
    """Return where the legs of a table, a chair or a person stand, and their radius, m."""
    c, s = math.cos(angle), math.sin(angle)
    if kind == "person":
        apart, radius = 0.5 * float(rng.uniform(*STANCE_M)), float(rng.uniform(*PERSON_M))
        return [(x + apart * c, y + apart * s), (x - apart * c, y - apart * s)], radius
    along, across = (0.5 * float(rng.uniform(*span)) for span in (TABLE_M if kind == "table" else CHAIR_M))
    corners = [(i * along, k * across) for i, k in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return [(x + c * a - s * b, y + s * a + c * b) for a, b in corners], float(rng.uniform(*LEG_M))


def _before_wall(rng: np.random.Generator, world: WorldConfig, kind: str) -> WorldConfig:
    """Return the world with a shelf or a curtain before one of its walls, if one is long enough."""
    long = [w for w in world.wall if math.hypot(w.x2_m - w.x1_m, w.y2_m - w.y1_m) > SHELF_M[1] + 0.5]
    if not long:
        return world
    wall = long[int(rng.integers(len(long)))]
    length = math.hypot(wall.x2_m - wall.x1_m, wall.y2_m - wall.y1_m)
    ux, uy = (wall.x2_m - wall.x1_m) / length, (wall.y2_m - wall.y1_m) / length
    wide = float(rng.uniform(*SHELF_M))
    middle = float(rng.uniform(0.2 + 0.5 * wide, length - 0.2 - 0.5 * wide))
    off = BEFORE_WALL_M - (0.5 * SHELF_DEPTH_M if kind == "shelf" else 0.0)
    # The walls run counter-clockwise, so the room is on their left.
    x, y = wall.x1_m + middle * ux - off * uy, wall.y1_m + middle * uy + off * ux
    near = [(b.x_m, b.y_m, b.width_m) for b in world.box if b.depth_m == SHELF_DEPTH_M]
    near += [(0.5 * (w.x1_m + w.x2_m), 0.5 * (w.y1_m + w.y2_m), SHELF_M[1]) for w in world.wall if w.surface]
    if any(math.dist((x, y), (a, b)) < 0.5 * (wide + other) + APART_M for a, b, other in near):
        return world
    if kind == "shelf":
        angle_deg = math.degrees(math.atan2(uy, ux))
        shelf = BoxConfig(x_m=x, y_m=y, width_m=wide, depth_m=SHELF_DEPTH_M, angle_deg=angle_deg)
        return world.model_copy(update={"box": (*world.box, shelf)})
    ax, ay, bx, by = x - 0.5 * wide * ux, y - 0.5 * wide * uy, x + 0.5 * wide * ux, y + 0.5 * wide * uy
    curtain = WallConfig(x1_m=ax, y1_m=ay, x2_m=bx, y2_m=by, surface="silent")
    return world.model_copy(update={"wall": (*world.wall, curtain)})


def _with_surfaces(rng: np.random.Generator, world: WorldConfig) -> WorldConfig:
    """Return the world whose objects have each a surface of its own; a curtain stays silent."""
    update = {
        kind: tuple(
            it if it.surface else it.model_copy(update={"surface": MIXTURE[int(rng.integers(len(MIXTURE)))]})
            for it in getattr(world, kind)
        )
        for kind in ("wall", "box", "drum")
    }
    return world.model_copy(update=update)


def drive_through(room: FurnishedRoom, seed: int, step_m: float, length_m: float) -> Floats:
    """Return the poses of the ring on a drive through all of a room: x, y (m) and direction (rad), shape (n, 3).

    The drive goes from place to place by the shortest way, so it passes closely by what is in the way.

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
    rng = np.random.default_rng(np.random.SeedSequence([seed, 44]))
    yaw = float(rng.uniform(-math.pi, math.pi))
    space = free_space(room.world, CLEAR_M)
    rows, columns = np.indices(space.free.shape)
    x, y = space.x_m + CELL_M * columns, space.y_m + CELL_M * rows
    c, s = math.cos(room.turn_rad), math.sin(room.turn_rad)
    space.free[(abs(c * x + s * y) > INSIDE * room.width_m) | (abs(c * y - s * x) > INSIDE * room.depth_m)] = False
    free = np.argwhere(space.free)
    here = space.place(tuple(free[np.hypot(*(free - space.cell((0.0, 0.0))).T).argmin()]))
    way, driven = [here], 0.0
    while driven < length_m:
        places = [space.place(tuple(free[k])) for k in rng.integers(len(free), size=PLACES)]
        been = np.array(way)
        places.sort(key=lambda at: -float(np.hypot(*(been - at).T).min()))
        legs = (shortest_way(space, here, at) for at in places)
        leg = next((leg for leg in legs if leg is not None and len(leg) > 1), None)
        if leg is None:
            continue
        driven += sum(math.dist(a, b) for a, b in pairwise(leg))
        way += leg[1:]
        here = way[-1]
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(np.array(way), axis=0).T))])
    at = np.arange(0.0, length_m, step_m)
    return np.column_stack([np.interp(at, along, [p[i] for p in way]) for i in (0, 1)] + [np.full(len(at), yaw)])
