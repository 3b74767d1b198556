"""Box canyons: places that walls, objects and gaps too narrow for this robot close on all sides but one.

Seen from a place inside, the surfaces round a canyon are one chain without a gap that the robot could pass, over more
than half a turn; what the chain leaves open is the mouth. So one place is examined at a time: where the robot is, and
before the walls it knows. What was found is remembered by its number when the robot has left it behind.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Pose, wrap_angle
from perception.bounds import CONSTANT, COUNT, PLACE, SHARE, bounds
from perception.detected_object import DetectedObject
from perception.kernel import Floats
from perception.percept import Canyon
from perception.records import Structured
from perception.shared_numbers import EVEN

SURFACE_REACH_M: Final = 9.0
"""Surfaces farther from the place than this do not count."""
WIDTH_MAX_M: Final = 5.0
"""Widest mouth of a canyon: what is wider is a room."""
DEPTH_MIN_M: Final = 0.8
"""Least depth of a canyon: what is shallower is a niche."""
DEPTH_SHARE: Final = 0.3
"""Least depth of a canyon as a share of its width."""
BACK_SHARE: Final = 0.7
"""At half its depth a canyon is still as wide as this share of its mouth: the corner of a room is none."""
CLIPPED: Final = 1.25
"""A mouth longer than this times a nearer crossing slants, as one side goes on: the crossing is the mouth then."""
BRIDGE_WEIGHT: Final = 0.85
"""Weight of a gap that is too narrow, in place of the surface's probability."""
SURFACES_MIN: Final = 3
"""With fewer surfaces in reach no canyon is looked for."""
SURFACES_MAX: Final = 16
"""Walls, and other objects, that count, the nearest to the robot: time must not grow with the room."""
BRIDGES_MAX: Final = 24
"""Gaps that are closed at most, the narrowest."""
ENDS_M: Final = 0.1
"""Posts of a gap are known within half of this each: a gap is closed if it is narrower than what the robot passes by
this. Otherwise two drums reported at the corners of an open end are a back."""
SHAPELESS_RADIUS_M: Final = 0.1
"""Radius of what has a place but no known shape, and is none of `POINTS`."""
POINTS: Final = ("edge", "inside corner")
"""Points of walls, which have no radius: both posts of a doorway leave all its width."""
DIRECTION_STEP_RAD: Final = math.radians(5.0)
NUDGE_RAD: Final = 1e-4
"""Directions just beside the end of a surface, so that no opening is missed between two directions."""
CLEAR_M: Final = 0.3
"""A place nearer to a surface than this is none of the robot's."""
SAME_MOUTH_M: Final = 1.0
"""Mouths nearer to each other than this, of canyons that point alike by `SAME_MOUTH_RAD`, are of the same canyon."""
SAME_MOUTH_RAD: Final = math.radians(40.0)
"""Difference of directions in `SAME_MOUTH_M`."""
CANYONS_MAX: Final = 16
"""Canyons that are remembered at most."""
DOUBT: Final = 0.6
"""Factor on the probability of a canyon that is not found again."""
FORGOTTEN: Final = 0.3
"""A canyon less probable than this is forgotten."""
EVERY_FIRINGS: Final = 10
"""One place is examined after so many firings: half a second."""


class Surfaces(NamedTuple):
    """What is closed: straight pieces x1, y1, x2, y2 (n, 4) and circles x, y, radius (m, 3), m, and how surely."""

    pieces: Floats
    piece_weights: Floats
    circles: Floats
    circle_weights: Floats


CANYON_DTYPE: Final = np.dtype(
    [
        ("number", "i8"),
        ("mouth", "f8", 4),
        ("axis", "f8"),
        ("depth", "f8"),
        ("probability", "f8"),
        ("inside", "f8", 2),
    ]
)


def surfaces_of(seen: Iterable[DetectedObject], radii_m: Mapping[str, float], sealed_m: float) -> Surfaces:
    """Return the surfaces that are sure enough, and a straight piece across each gap narrower than `sealed_m`.

    Parameters
    ----------
    seen
        What perception reports, the nearest first: the others are left out where there are too many.
    radii_m
        Radius by label; what has another label is a wall, a point, or else a post.
    sealed_m
        Gaps narrower than this are closed for the robot, m.
    """
    walls: list[tuple[float, ...]] = []
    rounds: list[tuple[float, ...]] = []
    for one in seen:
        weight = one.score if one.probability is None else one.probability
        if weight < EVEN:
            continue
        if one.ends is not None:
            walls.append((*one.ends, weight))
        elif len(rounds) < SURFACES_MAX:
            radius = 0.0 if one.model in POINTS else radii_m.get(one.model, SHAPELESS_RADIUS_M)
            rounds.append((one.x, one.y, radius, weight))
    pieces = np.array(walls[:SURFACES_MAX]).reshape(-1, 5)
    circles = np.array(rounds).reshape(-1, 4)
    bridges = _bridges(pieces[:, :4], circles[:, :3], sealed_m)
    weights = np.concatenate([pieces[:, 4], np.full(len(bridges), BRIDGE_WEIGHT)])
    return Surfaces(np.concatenate([pieces[:, :4], bridges]), weights, circles[:, :3], circles[:, 3])


def _distance(one: DetectedObject, x: float, y: float) -> float:
    """Return the distance of a place from an object's middle, or from a wall's middle or nearer end, m."""
    away = math.hypot(one.x - x, one.y - y)
    ends = one.ends
    return away if ends is None else min(away, math.dist(ends[:2], (x, y)), math.dist(ends[2:], (x, y)))


def _bridges(pieces: Floats, circles: Floats, sealed_m: float) -> Floats:
    """Return straight pieces across the gaps that are too narrow, shape (k, 4); what touches has none."""
    ends = np.concatenate([pieces[:, :2], pieces[:, 2:], circles[:, :2]])
    radii = np.concatenate([np.zeros(2 * len(pieces)), circles[:, 2]])
    owner = np.concatenate([np.arange(len(pieces)), np.arange(len(pieces)), np.full(len(circles), -1)])
    found: list[tuple[float, ...]] = []
    if len(pieces):
        a, along = pieces[:, :2], pieces[:, 2:] - pieces[:, :2]
        share = ((ends[:, None] - a) * along).sum(axis=2) / np.maximum((along * along).sum(axis=1), 1e-12)
        feet = a + np.clip(share, 0.0, 1.0)[:, :, None] * along
        gaps = np.hypot(*np.moveaxis(feet - ends[:, None], 2, 0)) - radii[:, None]
        gaps[owner[:, None] == np.arange(len(pieces))] = math.inf
        touching = np.where(
            (owner < 0) & (radii == 0.0), SHAPELESS_RADIUS_M, 0.0
        )  # the end of a wall is a point of it
        near = np.argwhere((gaps > touching[:, None]) & (gaps < sealed_m))
        found += [(gaps[i, k], *ends[i], *feet[i, k]) for i, k in near]
    apart = np.hypot(*np.moveaxis(circles[:, None, :2] - circles[:, :2], 2, 0)) - circles[:, None, 2] - circles[:, 2]
    near = np.argwhere(np.triu((apart > 0.0) & (apart < sealed_m), 1))
    found += [(apart[i, k], *circles[i, :2], *circles[k, :2]) for i, k in near]
    found.sort(key=operator.itemgetter(0))
    return np.array(found[:BRIDGES_MAX], dtype=np.float64).reshape(-1, 5)[:, 1:]


def canyon_round(x: float, y: float, surfaces: Surfaces, sealed_m: float) -> Canyon | None:
    """Return the canyon that a place lies in, without a number; None if it lies in none.

    Parameters
    ----------
    x, y
        The place, m.
    surfaces
        From `surfaces_of`.
    sealed_m
        As for `surfaces_of`.
    """
    angles, points, items, weights = _seen_from(x, y, surfaces)
    ranges = np.hypot(points[:, 0] - x, points[:, 1] - y)
    if len(ranges) == 0 or ranges.min() < CLEAR_M:
        return None
    heard = ranges < SURFACE_REACH_M
    after = np.roll(points, -1, axis=0)
    gaps = np.hypot(after[:, 0] - points[:, 0], after[:, 1] - points[:, 1])
    joined = heard & np.roll(heard, -1) & ((items == np.roll(items, -1)) | (gaps < sealed_m))
    cuts = np.flatnonzero(~joined)
    if len(cuts) == 0:
        return None
    # The longest run of directions between two cuts, in turn from just after a cut.
    begins, counts = (cuts + 1) % len(angles), np.diff(np.append(cuts, cuts[0] + len(angles)))
    spans = np.array(
        [
            (angles[(b + n - 1) % len(angles)] - angles[b]) % (2.0 * math.pi) if n > 1 else 0.0
            for b, n in zip(begins, counts, strict=True)
        ]
    )
    longest = int(spans.argmax())
    if spans[longest] <= math.pi:
        return None
    run = (begins[longest] + np.arange(counts[longest])) % len(angles)
    # By angle, not by count: what lies hidden behind one side adds directions there.
    half = int(np.searchsorted(np.remainder(angles[run] - angles[run[0]], 2.0 * math.pi), 0.5 * spans[longest]))
    return _measured(x, y, points[run], weights[run], half, sealed_m)


def _measured(x: float, y: float, chain: Floats, weights: Floats, half: int, sealed_m: float) -> Canyon | None:
    """Return the canyon of a chain of points, counter-clockwise round (x, y); `half` is the one in the middle."""
    first, last = 0, len(chain) - 1
    to_first = np.hypot(*(chain[half:] - chain[0]).T)
    to_last = np.hypot(*(chain[:half] - chain[-1]).T)
    if math.dist(chain[0], chain[-1]) > CLIPPED * min(to_first.min(), to_last.min()):
        if to_first.min() < to_last.min():
            last = half + int(to_first.argmin())
        else:
            first = int(to_last.argmin())
    (x1, y1), (x2, y2) = chain[first], chain[last]
    width = math.hypot(x2 - x1, y2 - y1)
    if not sealed_m <= width <= WIDTH_MAX_M:
        return None
    # The chain turns counter-clockwise from the right end of the mouth, looking in, to the left one.
    ux, uy = (y2 - y1) / width, -(x2 - x1) / width
    depths = (chain[first : last + 1, 0] - x1) * ux + (chain[first : last + 1, 1] - y1) * uy
    depth = float(depths.max())
    if (x - x1) * ux + (y - y1) * uy <= 0.0 or depth < max(DEPTH_MIN_M, DEPTH_SHARE * width):
        return None
    across = (chain[first : last + 1, 0] - x1) * uy - (chain[first : last + 1, 1] - y1) * ux
    deep = across[depths >= 0.5 * depth]
    if np.ptp(deep) < BACK_SHARE * width:
        return None
    # One side may be known farther out than the other: the axis leads to the middle of the inner half.
    slant = math.atan2(0.5 * (float(deep.min()) + float(deep.max())) + 0.5 * width, 0.75 * depth)
    axis = math.atan2(uy, ux) - slant
    c, s = math.cos(axis), math.sin(axis)
    inner = chain[first : last + 1] - (0.5 * (x1 + x2), 0.5 * (y1 + y2))
    depth = float((c * inner[:, 0] + s * inner[:, 1]).max())
    mouth = (float(x1), float(y1), float(x2), float(y2))
    return Canyon(0, mouth, wrap_angle(axis), depth, float(weights[first : last + 1].mean()))


def _seen_from(x: float, y: float, surfaces: Surfaces) -> tuple[Floats, Floats, NDArray[np.int64], Floats]:
    """Return, by direction in turn: the angle, the point seen, which surface it is of, and its weight."""
    pieces, circles = surfaces.pieces, surfaces.circles
    ends = np.concatenate([pieces[:, :2], pieces[:, 2:]]) - (x, y)
    corners = np.arctan2(ends[:, 1], ends[:, 0])
    away = circles[:, :2] - (x, y)
    distance = np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-9)
    half, middle = np.arcsin(np.minimum(circles[:, 2] / distance, 1.0)), np.arctan2(away[:, 1], away[:, 0])
    edges = np.concatenate([corners, middle - half, middle + half])
    angles = np.concatenate([np.arange(-math.pi, math.pi, DIRECTION_STEP_RAD), edges - NUDGE_RAD, edges + NUDGE_RAD])
    angles = np.sort(np.remainder(angles + math.pi, 2.0 * math.pi) - math.pi)
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    ax, ay = pieces[:, 0] - x, pieces[:, 1] - y
    dx, dy = pieces[:, 2] - pieces[:, 0], pieces[:, 3] - pieces[:, 1]
    with np.errstate(all="ignore"):
        across = c * dy - s * dx
        at, share = (ax * dy - ay * dx) / across, (ax * s - ay * c) / across
        to_pieces = np.where((at > 0.0) & (share >= 0.0) & (share <= 1.0), at, math.inf)
        along, off = c * away[:, 0] + s * away[:, 1], c * away[:, 1] - s * away[:, 0]
        to_circles = along - np.sqrt(circles[:, 2] ** 2 - off * off)
        to_circles = np.where((np.abs(off) < circles[:, 2]) & (along > 0.0), np.maximum(to_circles, 0.0), math.inf)
    ranges = np.concatenate([to_pieces, to_circles, np.full((len(angles), 1), 1e6)], axis=1)
    items = ranges.argmin(axis=1)
    nearest = ranges[np.arange(len(angles)), items]
    weights = np.concatenate([surfaces.piece_weights, surfaces.circle_weights, [0.0]])[items]
    points = np.column_stack([x + nearest * c[:, 0], y + nearest * s[:, 0]])
    return angles, points, items.astype(np.int64), weights


def places_before(surfaces: Surfaces, room_m: float) -> Floats:
    """Return places before both faces of the straight pieces, `room_m` away, in a fixed order, shape (k, 2), m."""
    middle = 0.5 * (surfaces.pieces[:, :2] + surfaces.pieces[:, 2:])
    along = surfaces.pieces[:, 2:] - surfaces.pieces[:, :2]
    length = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)[:, None]
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / length
    return np.concatenate([middle + room_m * normal, middle - room_m * normal])


class CanyonMap:
    """The canyons found so far, those left behind included."""

    BOUNDS: Final = bounds(
        sealed_m=CONSTANT,
        rows={
            "number": COUNT,
            "mouth": PLACE,
            "axis": PLACE,
            "depth": PLACE,
            "probability": SHARE,
            "inside": PLACE,
        },
        numbered=COUNT,
        firings=COUNT,
        _at=PLACE,
    )

    def __init__(self, sealed_m: float) -> None:
        self.sealed_m = sealed_m
        self.rows: Structured = np.zeros(CANYONS_MAX, CANYON_DTYPE)
        """(CANYONS_MAX,): a number of 0 is a free row."""
        self.numbered = 0
        """Canyons numbered so far."""
        self.firings = 0
        """Firings so far."""
        self.is_wanted = False
        """Whether to look for canyons: a place takes a millisecond, and only a drive to a goal needs them."""
        self.is_due = False
        """Whether the next place is to be examined."""
        self._at = np.zeros(2)

    def observe(self, pose: Pose) -> None:
        """Take the robot's pose at a firing; after some of them the next place is due, where that is wanted."""
        self.firings += 1
        if self.is_wanted and self.firings % EVERY_FIRINGS == 0:
            self.is_due = True
            self._at[:] = pose.x, pose.y

    def refine(self, seen: Iterable[DetectedObject], radii_m: Mapping[str, float]) -> None:
        """Examine the next place: in turn that of the robot, a known canyon's, and one before a wall.

        Parameters
        ----------
        seen
            What perception reports near it.
        radii_m
            Radius by label of round models.
        """
        self.is_due = False
        at_x, at_y = self._at.tolist()
        near = sorted(seen, key=lambda one: _distance(one, at_x, at_y))
        surfaces = surfaces_of(near, radii_m, self.sealed_m)
        if len(surfaces.piece_weights) + len(surfaces.circle_weights) < SURFACES_MIN and not self.numbered:
            return
        turn, known = self.firings // EVERY_FIRINGS, np.flatnonzero(self.rows["number"] > 0)
        before = places_before(surfaces, 0.5 * self.sealed_m + CLEAR_M)
        x, y = at_x, at_y
        row = None
        if turn % 3 == 1 and len(known):
            row = int(known[turn // 3 % len(known)])
            x, y = self.rows["inside"][row].tolist()
        elif turn % 3 == 2 and len(before):
            x, y = before[turn // 3 % len(before)].tolist()
        found = canyon_round(x, y, surfaces, self.sealed_m)
        if found is not None:
            self._enter(found, x, y)
        elif row is not None and math.hypot(x - at_x, y - at_y) < 0.5 * SURFACE_REACH_M:
            self.rows["probability"][row] *= DOUBT
            if self.rows["probability"][row] < FORGOTTEN:
                self.rows[row] = 0

    def _enter(self, found: Canyon, x: float, y: float) -> None:
        """Take over a canyon under its own number if it is known, otherwise in place of the least sure one."""
        rows = self.rows
        middle = 0.5 * (np.array(found.mouth[:2]) + found.mouth[2:])
        away = np.hypot(*(0.5 * (rows["mouth"][:, :2] + rows["mouth"][:, 2:]) - middle).T)
        off = np.abs(np.remainder(rows["axis"] - found.axis_rad + math.pi, 2.0 * math.pi) - math.pi)
        inside = np.hypot(*(rows["inside"] - (x, y)).T)
        same = (rows["number"] > 0) & (off < SAME_MOUTH_RAD) & ((away < SAME_MOUTH_M) | (inside < SAME_MOUTH_M))
        if same.any():
            at = int(np.flatnonzero(same)[0])
            number = int(rows["number"][at])
        else:
            at = int(np.where(rows["number"] > 0, rows["probability"], -1.0).argmin())
            self.numbered += 1
            number = self.numbered
        rows[at] = (number, found.mouth, found.axis_rad, found.depth_m, found.probability, (x, y))

    def canyons(self) -> tuple[Canyon, ...]:
        """Return the canyons, in the order of their numbers."""
        if self.numbered == 0:  # as in most places: a look at all rows would take a twentieth of a goal's decision
            return ()
        known = self.rows[self.rows["number"] > 0]
        return tuple(
            Canyon(
                int(row["number"]),
                tuple(row["mouth"].tolist()),
                float(row["axis"]),
                float(row["depth"]),
                float(row["probability"]),
            )
            for row in known[np.argsort(known["number"])]
        )

    def clear(self) -> None:
        """Forget all canyons."""
        self.rows[:] = 0
        self.numbered = self.firings = 0
        self.is_due = False
