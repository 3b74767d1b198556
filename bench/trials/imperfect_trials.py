"""What perception reports after a drive through a furnished, imperfect room, compared with the truth.

Explained is an echo whose true place of reflection is near a reported wall or corner; false is reported length with
no surface near. Both are measured as on real drives with a laser's truth.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from bench.trials.furnished_rooms import DRUM_RADIUS_M, FurnishedRoom
from bench.trials.imperfect_rooms import drive_through
from bench.trials.wall_trials import (
    Corner,
    Segment,
    compare,
    compare_corners,
    listen,
    recognise,
    reported_corners,
    reported_walls,
)
from config.settings import Settings
from config.units import FOOT_M
from config.world import DrumConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene
from drivers.firing_pattern import firing_pattern
from drivers.messages import Floats
from perception.pipeline import Perception
from runtime.simulation.evaluation import match_drums

DRIVE_M: Final = 40.0
"""Length of a drive: those of real rooms are 44 m and 120 m."""
EXPLAINED_M: Final = 0.1
"""An echo is explained if its place is this near to what is reported."""
NEAR_M: Final = 0.15
"""Reported length is false if no surface is this near."""
PIECE_M: Final = 0.05
SIDES: Final = 36
SIDES_MIN: Final = 8
SIDE_ECHOES: Final = 3
"""A drum was driven round if so many of its sides of 10° answered, each so often: 80°. With fewer, and with its true
echoes alone, it leads a body of unknown outline by 4 to 7 nat, as circles through legs and doorways do."""
ON_DRUM_M: Final = 0.02
"""An echo's place is so near to the outline of the drum from which it came."""
SAID: Final = 0.5
"""Least probability of a drum that is said."""
ROUND: Final = ("drum", "semicircle")
"""Models of the drums that are said."""


@dataclass(frozen=True, slots=True)
class ImperfectTrial:
    """Counts, lengths and errors of one drive, m.

    Attributes
    ----------
    drums, drums_found, drums_false : int
        How many stand there, and how many were found and said in vain.
    drum_errors_m : tuple of float
        Of those found.
    drums_round, drums_round_found : int
        How many were driven round, and how many of these were found.
    walls_answered_m, walls_found_m : float
        Length of the walls that answered, and of those parts that were reported.
    walls_m, walls_false_m : float
        Length that was reported, and that of it where there is nothing.
    corners, corners_false : int
        How many were reported, and how many of them where there is nothing.
    lines_m, lines_false_m : float
        Length of the polylines, and that of it where there is nothing.
    echoes, explained, explained_with_lines : int
        How many echoes were heard, and how many the walls and corners explain, alone and with the polylines.
    """

    drums: int
    drums_found: int
    drums_false: int
    drum_errors_m: tuple[float, ...]
    drums_round: int
    drums_round_found: int
    walls_answered_m: float
    walls_found_m: float
    walls_m: float
    walls_false_m: float
    corners: int
    corners_false: int
    lines_m: float
    lines_false_m: float
    echoes: int
    explained: int
    explained_with_lines: int


def try_room(
    settings: Settings, room: FurnishedRoom, seed: int, step_m: float, *, is_empty: bool = False
) -> ImperfectTrial:  # fmt: skip
    """Drive through a room and return how the report compares with the truth.

    Parameters
    ----------
    settings : Settings
        Ring, models and perception.
    room, seed, step_m
        As for `wall_trials.listen`.
    is_empty : bool
        Whether the room has no furniture, so that its own drive leads through it.
    """
    sets = len(firing_pattern(settings.ring).masks)
    poses = None if is_empty else drive_through(room, seed, step_m / sets, DRIVE_M)
    heard, scene = listen(settings.ring, room, seed, step_m, poses), compile_scene(room.world)
    perception = recognise(settings, heard)
    seen = perception.labelled_objects()
    drums = [d for d in room.world.drum if d.radius_m == DRUM_RADIUS_M]
    said = [(it.x, it.y) for it in seen if it.model in ROUND and it.score >= SAID]
    rows, false = match_drums(room.world.model_copy(update={"drum": tuple(drums)}), said)
    is_found = [row["error"] is not None for row in rows]
    is_round = [sides(heard.points, drum) >= SIDES_MIN for drum in drums]
    walls, corners = reported_walls(seen), reported_corners(seen)
    whole = compare(heard.walls, heard.answered, walls, compare_corners(heard.corners, heard.echoes, corners))
    lines, away = reported_lines(perception), away_from(heard.points, walls, corners)

    def to_surface(x: float, y: float) -> float:
        return clearance(x, y, scene.circles, scene.segments)

    with_lines = np.minimum(away, distances(heard.points, lines))
    return ImperfectTrial(
        drums=len(drums),
        drums_found=sum(is_found),
        drums_false=false,
        drum_errors_m=tuple(row["error"] for row in rows if row["error"] is not None),
        drums_round=sum(is_round),
        drums_round_found=sum(a and b for a, b in zip(is_round, is_found, strict=True)),
        walls_answered_m=whole.answered_m,
        walls_found_m=whole.found_m,
        walls_m=sum(it.length_m for it in walls),
        walls_false_m=false_length(walls, to_surface),
        corners=len(corners),
        corners_false=sum(to_surface(it.x, it.y) > NEAR_M for it in corners),
        lines_m=sum(it.length_m for it in lines),
        lines_false_m=false_length(lines, to_surface),
        echoes=len(heard.points),
        explained=int((away < EXPLAINED_M).sum()),
        explained_with_lines=int((with_lines < EXPLAINED_M).sum()),
    )


def sides(points: Floats, drum: DrumConfig) -> int:
    """Return how many sides of a drum answered often enough to count.

    Parameters
    ----------
    points : (n, 2) float
        Where echoes came from, m.
    drum : DrumConfig
        The drum.
    """
    dx, dy = (points - (drum.x_m, drum.y_m)).T
    is_on = np.abs(np.hypot(dx, dy) - drum.radius_m) < ON_DRUM_M
    side = np.floor(np.arctan2(dy[is_on], dx[is_on]) / (2.0 * math.pi) * SIDES).astype(int) % SIDES
    return int((np.bincount(side, minlength=SIDES) >= SIDE_ECHOES).sum())


def distances(points: Floats, pieces: Sequence[Segment]) -> Floats:
    """Return how far points, shape (n, 2), are from the nearest of some pieces, m; +inf without any."""
    away = np.full(len(points), np.inf)
    for piece in pieces:
        away = np.minimum(away, piece.distance(points))
    return away


def reported_lines(perception: Perception) -> list[Segment]:
    """Return the pieces of the polylines."""
    return [Segment(a, b) for one in perception.polylines() for a, b in pairwise(one.points) if math.dist(a, b) > 0.0]


def away_from(points: Floats, walls: Sequence[Segment], corners: Sequence[Corner]) -> Floats:
    """Return how far points, shape (n, 2), are from the nearest wall or corner, m; +inf without any."""
    away = distances(points, walls)
    for corner in corners:
        away = np.minimum(away, np.hypot(*(points - (corner.x, corner.y)).T))
    return away


def false_length(pieces: Sequence[Segment], to_surface: Callable[[float, float], float]) -> float:
    """Return the length of pieces with no surface near, m.

    Parameters
    ----------
    pieces : sequence of Segment
        What is reported.
    to_surface : callable
        Returns the distance of a place x, y from the nearest surface, m.
    """
    false_m = 0.0
    for piece in pieces:
        shares = np.linspace(0.0, 1.0, max(2, int(piece.length_m / PIECE_M)))
        along = piece.begin + shares[:, None] * (piece.end - piece.begin)
        far = [to_surface(x, y) > NEAR_M for x, y in along.tolist()]
        false_m += piece.length_m * float(np.mean(far))
    return false_m


def figures(trials: Sequence[ImperfectTrial]) -> dict[str, float]:
    """Return the figures of these drives: shares, counts a room, errors in feet."""

    def total(name: str) -> float:
        return float(sum(getattr(it, name) for it in trials))

    def share(part: str, whole: str) -> float:
        return total(part) / total(whole) if total(whole) else math.nan

    errors_ft = [error / FOOT_M for it in trials for error in it.drum_errors_m]
    rooms = max(len(trials), 1)
    return {
        "rooms": len(trials),
        "drums": total("drums"),
        "found": total("drums_found"),
        "driven round": total("drums_round"),
        "of these found": total("drums_round_found"),
        "false": total("drums_false"),
        "error, ft": float(np.mean(errors_ft)) if errors_ft else math.nan,
        "worst, ft": max(errors_ft, default=math.nan),
        "walls found": share("walls_found_m", "walls_answered_m"),
        "walls, m a room": total("walls_m") / rooms,
        "walls false": share("walls_false_m", "walls_m"),
        "corners a room": total("corners") / rooms,
        "corners false": share("corners_false", "corners"),
        "polylines, m a room": total("lines_m") / rooms,
        "polylines false": share("lines_false_m", "lines_m"),
        "explained": share("explained", "echoes"),
        "explained with polylines": share("explained_with_lines", "echoes"),
    }
