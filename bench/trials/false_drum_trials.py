"""False drums: what is reported as a model in rooms without one, driven round for a long time.

A look is the report after one firing. It is false if it holds a model with a probability of at least `SURE`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from bench.trials.furnished_rooms import FurnishedRoom, drive
from config.settings import Settings
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, sensors
from drivers.messages import Firing, Pose
from perception.detected_object import DetectedObject
from perception.pipeline import Perception
from runtime.simulation.open_loop import perceive

SURE: Final = 0.95
"""Least probability of a false model that counts."""
SPEED_M_S: Final = 0.3
"""Speed of the robot; its odometry has no errors."""


@dataclass(slots=True)
class FalseDrum:
    """One object that was reported as a model."""

    x: float
    y: float
    """Where it was reported last, m."""
    first_s: float
    last_s: float
    """Times of its first and last false look."""
    looks: int = 0


@dataclass(slots=True)
class FalseDrumTrial:
    """Looks of one drive, and the false drums in them."""

    looks: int = 0
    false_looks: int = 0
    duration_s: float = 0.0
    drums: dict[int, FalseDrum] = field(default_factory=dict)
    """The false drums by the number that users see."""

    def add(self, time_s: float, seen: Iterable[DetectedObject], models: frozenset[str]) -> None:
        """Count one look.

        Parameters
        ----------
        time_s : float
            Its time.
        seen : iterable of DetectedObject
            The report.
        models : frozenset of str
            Names of the models.
        """
        false = [it for it in seen if it.model in models and it.score >= SURE]
        self.looks += 1
        self.false_looks += len(false) > 0
        self.duration_s = time_s
        for it in false:
            drum = self.drums.setdefault(it.number or 0, FalseDrum(it.x, it.y, time_s, time_s))
            drum.x, drum.y, drum.last_s = it.x, it.y, time_s
            drum.looks += 1


def try_room(settings: Settings, room: FurnishedRoom, seed: int, seconds: float) -> FalseDrumTrial:
    """Drive round a room without drums and return the false ones.

    Parameters
    ----------
    settings : Settings
        Ring, models and perception.
    room : FurnishedRoom
        The room, with its acoustics.
    seed : int
        Of the drive and of the noise.
    seconds : float
        Duration of the drive.
    """
    perception, ring = Perception(settings.ring, settings.models, settings.perception), settings.ring
    sonar = Sonar(ring, compile_scene(room.world), room.world.acoustics, np.random.default_rng([seed, 17]))
    pattern, period_s = firing_pattern(ring), ring.firing.step_period_s
    models = frozenset(model.name for model in settings.models)
    trial = FalseDrumTrial()
    poses = drive(room, seed, SPEED_M_S * period_s, SPEED_M_S * seconds)[: max(1, round(seconds / period_s))]
    for k, (x, y, yaw) in enumerate(poses.tolist()):
        pose = Pose(x, y, yaw)
        ranges = sonar.fire(pose, yaw, sensors(pattern.masks[k % len(pattern.masks)]))
        trial.add(k * period_s, perceive(perception, Firing(k * period_s, pose, yaw, ranges)), models)
    return trial
