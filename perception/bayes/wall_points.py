"""Corners that are heard although only one of their walls is known, found among the recent echoes.

Two mirrors that meet answer from their corner at any bearing, often long before the second one is heard at the foot
of a perpendicular. Each echo puts the corner on a circle, which cuts the line of the known wall in two places; the
corner is where many cuts meet. What lies on no wall's line is not looked for: a post answers like a corner.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.bayes.range_fit import FAR
from perception.bayes.settings_record import SettingsRecord
from perception.bayes.state import Memory, StateRecord
from perception.bayes.wall_contact import EDGE_REACH_M, HEARD_REACH_M, are_mirrors
from perception.bayes.wall_corners import (
    EDGE_WALL_WEIGHT_MIN,
    KEPT,
    PASS_SLACK_M,
    SYSTEMATIC_M,
)
from perception.bayes.wall_records import EDGES_MAX, MAX_WALLS, RECENT_MAX
from perception.kernel import Floats, kernel

ECHOES_MIN: Final = 8
"""Recent echoes, from afar, that show a corner …"""
LEAD_MIN: Final = 2.0
"""… if they are so many times the ranges that went on past it …"""
SPREAD_MIN_RAD: Final = 0.25
"""… and come from bearings so far apart: those of another wall lie within half a beam of its normal."""
SIGMAS: Final = 2.5
CELL_M: Final = 0.05
BEYOND_MIN_M: Final = 0.15
"""The corner lies at least this far beyond the wall's end; nearer ones are found as the end itself."""
SLANT_MIN: Final = 0.35
"""Least share of the range that runs along the wall: the wall's own echoes have none."""
APART_M: Final = 0.3
"""Least distance from a corner or an edge that is known."""


@kernel
def choose_wall(s: StateRecord, turn: int) -> tuple[int, int]:
    """Return the wall on whose line a corner is looked for, and the place of a free edge; −1, −1 without such.

    Parameters
    ----------
    s, turn
        As for `find_heard_corner`.
    """
    room = s[0].room
    place = -1
    for c in range(EDGES_MAX):
        if place < 0 and room.edges[c].is_used == 0:
            place = c
    known = 0
    for k in range(MAX_WALLS):
        known += room.walls[k].weight >= EDGE_WALL_WEIGHT_MIN
    if place < 0 or known == 0 or not are_mirrors(room):
        return -1, -1
    left = turn % known
    for k in range(MAX_WALLS):
        if room.walls[k].weight >= EDGE_WALL_WEIGHT_MIN:
            if left == 0 and room.walls[k].span_count > 0:
                return k, place
            left -= 1
    return -1, -1


def find_heard_corner(memory: Memory, p: SettingsRecord, turn: int) -> None:
    """Look for a corner on the line of one wall, and add it to the edges.

    Parameters
    ----------
    memory, p
        Updated, and the settings.
    turn : int
        Counts the calls: each looks at the next wall.
    """
    k, place = choose_wall(memory.s, turn)
    if k < 0:
        return
    room = memory.state["room"][0]
    wall, readings = room["walls"][k], room["recent"]["reading"][: min(int(room["recent_count"]), RECENT_MAX)]
    ends = float(wall["spans"]["low"][0]), float(wall["spans"]["high"][int(wall["span_count"]) - 1])
    cuts = _cuts(wall, readings, float(p[0].cos_half_angle))
    for side, beyond in enumerate((ends[0] - cuts, cuts - ends[1])):
        near = np.sort(beyond[(beyond > BEYOND_MIN_M) & (beyond < HEARD_REACH_M)])
        if len(near) < ECHOES_MIN:
            continue
        count = np.searchsorted(near, near + CELL_M) - np.arange(len(near))
        low = int(count.argmax())
        if count[low] >= ECHOES_MIN:
            reach = float(np.median(near[low : low + count[low]]))
            x, y = _point(wall, ends[side] + (reach if side == 1 else -reach))
            if not _is_known(room, x, y):
                _enter(room, room["edges"][place], (x, y), readings, p)
                room["edges"][place]["first"], room["edges"][place]["second"] = k, side
                return


def _cuts(wall: NDArray[Any], readings: NDArray[Any], cos_half: float) -> Floats:
    """Return where the echoes' circles cut a wall's line inside their beams, as positions along it, m."""
    heard = readings[readings["range_m"] < FAR]
    (x0, y0), (x1, y1) = _point(wall, 0.0), _point(wall, 1.0)
    length = math.hypot(x1 - x0, y1 - y0)  # of the line for a metre along the frame
    tx, ty = (x1 - x0) / length, (y1 - y0) / length
    dx, dy, r = heard["x"] - x0, heard["y"] - y0, heard["range_m"]
    foot, distance = tx * dx + ty * dy, ty * dx - tx * dy
    half = np.sqrt(np.maximum(r * r - distance * distance, 0.0))
    cuts = []
    for sign in (-1.0, 1.0):
        at = foot + sign * half
        axis = (tx * at - dx) * heard["axis_x"] + (ty * at - dy) * heard["axis_y"]
        cuts.append(at[(half > SLANT_MIN * r) & (axis >= cos_half * r)])
    return np.asarray(np.concatenate(cuts) / length)


def _point(wall: NDArray[Any], along: float) -> tuple[float, float]:
    """Return the point of a wall's line at a position along its frame, m."""
    off = float(wall["offset"]) + float(wall["slope"]) * along
    nx, ny = float(wall["normal_x"]), float(wall["normal_y"])
    return float(wall["origin_x"]) + nx * off - ny * along, float(wall["origin_y"]) + ny * off + nx * along


def _is_known(room: NDArray[Any], x: float, y: float) -> bool:
    """Return whether a corner or an edge is near a point."""
    for points in (room["corners"], room["edges"]):
        near = np.hypot(points["x"] - x, points["y"] - y) < APART_M
        if np.any(near & (points["is_used"] == KEPT)):
            return True
    return False


def _enter(
    room: NDArray[Any], edge: NDArray[Any], place: tuple[float, float], readings: NDArray[Any], p: SettingsRecord
) -> None:  # fmt: skip
    """Write a corner at a place to a free edge, with the echoes from it, if they show a corner."""
    dx, dy, r = place[0] - readings["x"], place[1] - readings["y"], readings["range_m"]
    d = np.hypot(dx, dy)
    sigma = np.sqrt(room["variance_m2"] + room["relative_variance"] * d * d)
    cosine = (dx * readings["axis_x"] + dy * readings["axis_y"]) / d
    is_own = (cosine >= p[0].cos_half_angle) & (np.abs(r - d) < SIGMAS * sigma) & (d > EDGE_REACH_M)
    is_passed = (cosine >= p[0].cos_must_answer) & (r > d + SIGMAS * sigma + PASS_SLACK_M) & (d > EDGE_REACH_M)
    echoes, passes = int(np.count_nonzero(is_own)), int(np.count_nonzero(is_passed))
    nx, ny, w = (dx / d)[is_own], (dy / d)[is_own], 1.0 / sigma[is_own] ** 2
    if echoes < ECHOES_MIN or echoes <= LEAD_MIN * passes:
        return
    mean = math.atan2(float(ny.sum()), float(nx.sum()))
    spread = np.arctan2(ny * math.cos(mean) - nx * math.sin(mean), nx * math.cos(mean) + ny * math.sin(mean))
    if float(np.ptp(spread)) < SPREAD_MIN_RAD:
        return
    level = nx * readings["x"][is_own] + ny * readings["y"][is_own] + r[is_own]
    heard = edge["heard"]
    heard["xx"], heard["xy"], heard["yy"] = (w * nx * nx).sum(), (w * nx * ny).sum(), (w * ny * ny).sum()
    heard["x"], heard["y"] = (w * nx * level).sum(), (w * ny * level).sum()
    edge["is_used"], edge["is_edge"], edge["x"], edge["y"] = KEPT, 0, *place
    edge["covariance_xx"] = edge["covariance_yy"] = SYSTEMATIC_M
    edge["covariance_xy"] = 0.0
    edge["echoes"] = edge["ended"] = edge["far_echoes"] = echoes
    edge["passes"] = edge["far_passes"] = passes
