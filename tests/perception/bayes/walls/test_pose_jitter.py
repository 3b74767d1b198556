"""The error that the readings of a firing have in common, against Gaussian densities and in a room of four walls."""

from __future__ import annotations

import itertools
import math
from typing import Final

import numpy as np
import pytest

from config.load import load_settings
from config.world import AcousticsConfig, WallConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Pose
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.memory.scratch import Pull, ShiftInformation
from perception.bayes.memory.state import Memory
from perception.bayes.memory.wall_records import JITTERS, PoseJitter, WallMap
from perception.bayes.walls.pose_jitter import JITTERS_M, mean_shift, place_by_others, sum_pulls, weigh_jitters
from perception.pipeline import Perception
from perception.records import records, zeros
from perception.sensor_mounts import mounts_array, sensor_pose
from tests.naive_walls import Array
from tests.perception.bayes.random_tracks import P, examples
from tests.perception.bayes.rooms import SIGMA, fill, new_room, place_wall

AWAY_M: Final = 2.0
"""Distance of each wall from the ring."""
AXES: Final = np.arange(8) * math.pi / 4.0
LOOKING: Final = AXES[::2]
"""Axes of the sensors, and of those that look at a wall."""


def four_walls() -> tuple[Memory, WallMap]:
    """Return a memory of a square room."""
    memory, room = new_room()
    for k, normal in enumerate(LOOKING.tolist()):
        place_wall(room.walls[k], np.zeros(2), normal, AWAY_M)
        fill(memory, room.walls[k], -AWAY_M, AWAY_M, 40.0)
    return memory, room


def fire(memory: Memory, shift: Array, errors: Array) -> Array:
    """Enter a firing from the middle of the room, truly from `shift`; return where the readings are placed, m."""
    fired = memory.s[0].scratch.fired
    for k, axis in enumerate(LOOKING.tolist()):
        c, s = math.cos(axis), math.sin(axis)
        q = fired[k]
        q.x = q.y = q.listener_x = q.listener_y = 0.0
        q.axis_x, q.axis_y, q.range_m = c, s, AWAY_M - c * shift[0] - s * shift[1] + errors[k]
    place_by_others(memory.s, P, len(LOOKING))
    return np.array([(fired[k].x, fired[k].y) for k in range(len(LOOKING))])


def test_readings_are_moved_to_where_the_ring_was() -> None:
    rng = np.random.default_rng(41)
    memory, room = four_walls()
    before, after = [], []
    for k in range(300):
        shift, errors = rng.normal(0.0, 0.03, 2), rng.normal(0.0, SIGMA, 4)
        placed = fire(memory, shift, errors)
        if k >= 100:
            before.append(shift)
            after.append(placed - shift)
    assert JITTERS_M[room.jitter.level] == 0.03
    assert np.std(before) > 2.5 * np.std(after)


@pytest.mark.parametrize("is_noise", [False, True])
def test_exact_poses_stay_what_they_are_however_large_the_noise(is_noise: bool) -> None:
    rng = np.random.default_rng(42)
    memory, room = four_walls()
    for _ in range(300):
        placed = fire(memory, np.zeros(2), rng.normal(0.0, 0.03 if is_noise else SIGMA, 4))
        assert not placed.any()
    assert room.jitter.level == 0


def test_a_lasting_shift_is_no_jitter() -> None:
    rng = np.random.default_rng(43)
    memory, room = four_walls()
    memory.s[0].room.jitter.x = 0.04
    for _ in range(300):
        placed = fire(memory, np.array([0.04, 0.0]), rng.normal(0.0, SIGMA, 4))
        assert not placed.any()
    assert room.jitter.x == pytest.approx(0.04, abs=0.01)


def test_a_reading_does_not_move_itself() -> None:
    memory, room = four_walls()
    for k in range(len(LOOKING)):
        room.walls[k].weight *= k == 0  # one wall is left
    room.jitter.level = 3
    placed = fire(memory, np.array([0.03, 0.0]), np.zeros(4))
    assert placed[0] == pytest.approx((0.0, 0.0), abs=1e-12)
    assert placed[1:] == pytest.approx(np.tile((0.027, 0.0), (3, 1)), abs=0.001)


def test_an_echo_of_something_before_the_wall_moves_no_reading() -> None:
    memory, room = four_walls()
    room.jitter.level = 3
    placed = fire(memory, np.zeros(2), np.array([-0.08, 0.0, 0.0, 0.0]))
    assert placed == pytest.approx(np.zeros((4, 2)), abs=1e-9)


@examples(30, 300)
def test_mean_and_evidence_equal_those_of_gaussian_densities(examples: int) -> None:
    rng = np.random.default_rng(44)
    for _ in range(examples):
        n = int(rng.integers(2, 9))
        pulls, shift = records(Pull, zeros(Pull, n)), records(ShiftInformation, zeros(ShiftInformation, 1))
        jitter = records(PoseJitter, zeros(PoseJitter, 1))
        gradients, errors, sigmas = rng.normal(0.0, 1.0, (n, 2)), rng.normal(0.0, 0.03, n), rng.uniform(0.01, 0.03, n)
        for k in range(n):
            pulls[k].x, pulls[k].y = gradients[k].tolist()
            pulls[k].error, pulls[k].accuracy = float(errors[k]), float(sigmas[k] ** -2)
        sum_pulls(shift[0], pulls, n)
        weigh_jitters(jitter[0], shift[0], pulls, n)
        for k in range(1, JITTERS):
            v = JITTERS_M[k] ** 2
            noise, common = np.diag(sigmas**2), v * gradients @ gradients.T
            whole = np.linalg.solve(noise + common, errors)
            assert mean_shift(shift[0], v) == pytest.approx(v * gradients.T @ whole)
            none = log_density(errors, noise)
            assert jitter[0].common_nat[k] == pytest.approx(log_density(errors, noise + common) - none)
            alone = noise + np.diag(np.diag(common))
            assert jitter[0].alone_nat[k] == pytest.approx(log_density(errors, alone) - none)


def log_density(errors: Array, covariance: Array) -> float:
    """Return the log density of errors of mean 0, but for a constant."""
    return float(-0.5 * (errors @ np.linalg.solve(covariance, errors) + np.linalg.slogdet(covariance)[1]))


@pytest.mark.compiled
def test_poses_that_jump_are_found_in_a_drive_and_exact_ones_are_not() -> None:
    settings = load_settings("hallway")
    ring, mounts = settings.ring, mounts_array(settings.ring.mounts)
    corners = ((-2.5, -2.0), (2.5, -2.0), (2.5, 2.0), (-2.5, 2.0))
    walls = tuple(
        WallConfig(x1_m=a[0], y1_m=a[1], x2_m=b[0], y2_m=b[1]) for a, b in itertools.pairwise((*corners, corners[0]))
    )
    acoustics = AcousticsConfig(model="cone", noise_relative=0.005)
    for jitter_m in (0.0, 0.03):
        rng = np.random.default_rng(45)
        sonar = Sonar(ring, compile_scene(WorldConfig(wall=walls, acoustics=acoustics)), acoustics, rng)
        perception = Perception(ring, settings.models, settings.perception)
        assert isinstance(perception.method, BayesPerception)
        scratch, off = perception.method.memory.s[0].scratch, []
        for k in range(600):
            yaw = 0.02 * k
            true = Pose(math.cos(yaw), math.sin(yaw), yaw + 0.5 * math.pi)
            dx, dy = rng.normal(0.0, jitter_m, 2).tolist()
            ranges = sonar.fire(true, true.theta, range(k % 3, 24, 3))
            perception.observe(Firing(0.1 * k, Pose(true.x + dx, true.y + dy, true.theta), true.theta, ranges))
            while perception.can_refine:
                perception.refine()
            for i in range(8 if k >= 300 else 0):
                x, y, _ = sensor_pose(mounts, scratch.fired_sensors[i], (true.x, true.y, true.theta))
                off.append((scratch.fired[i].x - x, scratch.fired[i].y - y))
        assert JITTERS_M[perception.method.memory.state["room"]["jitter"]["level"][0]] == jitter_m
        assert np.std(off) <= 0.5 * jitter_m
