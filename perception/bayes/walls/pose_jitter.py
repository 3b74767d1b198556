"""The error of a firing's pose, which its readings have in common, by the walls that they hear.

The poses of real robots jump by centimetres from one firing to the next. Each echo of a wall then errs by the same
shift, seen along the wall's normal, so the echoes of a firing show the shift together. A reading is placed where the
other readings of its firing have the ring: with its own error it would confirm whatever explains it.

How far poses jump is one of `JITTERS_M`. Noise of the ranges gives errors of the same size, each for itself; only a
lead over that moves readings, so that exact poses stay what they are.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.memory.elements import Reading
from perception.bayes.memory.scratch import Pull, ShiftInformation
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import StateRecord
from perception.bayes.memory.wall_records import JITTERS, MAX_WALLS, PoseJitter, WallMap
from perception.bayes.walls.contact import (
    BEAM_EDGE,
    EXPLAINED_SIGMAS,
    FIRM_WEIGHT,
    NOWHERE,
    contact,
    edge_direction,
    edges_answer,
    is_on_span,
    line_variance,
    range_sigma,
    wall_normal,
)
from perception.kernel import kernel
from perception.records import Records
from perception.shared_numbers import FAR

JITTERS_M: Final = (0.0, 0.0075, 0.015, 0.03, 0.06)
"""Standard deviations of a pose along each axis, m, of which one is assumed."""
JITTER_LEAD_NAT: Final = 20.0
"""Least lead of a shift in common over errors of each reading for itself at which readings are moved."""
JITTER_MEMORY: Final = 0.999
"""Factor on that evidence with each firing: a memory of a thousand."""
JITTER_PULLS_MIN: Final = 2
"""Firings with fewer echoes of walls say nothing of what is common to them."""
MEAN_SHARE: Final = 0.1
"""Share of each firing in the mean shift. Jitter is what is left of it: the map follows odometry in the mean. With
.02 readings are drawn back to where the walls were for a hundred firings after wheels have slipped by 8 cm: of 8
drums none is found there then, with .1 five."""
MEAN_SIGMA_M: Final = 0.015
"""Standard deviation assumed of a shift when it enters the mean."""


@kernel
def find_pull(room: WallMap, q: Reading, p: SettingsRecord, variance: float, pull: Pull) -> None:
    """Write what a reading says of the ring's shift, by the wall that explains it best.

    Parameters
    ----------
    room, q, p
        The walls, the reading and the settings.
    variance : float
        Assumed of the shift along each axis, m².
    pull : Pull
        Out.
    """
    pull.accuracy = 0.0
    if q.range_m >= FAR:
        return
    edges = edges_answer(room)
    least = EXPLAINED_SIGMAS
    for k in range(MAX_WALLS):
        wall = room.walls[k]
        if wall.weight < FIRM_WEIGHT:
            continue
        kind, expected, along, dot = contact(wall, q, p)
        if kind == NOWHERE or (kind == BEAM_EDGE and not edges) or not is_on_span(wall, along, 0.0):
            continue
        nx, ny = wall_normal(wall)
        if kind == BEAM_EDGE:
            ex, ey = edge_direction(q, nx, ny, p)
            scale = 1.0 / (nx * ex + ny * ey)
            nx *= scale
            ny *= scale
        error = q.range_m - expected + nx * room.jitter.x + ny * room.jitter.y
        own = range_sigma(room, expected) ** 2 + line_variance(wall, along) / dot**2
        sigmas = abs(error) / math.sqrt(own + variance)
        if sigmas < least:
            least = sigmas
            pull.x, pull.y = -nx, -ny
            pull.error = error
            pull.accuracy = 1.0 / own


@kernel
def add_pull(shift: ShiftInformation, pull: Pull, times: float) -> None:
    """Add what a reading says of the shift to the information on it, `times` 1, or take it away, −1."""
    w = times * pull.accuracy
    shift.xx += w * pull.x * pull.x
    shift.xy += w * pull.x * pull.y
    shift.yy += w * pull.y * pull.y
    shift.x += w * pull.x * pull.error
    shift.y += w * pull.y * pull.error


@kernel
def sum_pulls(shift: ShiftInformation, pulls: Records[Pull], m: int) -> None:
    """Write the information of the first `m` readings on the shift."""
    shift.xx = shift.xy = shift.yy = shift.x = shift.y = 0.0
    for i in range(m):
        add_pull(shift, pulls[i], 1.0)


@kernel
def mean_shift(shift: ShiftInformation, variance: float) -> tuple[float, float]:
    """Return the mean of a shift of this variance along each axis (m²), given the information on it, m."""
    a, b, c = 1.0 + variance * shift.xx, variance * shift.xy, 1.0 + variance * shift.yy
    share = variance / (a * c - b * b)
    return share * (c * shift.x - b * shift.y), share * (a * shift.y - b * shift.x)


@kernel
def weigh_jitters(jitter: PoseJitter, shift: ShiftInformation, pulls: Records[Pull], m: int) -> None:
    """Add the evidence of a firing for each jitter, and choose the one that is assumed.

    With errors e, gradients G and accuracies W, the evidence of a variance v in common, and of one for each reading,
    both over none, is::

        ½ eᵀ W G (GᵀWG + 1/v)⁻¹ GᵀW e − ½ log det(1 + v GᵀWG)
        Σ ½ w e² h/(1 + h) − ½ log(1 + h)        h = v w |g|²

    Parameters
    ----------
    jitter : PoseJitter
        Updated.
    shift, pulls, m
        The information of the first `m` readings on the shift, together and of each.
    """
    heard = 0
    for i in range(m):
        heard += pulls[i].accuracy > 0.0
    if heard < JITTER_PULLS_MIN:
        return
    best, alone = 0, 0.0
    for k in range(1, JITTERS):
        v = JITTERS_M[k] ** 2
        dx, dy = mean_shift(shift, v)
        det = (1.0 + v * shift.xx) * (1.0 + v * shift.yy) - (v * shift.xy) ** 2
        common_nat = 0.5 * (shift.x * dx + shift.y * dy - math.log(det))
        alone_nat = 0.0
        for i in range(m):
            pull = pulls[i]
            h = v * pull.accuracy * (pull.x**2 + pull.y**2)
            alone_nat += 0.5 * (pull.accuracy * pull.error**2 * h / (1.0 + h) - math.log(1.0 + h))
        jitter.common_nat[k] = JITTER_MEMORY * jitter.common_nat[k] + common_nat
        jitter.alone_nat[k] = JITTER_MEMORY * jitter.alone_nat[k] + alone_nat
        alone = max(alone, jitter.alone_nat[k])
        if jitter.common_nat[k] > jitter.common_nat[best]:
            best = k
    jitter.level = best if jitter.common_nat[best] > alone + JITTER_LEAD_NAT else 0


@kernel
def place_by_others(s: StateRecord, p: SettingsRecord, m: int) -> None:
    """Move each fired reading to where the others of its firing have the ring.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    m : int
        Number of fired readings, the first of the scratch.
    """
    room, scratch = s[0].room, s[0].scratch
    jitter, shift, pulls = room.jitter, scratch.shift, scratch.pulls
    variance = JITTERS_M[jitter.level] ** 2
    for i in range(m):
        find_pull(room, scratch.fired[i], p, variance, pulls[i])
    sum_pulls(shift, pulls, m)
    weigh_jitters(jitter, shift, pulls, m)
    dx, dy = mean_shift(shift, variance)
    for i in range(m):  # What the shift does not explain came from something else.
        off = pulls[i].error - pulls[i].x * dx - pulls[i].y * dy
        if off * off * pulls[i].accuracy > EXPLAINED_SIGMAS**2:
            pulls[i].accuracy = 0.0
    sum_pulls(shift, pulls, m)
    dx, dy = mean_shift(shift, MEAN_SIGMA_M**2)
    jitter.x += MEAN_SHARE * dx
    jitter.y += MEAN_SHARE * dy
    if jitter.level == 0:
        return
    for i in range(m):
        add_pull(shift, pulls[i], -1.0)
        dx, dy = mean_shift(shift, variance)
        add_pull(shift, pulls[i], 1.0)
        scratch.fired[i].x += dx
        scratch.fired[i].y += dy
