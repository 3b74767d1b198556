"""Hypotheses of the ring's pose that follow keyframes, and how well the best one explains the readings lately."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from drivers.messages import Pose, wrap_angle
from perception.bounds import COUNT, FINITE, PLACE, SHARE, bounds, index_of
from perception.kernel import Floats
from perception.localization.known_room.background import Background
from perception.localization.known_room.keyframes import KEYFRAMES_MAX, Keyframes
from perception.localization.known_room.mixed_reflection import LearnedShares
from perception.localization.known_room.particle_update import TEMPER, update_particles
from perception.localization.known_room.pose_particles import (
    HEADINGS,
    HYPOTHESES_MAX,
    SAME_PLACE_M,
    SAME_PLACE_RAD,
    SHARE_TEMPER,
    Best,
    Hypotheses,
    ParticleScratch,
    add_hypothesis,
    conclude,
    move,
)
from perception.localization.known_room.surroundings import Surroundings
from perception.records import records, zeros

PARTICLES_PER_QUANTUM: Final = 7
"""Particles that one quantum moves and weighs."""
QUANTA: Final = math.ceil(HEADINGS / PARTICLES_PER_QUANTUM)
"""Quanta of one hypothesis and one keyframe."""
KEPT_MAX: Final = 40
"""Most hypotheses that are kept."""
LEAST_LOG: Final = 12.0
"""Tracked hypotheses less likely than the best by more than this are dropped, nat."""
SEARCH_LEAST_LOG: Final = 30.0
"""The same while those of a search enter its keyframes, over the first of which a wrong place may fit far better than
the right one."""
EVIDENCE_MIN: Final = 20.0
"""Most evidence against a place that is remembered, nat."""
PLACE_EVIDENCE_MAX: Final = 7.0
"""Most evidence for a place that is remembered, nat: what is heard later must not drown in a long way."""
ALIKE_GAIN: Final = (2.3, 1.4)
"""Gain of evidence per echo, nat, that speaks neither for the right place nor for one in a map of another room that
is alike: where nothing is a mirror, and from a share of mirrors of `MIRRORS` on. At the right place it is 3.1 to 4.3
in furnished rooms, and in real buildings 2.6 to 3.0, or 1.4 to 1.9 where their walls are mirrors. With the map of
another room it is 1.1 at most, but 1.7 in one of twenty rooms where nothing is a mirror."""
MIRRORS: Final = 0.4
"""The share of mirrors from which on `ALIKE_GAIN` has its second value."""
ALIKE_WEIGHT: Final = 0.15
"""Weight of what an echo gains beyond that: such gains scatter by more than the two differ."""
LIKENESS_MAX: Final = 4.5
"""Most likeness that is remembered, nat: a robot that is carried must notice it within a few keyframes."""
INDEPENDENT_M: Final = 0.5
"""Readings on a way as short as this have errors in common, those of the map and of what it lacks."""
RIVAL_SHARE: Final = 0.1
"""A hypothesis that has this share of the best one's probability is a rival: the best is not sure beside it."""
HEADING_NOISES: Final = 512
"""Draws of the headings' noise, which are used in turn."""


def heading_noise(seed: int) -> Floats:
    """Return numbers from the standard normal distribution for the walk of the headings, shape (NOISES, HEADINGS)."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal((HEADING_NOISES, HEADINGS))


class PoseTrack:
    """The hypotheses and their progress through the keyframes.

    Parameters
    ----------
    surroundings : Surroundings
        Of the room.
    background : Background
        How likely the readings are without a place.
    noise : (NOISES, HEADINGS) float
        From `heading_noise`.

    Attributes
    ----------
    entered : int
        Number of the next keyframe to enter.
    evidence : float
        Log odds that the best place is the robot's, compared with no place at all, nat.
    likeness : float
        Log odds that the place is the right one, compared with a place in another room that is alike, nat.
    peak_at : int
        Number of the keyframe at which they were greatest, the latest such one: what speaks against it began there.
    """

    SCRATCH: Final = ("_background", "_noise", "_hypotheses", "_scratch")
    """What is given, a view of other memory, and what is overwritten before each use."""
    BOUNDS: Final = bounds(
        _memory=Hypotheses.BOUNDS,
        entered=COUNT,
        _step=index_of(QUANTA * HYPOTHESES_MAX),
        _at=PLACE,
        evidence=FINITE,
        likeness=FINITE,
        _peak=FINITE,
        peak_at=COUNT,
        _gains=FINITE,
        _weights=SHARE,
    )

    def __init__(self, surroundings: Surroundings, background: Background, noise: Floats) -> None:
        self._surroundings, self._background, self._noise = surroundings, background, noise
        self._memory = zeros(Hypotheses, 1)
        self._hypotheses = records(Hypotheses, self._memory)
        self._scratch = records(ParticleScratch, zeros(ParticleScratch, 1))
        self.entered = 0
        self._step = 0
        """Quanta done for that keyframe."""
        self._at = np.zeros(3)
        """Odometry at the last keyframe that was entered."""
        self.evidence = self.likeness = self._peak = 0.0
        self.peak_at = 0
        self._is_weighed = False
        self._gains = np.zeros(KEYFRAMES_MAX)
        """What each keyframe says for the best place, nat, under its number modulo `KEYFRAMES_MAX`."""
        self._weights = np.zeros(KEYFRAMES_MAX)
        """How much of that is independent of the keyframe before."""

    def clear(self) -> None:
        """Forget all hypotheses."""
        self._memory.view(np.uint8)[...] = 0
        self._step = self.peak_at = 0
        self._is_weighed = False
        self.evidence = self.likeness = self._peak = 0.0

    def start(
        self,
        poses: Floats,
        place_sigma_m: float,
        heading_half_rad: float,
        odometry: Pose,
        entered: int,
        evidence: float,
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
        evidence : float
            Log odds that one of them is the robot's, nat.
        """
        self.clear()
        self.evidence = self._peak = evidence
        self.peak_at = entered
        self._gains[:] = 0.0
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

    def enter(self, keyframes: Keyframes, shares: LearnedShares, least_log: float = LEAST_LOG) -> int:
        """Do a quantum of entering the next keyframe; return its readings if it is done, otherwise 0.

        Parameters
        ----------
        keyframes : Keyframes
            All.
        shares : LearnedShares
            How often a reading has which cause.
        least_log : float
            Hypotheses less likely than the best by more than this are dropped, nat.
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
                self._surroundings,
                self._hypotheses,
                h,
                begin,
                min(HEADINGS, begin + PARTICLES_PER_QUANTUM),
                keyframes.readings[row],
                count,
                shares.records,
            )
            self._step += 1
            if self._step < QUANTA * len(self):
                return 0
            conclude(self._hypotheses, least_log, KEPT_MAX, self._scratch)
            self._weigh(keyframes.way_of(self.entered), keyframes.readings[row, :count, -1], shares)
        self._step = 0
        self.entered += 1
        return count

    @property
    def fits(self) -> float:
        """Probability that the best place is the right one, and not one in another room that is alike."""
        return 1.0 / (1.0 + math.exp(-self.likeness))

    def gained_since(self, number: int) -> float:
        """Return what the keyframes from a number on say for the best place, nat; the first one counts in full."""
        rows = np.arange(number, self.entered) % KEYFRAMES_MAX
        return float(self._gains[rows[:1]].sum() + (self._weights * self._gains)[rows[1:]].sum())

    @property
    def explains(self) -> float:
        """Probability that the best place explains the readings better than none would."""
        return 1.0 / (1.0 + math.exp(-self.evidence))

    @property
    def rivals(self) -> int:
        """Hypotheses elsewhere that are not much less likely than the best one."""
        rows, best = self._memory["hypotheses"][0][: len(self)], self.best
        turns = np.abs((rows["heading"] - best.heading + math.pi) % (2.0 * math.pi) - math.pi)
        away = (np.hypot(rows["x"] - best.x, rows["y"] - best.y) > SAME_PLACE_M) | (turns > SAME_PLACE_RAD)
        odds = SHARE_TEMPER * (rows["log_evidence"] - rows["log_evidence"].max(initial=-math.inf))
        return int((away & (odds > math.log(RIVAL_SHARE))).sum())

    def pose(self, odometry: Pose) -> Pose:
        """Return the pose of the ring where odometry has it here; there must be a hypothesis."""
        best = self.best
        x, y, yaw = self._at.tolist()
        here = Pose(float(best.x), float(best.y), float(best.heading))  # numpy's numbers are no JSON
        return here.compose(Pose(x, y, yaw).inverse().compose(odometry))

    def covariance(self) -> Floats:
        """Return the covariance of x, y (m) and heading (rad) at the last keyframe, shape (3, 3)."""
        best = self.best
        return np.array(
            [
                [best.xx, best.xy, best.xh],
                [best.xy, best.yy, best.yh],
                [best.xh, best.yh, best.hh],
            ]
        )

    def _follow(self, keyframes: Keyframes) -> None:
        """Move the hypotheses by odometry to the next keyframe."""
        there = keyframes.pose(self.entered)
        x, y, yaw = self._at.tolist()
        step = Pose(x, y, yaw).inverse().compose(there)
        noise = self._noise[self.entered % HEADING_NOISES]
        move(self._hypotheses, step.x, step.y, wrap_angle(step.theta), noise)
        self._at[:] = there.x, there.y, there.theta

    def _weigh(self, way_m: float, ranges_m: Floats, shares: LearnedShares) -> None:
        """Add what a keyframe says for or against the best place, compared with no place (Page's cumulative sum)."""
        share = min(1.0, way_m / INDEPENDENT_M) if self._is_weighed else 1.0
        row, heard = self.entered % KEYFRAMES_MAX, float(np.isfinite(ranges_m).sum())
        gain = self.best.log_ratio - self._background.log_ratio(ranges_m, shares)
        line = float(np.interp(shares.records[0].specular, (0.0, MIRRORS), ALIKE_GAIN))
        alike = ALIKE_WEIGHT * (gain - line * heard)
        self.likeness = max(-PLACE_EVIDENCE_MAX, min(LIKENESS_MAX, self.likeness + share * alike))
        self._gains[row], self._weights[row] = TEMPER * gain, share
        self.evidence = max(-EVIDENCE_MIN, min(PLACE_EVIDENCE_MAX, self.evidence + share * TEMPER * gain))
        self._is_weighed = True
        if self.evidence >= self._peak:
            self._peak, self.peak_at = self.evidence, self.entered
