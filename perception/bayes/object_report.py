"""Tracks to objects: what is sure enough to be called by a model's name, and what everything else is called.

A model's name is given late and for good: it must be probable, well placed, and clearly better than "something
unknown", which would explain any handful of echoes a little. Everything else is still somewhere, and keeps a name
that says what is known of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from config.units import FOOT_M
from perception.bayes.kernel_settings import MAY_DEG
from perception.bayes.range_fit import FAR
from perception.bayes.state import (
    C00,
    C01,
    C11,
    CALLED,
    CONFIRMED,
    ESTABLISHED,
    FREE,
    HITS,
    KIND,
    LC,
    LHI,
    LLO,
    LLOG,
    LLR,
    LN,
    LNX,
    LNY,
    LOX,
    LOY,
    LP00,
    LP11,
    MARK,
    MODEL,
    NUMBER,
    PCAP,
    PHITS,
    PLACED,
    PPROB,
    PROB,
    PTH,
    PTT,
    PX,
    PXX,
    PY,
    PYY,
    SPAN,
    ST,
    TRHO,
    TX,
    TY,
    UNK,
    Settings,
    State,
)  # fmt: skip
from perception.bayes.walls import is_wall
from perception.detected_object import DetectedObject
from perception.kernel import Floats, Ints, kernel

TOLD: Final = 10
"""What makes up a circle as an object, in numbers."""
BY_HAND_M: Final = 0.15
"""About how well a person places a thing, m."""
OVER_UNKNOWN: Final = 1.25
OVER_UNKNOWN_ALONE: Final = 1.1
"""Evidence over that of an unknown thing: a share of it, less where every rival is far behind."""
ALONE: Final = -20.0
NO_WALL: Final = -4.0
"""A wall this far behind is none, nat. Walls are what there is most of, and the rival that is met most often."""
ASPECTS: Final = 0.008
"""Dispersion of the axes from which on a thing has been seen from two sides: what lies straight ahead has not."""
KEPT: Final = 0.5
"""A name once given is kept while it is likelier than everything else together."""
SIGMA_MAX_M: Final = 0.17 * FOOT_M
POLYGON_PROBABILITY: Final = 0.9
POLYGON_NEAR_M: Final = 6.5 * FOOT_M
POLYGON_SPREAD: Final = 0.02
"""A polygon is seen from near and from more than one direction: one face, square on from afar, may be any wall's."""
POLYGON_SIGMA_MAX_M: Final = 0.2 * FOOT_M
POLYGON_HITS: Final = 20.0
POLYGON_HITS_SWEPT: Final = 12.0
POLYGON_SWEPT: Final = 80
"""It answers so often; or less often, where so many readings bear on it, silences and all, and it explains them."""
POLYGON_INFLATE: Final = 1.15
"""What a polygon's covariance is multiplied with when it is reported: what its neighbours do to it is no noise."""
POLYGON_TURN: Final = math.radians(MAY_DEG)
"""And its heading is not known better than the beam's edges are, rad: hearing or not at an edge turns a body."""
CORNER_M: Final = 1.0 * FOOT_M
"""A point this near to a long wall's line is a corner of the room, not an edge of a thing."""
POST_M: Final = 1.0 * FOOT_M
"""A round rival thinner than this is a post, a thicker one a barrel."""
UNKNOWN_HITS: Final = 5.0


@kernel
def call_or_not(ti: Ints, tf: Floats, comp: Floats, models: int, sure: float, least: float, t: int) -> None:
    """Give track `t` a model's name once that is sure, and take it away once it is not even likely any more.

    A name that came and went with every rival's turn would be worth nothing to whoever steers by it.

    Parameters
    ----------
    ti, tf, comp
        As in `State`; `ti` is updated.
    models : int
        Kinds below this are models.
    sure, least : float
        Probability from which on a name is given; and from which on where a wall is out of the question.
    t : int
        Track.
    """
    wall = comp[t, comp.shape[1] - 2]
    if wall == 0.0 or wall > NO_WALL:
        least = sure
    if ti[t, ST] != ESTABLISHED or ti[t, KIND] >= models or tf[t, PROB] < min(least, KEPT):
        ti[t, CALLED] = 0
        return
    rival = -1e300
    for k in range(comp.shape[1]):
        if k != ti[t, KIND]:
            rival = max(rival, comp[t, k])
    over = OVER_UNKNOWN_ALONE if rival < ALONE else OVER_UNKNOWN
    if tf[t, LLR] <= over * tf[t, UNK] or tf[t, SPAN] < ASPECTS or max(tf[t, C00], tf[t, C11]) >= SIGMA_MAX_M**2:
        ti[t, CALLED] = 0
    elif tf[t, PROB] >= least:
        ti[t, CALLED] = 1


@kernel
def sure_circles(ti: Ints, names: Ints, out: Ints) -> int:
    """Write the tracks that have a round model's name to `out`, shape (tracks,), and return how many.

    They are called so because the readings say it, or because a person does.
    """
    n = 0
    for t in range(ti.shape[0]):
        is_called = ti[t, ST] == ESTABLISHED and ti[t, CALLED] == 1
        if is_called or (ti[t, ST] != FREE and names[t, MARK] != 0):
            out[n] = t
            n += 1
    return n


@kernel
def mark_changed(ti: Ints, tf: Floats, names: Ints, told: Floats, n: int, sure: Ints) -> None:
    """Turn the number t of each sure track that is not as it was told last to ~t, and note what is told now.

    Parameters
    ----------
    ti, tf, names
        As in `State`.
    told : (tracks, TOLD) float
        What `circle` made an object from. Updated.
    n : int
        Tracks in `sure`.
    sure : (tracks,) int
        From `sure_circles`. Updated.
    """
    for i in range(n):
        t = sure[i]
        now = (
            tf[t, TX], tf[t, TY], tf[t, C00], tf[t, C01], tf[t, C11], tf[t, HITS], tf[t, PROB], float(ti[t, KIND]),
            float(names[t, NUMBER]), float(names[t, MARK]),
        )  # fmt: skip
        for k in range(TOLD):
            if told[t, k] != now[k]:
                told[t, k] = now[k]
                sure[i] = ~t


@kernel
def is_sure_polygon(pi: Ints, pf: Floats, pbn: Ints, pbins: Floats, least: float, t: int) -> bool:
    """Tell whether polygon `t` is sure by its readings; the other arguments as in `State`."""
    if pi[t, ST] != ESTABLISHED or pf[t, PPROB] < least or max(pf[t, PXX], pf[t, PYY]) > POLYGON_SIGMA_MAX_M**2:
        return False
    swept = 0
    nearest = FAR
    heard = 0
    x = 0.0
    y = 0.0
    for b in range(pbn.shape[1]):
        swept += min(pbn[t, b], PCAP)
        for k in range(min(pbn[t, b], PCAP)):
            if pbins[t, b, k, 4] < FAR:
                nearest = min(nearest, pbins[t, b, k, 4])
                x += pbins[t, b, k, 2]
                y += pbins[t, b, k, 3]
                heard += 1
    if pf[t, PHITS] < (POLYGON_HITS_SWEPT if swept >= POLYGON_SWEPT else POLYGON_HITS):
        return False
    return heard > 0 and nearest <= POLYGON_NEAR_M and 1.0 - math.hypot(x, y) / heard > POLYGON_SPREAD


@kernel
def sure_polygons(
    pi: Ints, pf: Floats, pbn: Ints, pbins: Floats, names: Ints, first: int, least: float, out: Ints
) -> int:  # fmt: skip
    """Write the polygon tracks that are sure, or that a person spoke of, to `out` and return how many.

    The first polygon's row of `names` is `first`; the other arguments are as in `State`.
    """
    n = 0
    for t in range(pi.shape[0]):
        spoken_of = pi[t, ST] != FREE and names[first + t, MARK] != 0
        if spoken_of or is_sure_polygon(pi, pf, pbn, pbins, least, t):
            out[n] = t
            n += 1
    return n


def worst_sigma(xx: float, xy: float, yy: float) -> float:
    """Return the standard deviation along the worst axis of a covariance."""
    middle = 0.5 * (xx + yy)
    return math.sqrt(max(0.0, middle + math.hypot(0.5 * (xx - yy), xy)))


def circle(s: State, p: Settings, t: int, label: str, probability: float) -> DetectedObject:
    """Return a circle's track as an object; a circle has no heading."""
    track = s.tf[t].tolist()
    xx, xy, yy = p.inflate * track[C00], p.inflate * track[C01], p.inflate * track[C11]
    return DetectedObject(
        label,
        track[TX],
        track[TY],
        0.0,
        worst_sigma(xx, xy, yy),
        int(track[HITS]),
        probability,
        probability,
        (xx, xy, yy),
        *said(s, t),
    )


def said(s: State, row: int) -> tuple[int | None, bool, bool]:
    """Return a track's number, whether a person said that it is there, and whether one put it there."""
    number, mark = s.names[row].tolist()
    return number or None, bool(mark & CONFIRMED), bool(mark & PLACED)


def polygon_covariance(track: Floats) -> Floats:
    """Return the covariance of a polygon's x, y (m) and heading (rad) from its row of `State.pf`; shape (3, 3)."""
    covariance = np.zeros((3, 3))
    covariance[np.tril_indices(3)] = POLYGON_INFLATE * track[PXX : PTT + 1]
    covariance[2, 2] += POLYGON_TURN**2
    return covariance + np.tril(covariance, -1).T


def polygon(s: State, p: Settings, t: int, label: str, probability: float) -> DetectedObject:
    """Return a polygon's track as an object; of the headings at which it looks alike the least one from −π on."""
    track = s.pf[t]
    theta = float(track[PTH])
    covariance = polygon_covariance(track)
    xx, xy, yy = float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1])
    period = 2.0 * math.pi / int(p.sym[s.pi[t, MODEL]])
    is_placed = xx > 0.0  # else only a person's word places it so far
    return DetectedObject(
        label, float(track[PX]), float(track[PY]), (theta + 0.5 * period) % period - 0.5 * period,
        worst_sigma(xx, xy, yy) if is_placed else BY_HAND_M, int(track[PHITS]), probability, probability,
        (xx, xy, yy) if is_placed else None, *said(s, s.ti.shape[0] + t),
    )  # fmt: skip


def wall(line: Floats) -> DetectedObject:
    """Return a line as an object: the middle of what was seen of it, and its direction."""
    nx, ny, middle = float(line[LNX]), float(line[LNY]), 0.5 * float(line[LLO] + line[LHI])
    across, length = float(line[LP11] + line[LP00] * middle**2), float(line[LHI] - line[LLO])
    along = length * length / 12.0
    xx, yy = nx * nx * across + ny * ny * along, ny * ny * across + nx * nx * along
    xy = nx * ny * (across - along)
    probability = 1.0 / (1.0 + math.exp(-float(line[LLOG])))
    return DetectedObject(
        "wall", float(line[LOX] + line[LC] * nx) - ny * middle, float(line[LOY] + line[LC] * ny) + nx * middle,
        math.atan2(nx, -ny), worst_sigma(xx, xy, yy), int(line[LN]), probability, probability, (xx, xy, yy),
    )  # fmt: skip


def rival_label(s: State, t: int) -> str:
    """Return what a track that is no model looks like."""
    x, y, rho = (float(v) for v in s.tf[t, [TX, TY, TRHO]])
    if rho > 0.0:
        return "post" if rho < POST_M else "barrel"
    for line in s.lines:
        if is_wall(line):
            dx, dy = x - line[LOX], y - line[LOY]
            along = -line[LNY] * dx + line[LNX] * dy
            beside = line[LLO] - CORNER_M < along < line[LHI] + CORNER_M
            if beside and abs(line[LNX] * dx + line[LNY] * dy - line[LC]) < CORNER_M:
                return "inside corner"
    return "edge"


def rival_labels(p: Settings, rounds: Sequence[str]) -> tuple[str, ...]:
    """Return what the columns of `State.comp` are called: the round models, their rivals, a line and a wedge."""
    others = ["edge" if rho == 0.0 else "post" if rho < POST_M else "barrel" for rho in p.radii[p.models :].tolist()]
    return (*rounds, *others, "wall", "corner")


def other_things(s: State, p: Settings, least: float, called: Sequence[DetectedObject]) -> list[DetectedObject]:
    """Return what has no model's name: walls, corners, edges, posts, barrels, and what is unknown."""
    found = [wall(line) for line in s.lines if is_wall(line)]
    for t in np.flatnonzero(s.ti[:, ST] != FREE):
        place, track = (float(s.tf[t, TX]), float(s.tf[t, TY])), s.tf[t]
        if track[HITS] < UNKNOWN_HITS or any(math.dist(place, (o.x, o.y)) < p.merge for o in called):
            continue
        is_rival = s.ti[t, ST] == ESTABLISHED and s.ti[t, KIND] >= p.models and track[PROB] >= least
        probability = float(track[PROB])
        found.append(
            circle(s, p, int(t), rival_label(s, int(t)), probability)
            if is_rival
            else circle(s, p, int(t), "unknown", 1.0 - probability)
        )
    return found
