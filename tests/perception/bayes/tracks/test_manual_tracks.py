"""Tracks that a user places or moves: they settle on the map near the user's pose and take the readings there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.inference.kernel_settings import make_settings
from perception.bayes.memory.job_records import NO_JOB, REFINEMENT
from perception.bayes.memory.parameters import PLACED_STRAY_MAX_M, PLACED_STRAY_MAX_RAD
from perception.bayes.memory.state import CONFIRMED, PLACED, TENTATIVE, Memory
from perception.bayes.tracks import manual_tracks
from tests.perception.bayes.random_tracks import (
    BOXES,
    RADII,
    SENSORS,
    TRACKS,
    P,
    add_segment,
    around,
    examples,
    history,
    new_memory,
)

BOX_P = make_settings(BOXES.ring, BOXES.models, BOXES.perception.bayes)


@examples(60, 300)
def test_relaxation_from_a_users_pose_stays_near_it_whatever_lies_in_the_map(examples: int) -> None:
    rng, memory, strayed = np.random.default_rng(4), Memory(SENSORS, TRACKS), 0
    for _ in range(examples):
        memory.clear()
        for number in range(int(rng.integers(3, 14))):
            normal = rng.uniform(-math.pi, math.pi)
            add_segment(memory, np.array([*rng.uniform(-0.7, 0.7, 2), math.cos(normal), math.sin(normal)]), number)
        at = memory.s[0].scratch.hypothesis
        manual_tracks.settle_circle(memory.s, BOX_P, 0, 0.1, -0.1)
        assert math.hypot(at.x - 0.1, at.y + 0.1) <= PLACED_STRAY_MAX_M
        manual_tracks.settle_polygon(memory.s, BOX_P, 0, 0.1, -0.1, 0.3)
        assert math.hypot(at.x - 0.1, at.y + 0.1) <= PLACED_STRAY_MAX_M
        assert abs(at.heading - 0.3) <= PLACED_STRAY_MAX_RAD
        strayed += (at.x, at.y, at.heading) == (0.1, -0.1, 0.3)
    assert strayed > 0


def test_the_job_on_a_polygon_that_is_moved_ends() -> None:
    memory = Memory(SENSORS, TRACKS)
    s, job = memory.s, memory.s[0].job
    t = manual_tracks.place_polygon(s, BOX_P, 0, 0.5, 0.5, 0.1)
    for other, left in ((t + 1, REFINEMENT), (t, NO_JOB)):
        job.kind, job.track = REFINEMENT, other
        manual_tracks.move_polygon(s, BOX_P, t, 0.6, 0.5, 0.1)
        assert job.kind == left
    track = s[0].polygons[t]
    assert (track.number, track.marks) == (1, PLACED)
    assert (track.x, track.y) == (0.6, 0.5)


@pytest.mark.parametrize("far", [False, True])
def test_a_moved_circle_starts_again_on_its_own_readings_if_near_else_on_the_remembered_ones(far: bool) -> None:
    rng, memory = np.random.default_rng(3), new_memory()
    for i in range(6):
        memory.s[0].sensors[i].kept = 5
        history(memory, i)[:5] = around(rng, 5, np.array([2.0, 0.0]), RADII[0])
    t = manual_tracks.place_circle(memory.s, memory.tracks, P, 0, 2.0, 0.0)
    track = memory.tracks[t]
    first = int(track.unseen)
    assert 0 < first <= 30
    assert (track.status, track.number, track.marks) == (TENTATIVE, 1, PLACED)
    assert (track.x, track.y, track.radius) == (2.0, 0.0, RADII[0])
    track.marks = CONFIRMED
    for i in range(6):
        memory.s[0].sensors[i].kept = 0
    x = 2.05 + 5.0 * far
    manual_tracks.move_circle(memory.s, memory.tracks, P, t, x, 0.1)
    assert (track.unseen == 0) == far
    assert (track.x, track.y) == (x, 0.1)
    assert (track.number, track.marks, track.refinements) == (1, CONFIRMED | PLACED, 0)


@pytest.mark.parametrize("far", [False, True])
def test_a_moved_polygon_starts_again_on_its_own_readings_if_near_else_on_the_remembered_ones(far: bool) -> None:
    rng, memory = np.random.default_rng(3), new_memory()
    memory.s[0].sensors[0].kept = 20
    history(memory, 0)[:20] = around(rng, 20, np.array([2.0, 0.0]), 0.3)
    t = manual_tracks.place_polygon(memory.s, BOX_P, 0, 2.0, 0.0, 0.2)
    track = memory.s[0].polygons[t]
    first = int(track.unseen)
    assert first > 0
    memory.s[0].sensors[0].kept = 0
    manual_tracks.move_polygon(memory.s, BOX_P, t, 2.1 + 5.0 * far, 0.0, 0.3)
    assert track.unseen == (0 if far else first)
    assert (track.x, track.y, track.heading) == (2.1 + 5.0 * far, 0.0, 0.3)


def test_without_a_free_track_nothing_is_placed() -> None:
    memory = new_memory()
    memory.circles["status"], memory.circles["marks"] = TENTATIVE, CONFIRMED
    memory.polygons["status"], memory.polygons["marks"] = TENTATIVE, CONFIRMED
    before = memory.circles.tobytes(), memory.polygons.tobytes()
    assert manual_tracks.place_circle(memory.s, memory.tracks, P, 0, 0.0, 0.0) == -1
    assert manual_tracks.place_polygon(memory.s, BOX_P, 0, 0.0, 0.0, 0.0) == -1
    assert (memory.circles.tobytes(), memory.polygons.tobytes()) == before
