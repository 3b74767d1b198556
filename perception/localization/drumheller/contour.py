"""Line segments from the sonar contour: runs of consecutive ranges that one straight wall explains.

For a wall of normal direction α, a sensor whose beam holds the perpendicular reads the distance d; one whose beam
misses it by the angle e reads d / cos e, at the beam's edge (`cone`), or nothing (`specular`). So each range and each
α give the wall's offset up to the error of the range, as an interval. A run grows while, for some α, the intervals of
all its ranges share a point. What remains is the set of all lines that explain the run: its middle is the segment's
direction, its width the uncertainty. A run of two neighbours is McKerrow's tangent, and the region of constant depth
of Leonard and Durrant-Whyte.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from perception.kernel import Floats
from perception.localization.drumheller.panorama import Panorama
from perception.localization.room.expected_ranges import Reflection
from perception.localization.room.range_likelihood import RangeModel
from perception.shared_numbers import BESIDE_MAX_RAD, NORMAL_DIRECTIONS

TOLERANCE_SIGMAS: Final = 2.5
"""Half the width of a range's interval in standard deviations."""


class ContourSegment(NamedTuple):
    """A straight part of the contour, in the panorama's frame."""

    readings: int
    """Ranges in its run."""
    alpha: float
    """Direction of its normal, away from the sensors, rad."""
    alpha_slack: float
    """Half the width of the set of directions that explain the run, rad."""
    offset: float
    """Normal · point of its points, m."""
    offset_slack: float
    """Half the width of that set, m."""
    x: float
    """Middle of the part that echoed, m."""
    y: float
    length: float
    """Length of the part that echoed, m."""


def contour_segments(
    panorama: Panorama, half_angle: float, reflection: Reflection, model: RangeModel
) -> tuple[ContourSegment, ...]:
    """Return the longest runs of a panorama as segments: most readings first, then nearest.

    Parameters
    ----------
    panorama : Panorama
        The readings.
    half_angle : float
        Half the beam's opening, rad.
    reflection : str
        `cone` or `specular`.
    model : RangeModel
        Errors of a range.
    """
    heard = np.flatnonzero(np.isfinite(panorama.range_m))
    r, axis = panorama.range_m[heard], panorama.axis[heard]
    alpha = 2.0 * math.pi / NORMAL_DIRECTIONS * np.arange(NORMAL_DIRECTIONS)
    off = (alpha - axis[:, None] + math.pi) % (2.0 * math.pi) - math.pi
    slant = np.maximum(np.abs(off) - half_angle, 0.0)
    offset = r[:, None] * np.cos(slant)
    offset += np.cos(alpha) * panorama.x[heard][:, None] + np.sin(alpha) * panorama.y[heard][:, None]
    slack = TOLERANCE_SIGMAS * model.sigma(r)[:, None]
    offset[slant > (BESIDE_MAX_RAD if reflection == "cone" else 0.0)] = np.nan
    low, high = offset - slack, offset + slack

    runs: list[list[int]] = []
    for run in sorted((_run(low, high, first) for first in range(len(r))), key=len, reverse=True):
        if not any(set(run) <= set(longer) for longer in runs):
            runs.append(run)
    segments = []
    for run in runs:
        lo, hi = low[run].max(axis=0), high[run].min(axis=0)
        fits = np.flatnonzero(lo <= hi)
        middle = math.atan2(np.sin(alpha[fits]).mean(), np.cos(alpha[fits]).mean())
        spread = (alpha[fits] - middle + math.pi) % (2.0 * math.pi) - math.pi
        best = fits[np.abs(spread).argmin()]
        ray = axis[run] + np.clip((middle - axis[run] + math.pi) % (2 * math.pi) - math.pi, -half_angle, half_angle)
        x = panorama.x[heard][run] + r[run] * np.cos(ray)
        y = panorama.y[heard][run] + r[run] * np.sin(ray)
        along = y * math.cos(middle) - x * math.sin(middle)
        segments.append(
            ContourSegment(
                len(run),
                middle,
                float(np.abs(spread).max()) + 2.0 * math.pi / NORMAL_DIRECTIONS,
                0.5 * float(lo[best] + hi[best]),
                0.5 * float(hi[best] - lo[best]),
                float(x.mean()),
                float(y.mean()),
                float(np.ptp(along)),
            )
        )
    return tuple(sorted(segments, key=lambda s: (-s.readings, s.offset)))


def _run(low: Floats, high: Floats, first: int) -> list[int]:
    """Return the consecutive ranges from `first` on that one line explains."""
    lo, hi = low[first], high[first]
    run = [first]
    for count in range(1, len(low)):
        following = (first + count) % len(low)
        lo, hi = np.maximum(lo, low[following]), np.minimum(hi, high[following])
        if not (lo <= hi).any():
            break
        run.append(following)
    return run
