"""The bins of a wall: where they lie, what they hold, and how readings enter them."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.bayes.inference.reservoir import copy_reading
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.wall_records import WALL_BIN_M, WALL_BINS, Wall, WallBin, WallMap
from perception.bayes.walls.contact import BEAM_EDGE, edge_direction, range_sigma, wall_normal
from perception.kernel import kernel

HALF: Final = WALL_BINS // 2
"""Bins of a wall on either side of its frame's origin."""
BIN_WEIGHT_MAX: Final = 40.0
"""Weight of a bin at which older readings fade."""
EDGE_WEIGHT: Final = 0.5
"""Weight of an echo from the beam's edge: the beam is not known as well as the range."""
PASSES_KEPT: Final = 0.7
"""Share of a bin's passes that remain after an echo."""
WEIGHT_KEPT: Final = 0.85
"""Share of a bin's weight that remains after a pass."""
PASSES_MAX: Final = 8.0
"""Passes of a bin beyond which more of them say nothing new."""
SILENT_PASS: Final = 0.7
"""Weight of a silence as a pass: some echoes drop out."""


@kernel
def bin_of(along: float) -> int:
    """Return the bin of a position along a wall; it may be outside the bins."""
    return math.floor(along / WALL_BIN_M) + HALF


@kernel
def middle_of(b: int) -> float:
    """Return the position of a bin's middle along the wall, m."""
    return (b - HALF + 0.5) * WALL_BIN_M


@kernel
def is_covered(of: WallBin) -> bool:
    """Return whether a bin holds more echoes than passes."""
    return bool(of.weight > 0.0 and of.weight > of.passes)


@kernel
def mean_error(wall: Wall, b: int) -> float:
    """Return how far behind the line the echoes of a bin lie on average, m; the bin is not empty."""
    of = wall.bins[b]
    return of.offset_sum / of.precision - wall.offset - wall.slope * middle_of(b)


@kernel
def clear_wall(wall: Wall) -> None:
    """Free a wall's place."""
    wall.weight = 0.0
    wall.reviewed.information = 0.0
    wall.is_changed = 0
    wall.span_count = 0
    clear_bins(wall)


@kernel
def clear_bins(wall: Wall) -> None:
    """Empty a wall's bins."""
    for b in range(WALL_BINS):
        of = wall.bins[b]
        of.weight = 0.0
        of.precision = 0.0
        of.offset_sum = 0.0
        of.range_sum = 0.0
        of.passes = 0.0
        of.number = 0
        of.is_held = 0
        of.is_open = 0
        of.is_kept = 0


def free(wall: Wall) -> None:
    """Free a wall's place, as `clear_wall` does in compiled code.

    Parameters
    ----------
    wall : Wall
        A record of numpy.
    """
    wall.weight, wall.reviewed.information, wall.is_changed, wall.span_count = 0.0, 0.0, 0, 0
    np.asarray(wall.bins).view(np.uint8)[...] = 0


@kernel
def fade(of: WallBin, share: float) -> None:
    """Keep this share of a bin's echoes."""
    of.weight *= share
    of.precision *= share
    of.offset_sum *= share
    of.range_sum *= share


@kernel
def enter_reading(room: WallMap, wall: Wall, q: Reading, kind: int, p: SettingsRecord) -> None:
    """Enter an echo of a wall into the bin where it touches the wall.

    Parameters
    ----------
    room : WallMap
        The noise.
    wall : Wall
        Updated, but not fitted.
    q, kind, p
        The reading, `FOOT` or `BEAM_EDGE`, and the settings.
    """
    nx, ny = wall_normal(wall)
    weight = 1.0
    if kind == BEAM_EDGE:
        nx, ny = edge_direction(q, nx, ny, p)
        weight = EDGE_WEIGHT
    dx = q.x + q.range_m * nx - wall.origin_x
    dy = q.y + q.range_m * ny - wall.origin_y
    along = wall.normal_x * dy - wall.normal_y * dx
    offset = wall.normal_x * dx + wall.normal_y * dy
    b = bin_of(along)
    if not 0 <= b < WALL_BINS:
        return
    of = wall.bins[b]
    if of.weight >= BIN_WEIGHT_MAX:
        fade(of, (BIN_WEIGHT_MAX - 1.0) / of.weight)
    if of.weight == 0.0:
        of.is_held = 1
    of.weight += weight
    # A near echo places the wall better than a far one.
    precision = weight / range_sigma(room, q.range_m) ** 2
    of.precision += precision
    # The line's offset at the bin's middle, not at the place itself.
    of.offset_sum += precision * (offset + wall.slope * (middle_of(b) - along))
    of.range_sum += precision * q.range_m
    of.passes *= PASSES_KEPT
    copy_reading(q, of.newest)
    wall.is_changed = 1


@kernel
def enter_pass(wall: Wall, b: int, weight: float) -> None:
    """Enter a range that passed through a bin.

    Parameters
    ----------
    wall, b
        The wall, updated, and the bin.
    weight : float
        1, or `SILENT_PASS` for a silence.
    """
    of = wall.bins[b]
    of.passes = min(of.passes + weight, PASSES_MAX)
    fade(of, WEIGHT_KEPT)
