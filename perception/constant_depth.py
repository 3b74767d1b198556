"""The surfaces that a sensor on a servo hears from one place: its regions of constant depth.

The nearest point of a surface answers over the whole width of the beam, so that neighbouring bearings hear the same
range (Kuc and Siegel 1987, Leonard and Durrant-Whyte 1992). Where the region ends on both sides, the surface lies in
its middle. Of what kind it is, one place does not show: from one point a wall, an edge and a drum sound alike.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from config.robot import RingConfig
from drivers.messages import Firing
from perception.echo_kind import EchoKind
from perception.shared_numbers import OUTLIER_SIGMAS

DEPTH_NOISE_M: Final = 3e-3
"""Standard deviation of a range of ultrasonic modules; with the resolution it says which ranges are the same."""
WIDTH_MIN: Final = 0.5
"""A region is at least so many beams wide; narrower ones are strays and ends of others."""
_UNDECIDED: Final = (0.25, 0.25, 0.25, 0.25)
"""Probabilities of the four kinds of surfaces: a depth alone shows none."""


def constant_depths(ring: RingConfig, firings: Sequence[Firing]) -> list[tuple[EchoKind, int]]:
    """Return the surfaces, each with the number of its bearings.

    Parameters
    ----------
    ring : RingConfig
        With sensors on servos; its other sensors are not used.
    firings : sequence of Firing
        Of one stand.
    """
    heard = np.array([firing.ranges_m for firing in firings])
    found, begin = list[tuple[EchoKind, int]](), 0
    for sensor in ring.sensors or ():
        count = len(sensor.views)
        if sensor.servo:
            ranges = [_median(heard[:, begin + k].tolist()) for k in range(count)]
            for first, last in _regions(ranges, ring, endless=sensor.is_endless):
                axes = [sensor.views[k % count].angle_rad for k in (first, last)]
                middle = axes[0] + 0.5 * ((axes[1] - axes[0]) % math.tau)
                away = sensor.arm_m + float(np.mean([ranges[k % count] for k in range(first, last + 1)]))
                x, y = sensor.x_m + away * math.cos(middle), sensor.y_m + away * math.sin(middle)
                step = (sensor.views[1].angle_rad - sensor.views[0].angle_rad) % math.tau
                # Each end of the region is uniform over a step.
                sigma, paths = step / math.sqrt(24.0), last + 1 - first
                sigma_m = math.hypot(DEPTH_NOISE_M, ring.resolution_m / math.sqrt(12.0)) / math.sqrt(paths)
                surface = EchoKind(math.atan2(y, x), math.hypot(x, y), sigma, sigma_m, _UNDECIDED, math.nan, 1.0)
                found.append((surface, paths))
        begin += count
    return found


def _median(values: list[float]) -> float:
    """Return the median of the readings at a bearing, m; +inf where most are silent or there are none."""
    readings = [value for value in values if not math.isnan(value)]
    return float(np.quantile(readings, 0.5, method="higher")) if readings else math.inf


def _regions(ranges: list[float], ring: RingConfig, *, endless: bool) -> list[tuple[int, int]]:
    """Return the first and last bearing of each region; on an endless turn numbers go on beyond the last bearing."""
    count, same_m = len(ranges), OUTLIER_SIGMAS * DEPTH_NOISE_M + ring.resolution_m
    sensor_steps = [
        s.sweep_deg / (s.bearings if s.is_endless else s.bearings - 1) for s in ring.sensors or () if s.servo
    ]
    least = max(3, math.ceil(WIDTH_MIN * 2.0 * ring.beam_half_angle_deg / max(sensor_steps)))
    found, taken = list[tuple[int, int]](), np.zeros(count, dtype=np.bool_)

    def at(k: int) -> float:
        return ranges[k % count] if endless or 0 <= k < count else math.inf

    for start in sorted(range(count), key=ranges.__getitem__):
        if taken[start] or ranges[start] == math.inf:
            continue
        first = last = start
        while last - first < count - 1 and at(first - 1) - ranges[start] <= same_m and not taken[(first - 1) % count]:
            first -= 1
        while last - first < count - 1 and at(last + 1) - ranges[start] <= same_m and not taken[(last + 1) % count]:
            last += 1
        # Beyond a region something nearer may hide its end: then its middle is not where the surface is.
        is_whole = at(first - 1) > ranges[start] and at(last + 1) > ranges[start]
        taken[[k % count for k in range(first, last + 1)]] = True
        if last + 1 - first >= least and is_whole:
            found.append((first, last))
    return found
