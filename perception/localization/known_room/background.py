"""The readings of a ring that may be anywhere in a room: what a place has to explain better to be the robot's.

A place in a wrong map explains some readings by chance, because rooms are alike: most ranges are those of a room's
typical size. So readings are compared with a ring at no place in particular, whose sensors hear as often as this
ring's do, and read what the map's surfaces give on the average over all its places.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.bounds import Bound, bounds
from perception.kernel import Floats
from perception.localization.known_room.mixed_reflection import LATE_M, MEMORY_READINGS, LearnedShares
from perception.localization.known_room.pose_grid import GRID_DIRECTIONS, RANGE_STEPS, SILENT_CODE, fill_cell
from perception.localization.known_room.surroundings import Surroundings
from perception.localization.room.range_likelihood import HEARD_PRIOR
from perception.localization.room.room import Room

BACKGROUND_PLACES: Final = 100
"""Places at which the map's ranges are taken."""
SMOOTH_M: Final = 0.1
"""Standard deviation of the smoothing of their distribution."""
EVEN_SHARE: Final = 0.1
"""So much of it is the same at all ranges."""
HEARD_SHARE_MIN: Final = 0.1
"""Least share, and with its complement the greatest."""


class Background:
    """How likely ranges are without a place.

    Parameters
    ----------
    room : Room
        The surfaces.
    surroundings : Surroundings
        Of this room.
    clear_m : float
        The ring's centre is farther than this from any surface, m.
    """

    SCRATCH: Final = ("_densities", "_window_m")
    """What follows from the room."""
    BOUNDS: Final = bounds(heard_share=Bound(HEARD_SHARE_MIN, 1.0 - HEARD_SHARE_MIN))

    def __init__(self, room: Room, surroundings: Surroundings, clear_m: float) -> None:
        self._window_m = float(surroundings.sensor[0].window_m)
        self._densities = _range_densities(room, surroundings, clear_m)
        self.heard_share = HEARD_PRIOR
        """Share of this ring's readings that hear something, as learned so far."""

    def reset(self) -> None:
        """Forget how often the sensors hear something."""
        self.heard_share = HEARD_PRIOR

    def observe(self, ranges_m: Floats) -> None:
        """Take the ranges (m; inf for silence) of a keyframe."""
        heard = float(np.isfinite(ranges_m).sum())
        share = self.heard_share + (heard - self.heard_share * len(ranges_m)) / MEMORY_READINGS
        self.heard_share = min(1.0 - HEARD_SHARE_MIN, max(HEARD_SHARE_MIN, share))

    def log_ratio(self, ranges_m: Floats, shares: LearnedShares) -> float:
        """Return the log likelihood ratio of readings without a place to evenly distributed ones, nat.

        Parameters
        ----------
        ranges_m : (n,) float
            Of a keyframe, m; inf for silence.
        shares : LearnedShares
            How often a reading has which cause.
        """
        cone, mirror, late = self._densities
        share = shares.records[0]
        smooth = (1.0 - share.late) * mirror + share.late * late
        density = share.wild / self._window_m + (1.0 - share.wild) * (
            (1.0 - share.specular) * cone + share.specular * smooth
        )
        heard = ranges_m[np.isfinite(ranges_m)]
        codes = np.minimum(heard * (RANGE_STEPS / self._window_m) + 0.5, RANGE_STEPS).astype(np.int64)
        silent = len(ranges_m) - len(heard)
        found = np.log(density[codes] * (self._window_m * self.heard_share / HEARD_PRIOR)).sum()
        return float(found) + silent * math.log((1.0 - self.heard_share) / (1.0 - HEARD_PRIOR))


def _range_densities(room: Room, surroundings: Surroundings, clear_m: float) -> Floats:
    """Return the densities (1/m) of the ranges in a map: by `cone`, by `specular`, and over a second surface.

    Shape (3, 255): by the code of a range, as in the table of `perception.localization.known_room.pose_grid`.
    """
    low, high = room.bounds
    side = math.sqrt(room.area_m2 / BACKGROUND_PLACES) or 1.0
    counts = np.maximum(1, np.ceil((high - low) / side)).astype(np.int64)
    x, y = (
        lower + (np.arange(n) + 0.5) * (upper - lower) / n for lower, upper, n in zip(low, high, counts, strict=True)
    )
    table = np.full((2, GRID_DIRECTIONS, len(x), len(y)), SILENT_CODE, dtype=np.uint8)
    free = np.zeros((len(x), len(y)), dtype=np.uint8)
    for i, at_x in enumerate(x.tolist()):
        for j, at_y in enumerate(y.tolist()):
            fill_cell(surroundings, table, free, i, j, at_x, at_y, clear_m)
    step_m = float(surroundings.sensor[0].window_m) / RANGE_STEPS
    near = np.arange(-RANGE_STEPS, RANGE_STEPS + 1) * step_m
    blur = np.exp(-0.5 * (near / SMOOTH_M) ** 2)
    late = ((near > 0.0) & (near <= LATE_M)).astype(np.float64)
    heard = (np.bincount(codes[:, free == 1].ravel(), minlength=SILENT_CODE)[:SILENT_CODE] for codes in table)
    cone, mirror = (counts.astype(np.float64) for counts in heard)
    rows = [_density(ranges, kernel, step_m) for ranges, kernel in ((cone, blur), (mirror, blur), (cone, late))]
    return np.array(rows)


def _density(ranges: Floats, kernel: Floats, step_m: float) -> Floats:
    """Return a density (1/m) of codes from how often each occurs, blurred."""
    blurred = np.convolve(ranges, kernel)[RANGE_STEPS : RANGE_STEPS + len(ranges)]
    total = blurred.sum() * step_m
    even = 1.0 / (len(ranges) * step_m)
    return np.asarray(
        (1.0 - EVEN_SHARE) * blurred / total + EVEN_SHARE * even if total > 0.0 else np.full(len(ranges), even)
    )
