"""Hypotheses of the ring's pose: a Rao-Blackwellised particle filter whose samples are headings.

At a given heading the ranges are nearly linear in the place, while in the heading their likelihood has steps, because
a turn moves echoes into beams and out of them. So each particle is one history of headings, and carries the place and
the scale of the odometer as a Gaussian that is updated in closed form (Doucet, de Freitas, Murphy and Russell,
"Rao-Blackwellised particle filtering for dynamic Bayesian networks", 2000). Particles are grouped into hypotheses:
one for each place at which the robot may be. They are resampled within a hypothesis only, so that chance never
decides between two places that look alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Pose
from perception.kernel import Floats
from perception.localization.mixed_reflection import expect_both, mixed_ratio
from perception.localization.panorama import Panorama
from perception.localization.pose_fit import beams_at
from perception.localization.range_likelihood import RangeModel
from perception.localization.room import Room

HEADINGS: Final = 13
"""Particles of a hypothesis."""
SCALE_SIGMA: Final = 0.03
"""Standard deviation of the odometer's scale at the start."""
PLACE_WALK: Final = 0.02**2
"""Variance of a displacement by odometry on each axis, m²/m."""
SCALE_WALK: Final = 0.002**2
"""Variance by which the scale changes, 1/m."""
HEADING_WALK: Final = math.radians(1.0) ** 2
"""Variance of the heading by odometry, rad²/m."""
TURN_SHARE: Final = 0.03
"""Standard deviation of a turn by odometry as a share of it."""
FIT_STEPS: Final = 2
"""Linear solutions of an update."""
TEMPER: Final = 0.5
"""Weight of a reading's log likelihood: errors of the map are common to readings of one wall."""
RESAMPLE_SHARE: Final = 0.5
"""Particles are resampled where fewer than this share of them carry the weight."""
MERGE_M: Final = 0.3
MERGE_RAD: Final = math.radians(10.0)
"""Hypotheses nearer to each other than this are one."""


@dataclass(frozen=True, slots=True)
class Fit:
    """How hypotheses explain the readings of one update; arrays of shape (h,)."""

    log_ratio: Floats
    """Summed log likelihood ratio to readings from anywhere, nat."""
    specular: Floats
    """Mean probability of a reading to be from the specular model."""


class PoseParticles:
    """Hypotheses with their particles.

    Parameters
    ----------
    starts : (h, 3) float
        Poses of the ring x, y (m), heading (rad).
    place_sigma_m, heading_half_rad : float
        Standard deviation of the places; half the width of the row of headings around each start.

    Attributes
    ----------
    mean : (h, p, 3) float
        x, y (m) and odometer scale of the particles.
    covariance : (h, p, 3, 3) float
    heading : (h, p) float
        rad
    log_weight : (h, p) float
        nat; not normalised.
    """

    def __init__(self, starts: Floats, place_sigma_m: float, heading_half_rad: float) -> None:
        count = len(starts)
        self.mean = np.ones((count, HEADINGS, 3))
        self.mean[:, :, :2] = starts[:, None, :2]
        self.heading = starts[:, 2:] + np.linspace(-heading_half_rad, heading_half_rad, HEADINGS)
        self.covariance = np.zeros((count, HEADINGS, 3, 3))
        self.covariance[:, :] = np.diag([place_sigma_m**2, place_sigma_m**2, SCALE_SIGMA**2])
        self.log_weight = np.full((count, HEADINGS), -math.log(HEADINGS))

    def __len__(self) -> int:
        return len(self.mean)

    def move(self, forward_m: float, left_m: float, turn_rad: float, rng: np.random.Generator) -> None:
        """Follow odometry: a displacement in the ring's frame before it, and a turn of the ring.

        All hypotheses draw the same random numbers, so that chance does not decide between two that are alike.
        """
        way = math.hypot(forward_m, left_m)
        noise = math.sqrt(HEADING_WALK * way + (TURN_SHARE * turn_rad) ** 2)
        wander = noise * rng.standard_normal(HEADINGS)
        along = self.heading + 0.5 * wander
        c, s = np.cos(along), np.sin(along)
        step = np.stack([c * forward_m - s * left_m, s * forward_m + c * left_m], axis=2)
        self.mean[:, :, :2] += self.mean[:, :, 2:] * step
        across = self.covariance[:, :, :2, 2] + 0.0
        cov = self.covariance
        scale = cov[:, :, 2, 2]
        cov[:, :, :2, :2] += (
            step[..., :, None] * across[..., None, :]
            + across[..., :, None] * step[..., None, :]
            + scale[..., None, None] * step[..., :, None] * step[..., None, :]
        )
        cov[:, :, :2, 2] += scale[..., None] * step
        cov[:, :, 2, :2] = cov[:, :, :2, 2]
        cov[:, :, 0, 0] += PLACE_WALK * way
        cov[:, :, 1, 1] += PLACE_WALK * way
        cov[:, :, 2, 2] += SCALE_WALK * way
        self.heading += wander + turn_rad

    def update(
        self,
        which: NDArray[np.int64],
        room: Room,
        readings: Panorama,
        half_angle: float,
        model: RangeModel,
        specular_share: float,
    ) -> Fit:
        """Enter readings: fit the place of each particle to them, and weigh it by how likely they are.

        Parameters
        ----------
        which : (h,) int
            The hypotheses.
        room : Room
            The surfaces near them.
        readings : Panorama
            In the frame of the ring; none is NaN.
        half_angle : float
            Half the beam's opening, rad.
        model : RangeModel
            Errors of a range.
        specular_share : float
            Probability that a reading is from the specular model.
        """
        start, before = self.mean[which].reshape(-1, 3), self.covariance[which].reshape(-1, 3, 3)
        theta, measured = self.heading[which].reshape(-1), readings.range_m
        prior = np.linalg.inv(before)
        mean, covariance = start, before
        for step in range(FIT_STEPS + 1):
            expected = expect_both(room, beams_at(readings, mean[:, 0], mean[:, 1], theta), half_angle)
            place = covariance[:, None, :2, :2]
            extra = [
                place[..., 0, 0] * one.grad_x**2
                + 2.0 * place[..., 0, 1] * one.grad_x * one.grad_y
                + place[..., 1, 1] * one.grad_y**2
                for one in expected
            ]
            variance = (np.zeros(1), np.zeros(1)) if step == FIT_STEPS else (extra[0], extra[1])
            fit = mixed_ratio(model, measured, expected, specular_share, variance)
            if step == FIT_STEPS:
                break
            information, rhs = prior.copy(), np.einsum("pij,pj->pi", prior, start - mean)
            for one, fits in zip(expected, (fit.fits_cone, fit.fits_specular), strict=True):
                weight = fits / model.sigma(one.range_m) ** 2
                with np.errstate(invalid="ignore"):
                    error = np.where(fits > 0.0, measured - one.range_m, 0.0) * weight
                gx, gy = one.grad_x, one.grad_y
                information[:, 0, 0] += (weight * gx * gx).sum(axis=1)
                information[:, 1, 1] += (weight * gy * gy).sum(axis=1)
                cross = (weight * gx * gy).sum(axis=1)
                information[:, 0, 1] += cross
                information[:, 1, 0] += cross
                rhs[:, 0] += (error * gx).sum(axis=1)
                rhs[:, 1] += (error * gy).sum(axis=1)
            covariance = np.linalg.inv(information)
            mean = mean + np.einsum("pij,pj->pi", covariance, rhs)
        off = mean - start
        ratio = fit.log_ratio.sum(axis=1)
        log_evidence = (
            TEMPER * ratio
            - 0.5 * np.einsum("pi,pij,pj->p", off, prior, off)
            + 0.5 * (np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(before)[1])
        )
        shape = (len(which), HEADINGS)
        self.mean[which] = mean.reshape(*shape, 3)
        self.covariance[which] = covariance.reshape(*shape, 3, 3)
        self.log_weight[which] += log_evidence.reshape(shape)
        weight = self._weights()[which]
        specular = fit.prefers_specular.mean(axis=1).reshape(shape)
        return Fit((weight * ratio.reshape(shape)).sum(axis=1), (weight * specular).sum(axis=1))

    def _weights(self) -> Floats:
        """Return the particles' weights within each hypothesis, shape (h, p)."""
        weight = np.exp(self.log_weight - self.log_weight.max(axis=1, keepdims=True))
        return np.asarray(weight / weight.sum(axis=1, keepdims=True))

    def resample(self) -> None:
        """Draw particles anew within each hypothesis whose weight lies on few of them."""
        weight = self._weights()
        few = np.flatnonzero(1.0 / (weight**2).sum(axis=1) < RESAMPLE_SHARE * HEADINGS)
        steps = (np.arange(HEADINGS) + 0.5) / HEADINGS
        for h in few.tolist():
            chosen = np.searchsorted(np.cumsum(weight[h]), steps).clip(max=HEADINGS - 1)
            for part in (self.mean, self.covariance, self.heading):
                part[h] = part[h, chosen]
            self.log_weight[h] = np.logaddexp.reduce(self.log_weight[h]) - math.log(HEADINGS)

    def keep(self, which: NDArray[np.int64]) -> None:
        """Keep these hypotheses only."""
        self.mean, self.covariance = self.mean[which], self.covariance[which]
        self.heading, self.log_weight = self.heading[which], self.log_weight[which]

    def prune(self, least_log: float, most: int) -> None:
        """Drop hypotheses that repeat a better one, or are less likely than the best by more than `least_log` nat."""
        log_evidence, poses = self.log_evidence(), self.poses()
        kept: list[int] = []
        for i in np.argsort(-log_evidence, kind="stable").tolist():
            if log_evidence[i] < log_evidence.max() - least_log or len(kept) == most:
                break
            off = poses[kept] - poses[i]
            turned = np.abs((off[:, 2] + math.pi) % (2.0 * math.pi) - math.pi)
            if ((np.hypot(off[:, 0], off[:, 1]) > MERGE_M) | (turned > MERGE_RAD)).all():
                kept.append(i)
        self.keep(np.array(kept, dtype=np.int64))

    def log_evidence(self) -> Floats:
        """Return the log weight of each hypothesis, nat, shape (h,)."""
        return np.asarray(np.logaddexp.reduce(self.log_weight, axis=1))

    def poses(self) -> Floats:
        """Return the mean pose of each hypothesis: x, y (m), heading (rad), shape (h, 3)."""
        weight = self._weights()
        place = np.einsum("hp,hpi->hi", weight, self.mean[:, :, :2])
        middle = self.heading[:, :1]
        return np.column_stack([place, middle[:, 0] + (weight * (self.heading - middle)).sum(axis=1)])

    def estimate(self, hypothesis: int) -> tuple[Pose, Floats]:
        """Return mean and covariance (x, y, heading) of the ring's pose in one hypothesis."""
        x, y, theta = self.poses()[hypothesis].tolist()
        weight = self._weights()[hypothesis]
        off = np.column_stack([self.mean[hypothesis, :, :2] - (x, y), self.heading[hypothesis] - theta])
        covariance = np.einsum("p,pi,pj->ij", weight, off, off)
        covariance[:2, :2] += np.einsum("p,pij->ij", weight, self.covariance[hypothesis, :, :2, :2])
        return Pose(x, y, theta), np.asarray(covariance)
