"""Whether the readings show that odometry drifts: a filter that takes odometry as exact, beside one that does not.

Both filters have the same landmarks and enter the same readings. Each filter predicts a reading before it is entered.
The logarithm of the ratio of the two densities is the evidence of that reading (A. P. Dawid, "Statistical theory: the
prequential approach", 1984). It is added up for each landmark, and a sum that would be negative begins again at 0, as
odometry may begin to drift at any time (E. S. Page, "Continuous inspection schemes", 1954). A landmark that was
recognised wrongly, or has moved, contradicts odometry as well, but it does so alone: the greatest sum is left out.
"""

from __future__ import annotations

import math
from typing import Final

from config.robot import RingConfig
from perception.kernel import Floats, kernel
from perception.localization.drift.landmark_association import MARGIN_RAD, MARGIN_SIGMAS, OWN_M, bearing_variance
from perception.localization.drift.landmark_filter import innovation_variance, rows_used
from perception.localization.drift.landmark_ranges import has_moved_since
from perception.localization.drift.landmark_state import FIRST, EstimateRecord, SonarModel
from perception.localization.drift.landmark_tracker import LandmarkTracker
from perception.sensor_mounts import RingPose

OTHER_PER_M: Final = 0.05
"""Density (1/m) of the ranges that are of something else than the landmarks in the beam, under both hypotheses: it
bounds the evidence of one reading."""
HITS_MIN: Final = 10
"""Readings of a landmark that exact odometry has explained before the landmark counts. One that was placed from poses
with a false correction never fits exact odometry; without this, that refuted it in one of 40 logs."""
REFUTED_NAT: Final = 50.0
"""Evidence that refutes exact odometry. Two false landmarks reached 26 in 60 s in one of 40 logs with good odometry.
With 1 % and .3°/√m it reaches hundreds among several drums."""


@kernel
def density_of_range(
    e: EstimateRecord, covariance: Floats, i: int, x: float, y: float, r: float, var0: float, rel2: float
) -> float:
    """Return the probability density (1/m) of a range as an echo of landmark `i`.

    Parameters
    ----------
    e : (1,) Estimate
        The mean.
    covariance : (rows, rows) float
        Of it.
    i : int
        The landmark.
    x, y : float
        The sensor's place by this estimate, m.
    r : float
        Range, m.
    var0, rel2 : float
        Nominal variance of a range: var0 (m²) + rel2 · r².
    """
    est = e[0]
    landmark = est.landmarks[i]
    dx, dy = landmark.x - x, landmark.y - y
    d = math.sqrt(dx * dx + dy * dy)
    predicted = est.range_scale * (d - landmark.radius)
    off = r - predicted
    if predicted <= 0.0 or abs(off) > OWN_M:
        return 0.0
    u, v = est.range_scale * dx / d, est.range_scale * dy / d
    variance = innovation_variance(covariance, rows_used(e), FIRST + 2 * i, u, v, d - landmark.radius, est.gain)
    variance += est.noise * (var0 + rel2 * predicted * predicted)
    return math.exp(-0.5 * off * off / variance) / math.sqrt(2.0 * math.pi * variance)


@kernel
def may_be_in_beam(
    e: EstimateRecord, covariance: Floats, i: int, x: float, y: float, axis: float, half_angle: float
) -> bool:
    """Return whether landmark `i` may be in the beam of a sensor at (x, y) (m) with this axis (rad)."""
    landmark = e[0].landmarks[i]
    dx, dy = landmark.x - x, landmark.y - y
    if dx == 0.0 and dy == 0.0:
        return False
    ax, ay = math.cos(axis), math.sin(axis)
    margin = MARGIN_RAD + MARGIN_SIGMAS * math.sqrt(bearing_variance(covariance, i, dx, dy))
    return abs(math.atan2(ax * dy - ay * dx, ax * dx + ay * dy)) < half_angle + margin


@kernel
def compare_firing(
    e: EstimateRecord,
    covariance: Floats,
    exact: EstimateRecord,
    exact_covariance: Floats,
    mounts: Floats,
    ranges: Floats,
    pose: RingPose,
    sonar: SonarModel,
) -> None:
    """Add the evidence of a firing's ranges to `drift_nat` of the landmarks of `exact`, before they are entered.

    Only the ranges count, not which sensor heard a landmark: at the edges of the beams both filters err.

    Parameters
    ----------
    e, exact : (1,) Estimate
        The means with drift, and with exact odometry, of the same landmarks in the same order.
    covariance, exact_covariance : (rows, rows) float
        Of them.
    mounts, ranges, pose, sonar
        As for `perception.localization.drift.landmark_ranges.update_with_firing`.
    """
    px, py, yaw = pose
    var0, rel2, half_angle, range_min, range_max = sonar
    est, fixed = e[0], exact[0]
    c, s = math.cos(yaw), math.sin(yaw)
    c1, s1 = math.cos(est.heading), math.sin(est.heading)
    for k in range(len(ranges)):
        r = ranges[k]
        if not r > range_min or r >= range_max:
            continue
        mx, my, axis = mounts[k, 0], mounts[k, 1], mounts[k, 2]
        x, y = px + c * mx - s * my, py + s * mx + c * my
        if not has_moved_since(est.sensors[k], x, y, yaw + axis):
            continue
        x1, y1 = est.x + c1 * mx - s1 * my, est.y + s1 * mx + c1 * my
        drifting = exactly = OTHER_PER_M
        most, best = 0.0, -1
        for i in range(est.count):
            if may_be_in_beam(e, covariance, i, x1, y1, est.heading + axis, half_angle) or may_be_in_beam(
                exact, exact_covariance, i, x, y, yaw + axis, half_angle
            ):
                one = density_of_range(e, covariance, i, x1, y1, r, var0, rel2)
                other = density_of_range(exact, exact_covariance, i, x, y, r, var0, rel2)
                drifting += one
                exactly += other
                if max(one, other) > most:
                    most, best = max(one, other), i
        if best >= 0 and fixed.landmarks[best].hits >= HITS_MIN:
            landmark = fixed.landmarks[best]
            landmark.drift_nat = max(0.0, landmark.drift_nat + math.log(drifting / exactly))


class DriftEvidence:
    """The filter that takes odometry as exact, and what the readings say against it.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    """

    def __init__(self, ring: RingConfig) -> None:
        self.exact = LandmarkTracker(ring, is_exact=True)
        """The filter; it has the landmarks of the one with drift, in the same order, until odometry is refuted."""
        self.is_refuted = False
        """Whether odometry drifts; remains so."""

    def reset(self) -> None:
        """Start again with the next firing."""
        self.exact.reset()
        self.is_refuted = False

    def enter(self, row: Floats, drifting: LandmarkTracker) -> None:
        """Enter a firing into both filters, and compare what they predict.

        Parameters
        ----------
        row : (POSE + sensors,) float
            As `LandmarkTracker` takes it.
        drifting : LandmarkTracker
            The filter with drift.
        """
        drifting.move(row)
        if self.is_refuted:
            drifting.measure(row)
            return
        exact = self.exact
        exact.move(row)
        compare_firing(drifting.e, drifting.covariance, exact.e, exact.covariance, *drifting.readings(row))
        drifting.measure(row)
        exact.measure(row)
        evidence = sorted(exact.landmarks("drift_nat")[0])
        self.is_refuted = sum(evidence[:-1]) > REFUTED_NAT
