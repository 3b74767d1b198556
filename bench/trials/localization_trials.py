"""Global localisation in random rooms, compared with the truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from bench.trials.random_rooms import ACOUSTICS, random_room
from config.robot import RingConfig
from config.units import FOOT_M
from config.world import AcousticsConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Pose, wrap_angle
from perception.localization.drumheller.localize import PoseCandidate, localize
from perception.localization.room.expected_ranges import reflection_of
from perception.localization.room.room import room_of

RIGHT_M: Final = 0.3 * FOOT_M
RIGHT_RAD: Final = math.radians(3.0)
"""A candidate is right within these of the true pose."""
CONFIDENT: Final = 0.9


@dataclass(frozen=True, slots=True)
class Trial:
    """One localisation and its truth.

    Attributes
    ----------
    truth : Pose
        The ring's pose.
    candidates : tuple of PoseCandidate
        The answer.
    """

    truth: Pose
    candidates: tuple[PoseCandidate, ...]

    def is_right(self, candidate: PoseCandidate) -> bool:
        """Return whether a candidate is the true pose."""
        distance, turn = self.errors(candidate)
        return distance <= RIGHT_M and turn <= RIGHT_RAD

    def errors(self, candidate: PoseCandidate) -> tuple[float, float]:
        """Return the distance (m) and the angle (rad) between a candidate and the true pose."""
        pose = candidate.pose
        turn = abs(wrap_angle(pose.theta - self.truth.theta))
        return math.hypot(pose.x - self.truth.x, pose.y - self.truth.y), turn

    @property
    def first_is_right(self) -> bool:
        """Whether the most probable candidate is the true pose."""
        return bool(self.candidates) and self.is_right(self.candidates[0])

    @property
    def wrong_alone(self) -> bool:
        """Whether there is an answer, and no candidate is the true pose."""
        return bool(self.candidates) and not any(map(self.is_right, self.candidates))

    @property
    def confidently_wrong(self) -> bool:
        """Whether the first candidate is wrong, with a probability above `CONFIDENT`."""
        return bool(self.candidates) and not self.first_is_right and self.candidates[0].probability > CONFIDENT


def localize_once(
    ring: RingConfig, seed: int, acoustics: AcousticsConfig = ACOUSTICS, map_seed: int | None = None
) -> Trial:
    """Return what one stand in a random room gives.

    Parameters
    ----------
    ring : RingConfig
        The ring.
    seed : int
        Which room, and which errors of the ranges.
    acoustics : AcousticsConfig
        The model of reflection and the errors.
    map_seed : int, optional
        The room that the map shows, if it is another one: then every answer is wrong.
    """
    world, truth = random_room(seed, acoustics)
    scene = compile_scene(world)
    ranges = Sonar(ring, scene, acoustics, np.random.default_rng(seed)).fire(truth, truth.theta)
    firing = Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, ranges)
    known = world if map_seed is None else random_room(map_seed)[0]
    return Trial(truth, localize([firing], room_of(known), ring, reflection_of(acoustics.model)))


@dataclass(frozen=True, slots=True)
class TrialFigures:
    """Figures of many trials: counts, and errors of the first candidates that are right (m, degrees)."""

    trials: int
    right: int
    offered: int
    wrong_alone: int
    confidently_wrong: int
    lost: int
    median_m: float
    max_m: float
    median_deg: float
    max_deg: float


def figures(trials: Sequence[Trial]) -> TrialFigures:
    """Return the figures of these trials; at least one must be right."""
    errors = np.array([trial.errors(trial.candidates[0]) for trial in trials if trial.first_is_right])
    (median_m, median_rad), (max_m, max_rad) = np.median(errors, axis=0), errors.max(axis=0)
    return TrialFigures(
        trials=len(trials),
        right=len(errors),
        offered=sum(any(map(trial.is_right, trial.candidates)) for trial in trials),
        wrong_alone=sum(trial.wrong_alone for trial in trials),
        confidently_wrong=sum(trial.confidently_wrong for trial in trials),
        lost=sum(not trial.candidates for trial in trials),
        median_m=float(median_m),
        max_m=float(max_m),
        median_deg=math.degrees(median_rad),
        max_deg=math.degrees(max_rad),
    )
