"""Hypotheses of the ring's pose that follow keyframes, and how well the best one explains the readings lately."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from drivers.messages import Pose, wrap_angle
from perception.kernel import Floats
from perception.localization.keyframes import KEYFRAMES_MAX, Keyframes
from perception.localization.particle_update import update_particles
from perception.localization.pose_particles import (
    HEADINGS,
    Best,
    Hypotheses,
    ParticleScratch,
    add_hypothesis,
    conclude,
    move,
)
from perception.localization.range_likelihood import RangeModel, log_ratio_of_true_pose
from perception.localization.surroundings import Surroundings
from perception.records import records, zeros

PARTICLES_PER_QUANTUM: Final = 7
QUANTA: Final = math.ceil(HEADINGS / PARTICLES_PER_QUANTUM)
"""Of one hypothesis and one keyframe."""
KEPT_MAX: Final = 40
LEAST_LOG: Final = 12.0
"""Hypotheses less likely than the best by more than this are dropped, nat, and those beyond so many."""
RECENT_M: Final = 3.0
RECENT_MIN: Final = 3
RECENT_MAX: Final = 64
"""Way over which the fit is kept, with at least and at most so many keyframes."""
RECENT_READINGS: Final = 20
"""It is judged by at least so many readings."""
EXCESS_MAX: Final = 50.0
"""Greatest log odds that a place explains the readings, nat."""
NOISES: Final = 512
WAY, LOG_RATIO, OF_TRUE_POSE, READINGS = range(4)
"""Columns of the recent fit: way until the keyframe (m), log ratios (nat), number of readings."""


def heading_noise(seed: int) -> Floats:
    """Return numbers from the standard normal distribution for the walk of the headings, shape (NOISES, HEADINGS)."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal((NOISES, HEADINGS))


class PoseTrack:
    """The hypotheses and their progress through the keyframes.

    Parameters
    ----------
    surroundings : Surroundings
        Of the room.
    model : RangeModel
        Errors of a range.
    noise : (NOISES, HEADINGS) float
        From `heading_noise`.

    Attributes
    ----------
    entered : int
        Number of the next keyframe to enter.
    """

    SCRATCH: Final = ("_model", "_noise", "_hypotheses", "_scratch")
    """What is given, a view of other memory, and what is overwritten before each use."""

    def __init__(self, surroundings: Surroundings, model: RangeModel, noise: Floats) -> None:
        self._surroundings, self._model, self._noise = surroundings, model, noise
        self._memory = zeros(Hypotheses, 1)
        self._hypotheses = records(Hypotheses, self._memory)
        self._scratch = records(ParticleScratch, zeros(ParticleScratch, 1))
        self.entered = 0
        self._step = 0
        """Quanta done for that keyframe."""
        self._at = np.zeros(3)
        """Odometry at the last keyframe that was entered."""
        self._recent = np.zeros((RECENT_MAX, 4))
        self._recent_count = 0

    def clear(self) -> None:
        """Forget all hypotheses."""
        self._memory.view(np.uint8)[...] = 0
        self._step = self._recent_count = 0

    def start(
        self, poses: Floats, place_sigma_m: float, heading_half_rad: float, odometry: Pose, entered: int
    ) -> None:
        """Start anew with hypotheses of the pose.

        Parameters
        ----------
        poses : (n, 3) float
            x, y (m), heading (rad).
        place_sigma_m, heading_half_rad : float
            Standard deviation of the places; half the width of the row of headings around each.
        odometry : Pose
            The ring's pose by odometry there.
        entered : int
            Number of the next keyframe to enter.
        """
        self.clear()
        for x, y, heading in poses.tolist():
            add_hypothesis(self._hypotheses, x, y, heading, place_sigma_m, heading_half_rad)
        self.entered = entered
        self._at[:] = odometry.x, odometry.y, odometry.theta

    def conclude(self) -> None:
        """Write the most likely hypothesis to `best`, before the first keyframe."""
        conclude(self._hypotheses, LEAST_LOG, KEPT_MAX, self._scratch)

    def __len__(self) -> int:
        return int(self._hypotheses[0].count)

    def is_behind(self, keyframes: Keyframes) -> bool:
        """Return whether there are keyframes to enter."""
        return self.entered < keyframes.count and len(self) > 0

    @property
    def best(self) -> Best:
        """The most likely hypothesis."""
        return self._hypotheses[0].best

    @property
    def readings(self) -> int:
        """Readings of the recent keyframes."""
        return int(self._recent[: self._recent_count, READINGS].sum())

    def enter(self, keyframes: Keyframes, specular_share: float) -> int:
        """Do a quantum of entering the next keyframe; return its readings if it is done, otherwise 0.

        Parameters
        ----------
        keyframes : Keyframes
            All.
        specular_share : float
            Probability that a reading is from the specular model.
        """
        if self._step == 0:
            self.entered = max(self.entered, keyframes.count - KEYFRAMES_MAX)
            self._follow(keyframes)
        row = self.entered % KEYFRAMES_MAX
        count = int(keyframes.counts[row])
        if count:
            h, part = divmod(self._step, QUANTA)
            begin = part * PARTICLES_PER_QUANTUM
            update_particles(
                self._surroundings, self._hypotheses, h, begin, min(HEADINGS, begin + PARTICLES_PER_QUANTUM),
                keyframes.readings[row], count, specular_share,
            )  # fmt: skip
            self._step += 1
            if self._step < QUANTA * len(self):
                return 0
            conclude(self._hypotheses, LEAST_LOG, KEPT_MAX, self._scratch)
            self._remember(keyframes.way_of(self.entered), keyframes.readings[row, :count, -1])
        self._step = 0
        self.entered += 1
        return count

    @property
    def way_m(self) -> float:
        """Way of the recent keyframes, m."""
        return float(self._recent[: self._recent_count, WAY].sum())

    def explains(self, way_m: float, least_share: float) -> float:
        """Return the probability that the best place explains the readings of the last way as a true one would.

        Parameters
        ----------
        way_m : float
            The way, m.
        least_share : float
            Share of a true pose's log likelihood ratio that the readings must have.
        """
        excess, way, readings = 0.0, 0.0, 0.0
        for step, log_ratio, of_true_pose, count in reversed(self._recent[: self._recent_count].tolist()):
            excess += log_ratio - least_share * of_true_pose
            way += step
            readings += count
            if way >= way_m and readings >= RECENT_READINGS:
                break
        return 1.0 / (1.0 + math.exp(-max(-EXCESS_MAX, min(EXCESS_MAX, excess)))) if readings else 0.0

    def pose(self, odometry: Pose) -> Pose:
        """Return the pose of the ring where odometry has it here; there must be a hypothesis."""
        best = self.best
        x, y, yaw = self._at.tolist()
        here = Pose(float(best.x), float(best.y), float(best.heading))  # numpy's numbers are no JSON
        return here.compose(Pose(x, y, yaw).inverse().compose(odometry))

    def covariance(self) -> Floats:
        """Return the covariance of x, y (m) and heading (rad) at the last keyframe, shape (3, 3)."""
        best = self.best
        return np.array([
            [best.xx, best.xy, best.xh], [best.xy, best.yy, best.yh], [best.xh, best.yh, best.hh],
        ])  # fmt: skip

    def _follow(self, keyframes: Keyframes) -> None:
        """Move the hypotheses by odometry to the next keyframe."""
        there = keyframes.pose(self.entered)
        x, y, yaw = self._at.tolist()
        step = Pose(x, y, yaw).inverse().compose(there)
        noise = self._noise[self.entered % NOISES]
        move(self._hypotheses, step.x, step.y, wrap_angle(step.theta), noise)
        self._at[:] = there.x, there.y, there.theta

    def _remember(self, way: float, ranges_m: Floats) -> None:
        """Add a keyframe to the recent fit, and drop those that are too long ago."""
        of_true_pose, _ = log_ratio_of_true_pose(self._model, ranges_m)
        rows, count = self._recent, self._recent_count
        driven = float(rows[:count, WAY].sum()) + way
        first = 1 if count == RECENT_MAX else 0
        while first < count + 1 - RECENT_MIN and driven - float(rows[:first, WAY].sum()) > RECENT_M:
            first += 1
        rows[: count - first] = rows[first:count].copy()
        rows[count - first] = way, self.best.log_ratio, of_true_pose, len(ranges_m)
        self._recent_count = count - first + 1
