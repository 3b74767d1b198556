"""The particle filter that knows the drums: the emulator's own echoes, and a drive that it follows."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench import drift_bound
from config.load import load_settings
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Pose
from runtime.simulation.drift_trials import LEVELS, drum_hall, firings, oval

SETTINGS = load_settings("hallway")
WORLD = drum_hall(5)
DRUMS = np.array([(drum.x_m, drum.y_m) for drum in WORLD.drum])


@pytest.mark.compiled
def test_the_first_drum_that_answers_is_the_emulators() -> None:
    ring = SETTINGS.ring
    sonar = Sonar(ring, compile_scene(WORLD), WORLD.acoustics, np.random.default_rng(0))
    half_angle, fired = math.radians(ring.beam_half_angle_deg), np.ones(len(ring.mounts), dtype=np.bool_)
    for pose in oval()[::40]:
        echoes = sonar.true_echoes(pose, pose.theta, fired)["distance"]
        for mount, distance in zip(ring.mounts, echoes.tolist(), strict=True):
            at = pose.compose(Pose(*mount))
            found = drift_bound.first_range(at.x, at.y, at.theta, DRUMS, drift_bound.RADIUS_M, half_angle)
            assert found == pytest.approx(distance)


@pytest.mark.soak
@pytest.mark.compiled
def test_it_follows_a_drive_whose_drums_it_knows() -> None:
    path = oval()[:150]
    drive = list(firings(SETTINGS, WORLD, path, LEVELS[2], 5, synchro=False))
    known = drift_bound.Known(DRUMS, 1.0 / WORLD.acoustics.sound_speed_scale, LEVELS[2].scale, (0.0, 0.0, 0.0))
    end = drift_bound.follow(SETTINGS, drive, known, LEVELS[2].heading_rad_per_sqrt_m, np.random.default_rng(1))
    assert math.dist((end.x, end.y), (path[-1].x, path[-1].y)) < 0.01
    assert abs(end.theta - path[-1].theta) < math.radians(2.0)
    seen, true = (drift_bound.seen_from(pose, DRUMS) for pose in (end, path[-1]))
    assert np.linalg.norm(seen - true, axis=1).max() < 0.1
