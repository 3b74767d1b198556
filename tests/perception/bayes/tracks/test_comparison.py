"""Comparison of a track with the same body heard by rays, and the track's change to what leads."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.inference import beam
from perception.bayes.inference.range_fit import FAR
from perception.bayes.memory.state import RAYS_MAX, TENTATIVE, Memory
from perception.bayes.tracks.comparison import compare_alternatives, compare_rays, explain
from perception.bayes.tracks.refine import update_score
from tests.perception.bayes.inference.test_beam import first_hit, rays_of
from tests.perception.bayes.random_tracks import RADII, SENSORS, P, S, enter_readings

CENTRE, RADIUS = np.array([2.0, 0.3]), float(RADII[0])


def heard_by(rays: int, n: int = 60) -> np.ndarray:
    """Return readings of a drum by so many rays, from beams that drive past; 0: by its nearest point."""
    rng = np.random.default_rng(43)
    rows: list[list[float]] = []
    while len(rows) < n:
        place = np.array([rng.uniform(0.5, 3.5), rng.uniform(-1.0, -0.6)])
        to = CENTRE - place
        bearing = math.atan2(to[1], to[0])
        axis = bearing + rng.uniform(-1, 1) * S.half_angle_rad
        if rays == 0:
            r = float(np.hypot(*to)) - RADIUS
        else:
            r = first_hit(rays_of(axis, S.half_angle_rad, rays), to, RADIUS)
        r = round(r / 0.03048) * 0.03048 if math.isfinite(r) else 2 * FAR
        rows.append([*place, math.cos(axis), math.sin(axis), r])
    return np.array(rows)


def on_readings(rows: np.ndarray, rays: int, kind: int = 0) -> Memory:
    """Return a memory with one track near the drum, scored on the readings."""
    memory = Memory(SENSORS, 1)
    memory.state["noise_level"] = 0
    enter_readings(memory, rows)
    track = memory.tracks[0]
    track.status, track.kind, track.radius, track.rays = TENTATIVE, kind, float(RADII[kind]), rays
    track.x, track.y = CENTRE[0] + 0.02, CENTRE[1] - 0.02
    beam.assume_rays(memory.s, P, rays)
    update_score(memory.s, P, track, len(rows))
    return memory


@pytest.mark.parametrize("rays", [1, 2, 3, 5])
def test_a_drum_heard_by_rays_becomes_one_within_a_turn(rays: int) -> None:
    rows = heard_by(rays)
    memory = on_readings(rows, 0)
    track = memory.tracks[0]
    before = track.log_likelihood_ratio
    for _ in range(RAYS_MAX):
        compare_rays(memory.s, P, track, len(rows), S.model_prior_nat)
    assert track.rays == rays
    assert track.log_likelihood_ratio > before + 20.0
    assert math.hypot(track.x - CENTRE[0], track.y - CENTRE[1]) < 0.01
    assert memory.s[0].scratch.predicted.rays == rays


@pytest.mark.parametrize("rays", [0, 1, 3])
def test_a_drum_stays_as_it_is_heard(rays: int) -> None:
    rows = heard_by(rays)
    memory = on_readings(rows, rays)
    track = memory.tracks[0]
    track.x, track.y = CENTRE.tolist()
    update_score(memory.s, P, track, len(rows))
    for _ in range(RAYS_MAX):
        compare_rays(memory.s, P, track, len(rows), S.model_prior_nat)
    assert track.rays == rays


def test_alternatives_are_heard_as_the_track_and_as_most_objects() -> None:
    """A post heard by its nearest point is a drum heard by rays, once most objects are heard so."""
    rows = heard_by(1)
    memory = on_readings(rows, 0, kind=2)
    s, track = memory.s, memory.tracks[0]
    s[0].rays = 1
    s[0].ray_counts[:] = 0.01
    s[0].ray_counts[1] = 5.0
    update_score(s, P, track, len(rows))
    for _ in range(len(RADII) + 2):
        compare_alternatives(s, P, track, len(rows), S.model_prior_nat)
    assert (track.kind, track.rays) == (0, 1)
    as_rays = explain(s, P, track, len(rows), 0, 0.0, 1.0, 1)
    assert as_rays > explain(s, P, track, len(rows), 0, 0.0, 1.0, 0) + 20.0
