"""The decision by how many rays the bodies of a place are heard, on drums that were heard by rays one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.circles import heard_rays
from perception.bayes.inference import beam
from perception.bayes.memory.elements import HISTORY
from perception.bayes.memory.state import ESTABLISHED, RAYS_MAX, Memory
from perception.kernel import Floats
from perception.shared_numbers import FAR
from tests.perception.bayes.inference.test_beam import first_hit, rays_of
from tests.perception.bayes.random_tracks import RADII, SENSORS, P, S, enter_readings, keep

CENTRE, RADIUS = np.array([2.0, 0.3]), float(RADII[0])
READINGS = 80


def heard_by(rays: int, centre: Floats = CENTRE) -> Floats:
    """Return readings of a drum by so many rays, from beams that drive past; 0: by its nearest point."""
    rng = np.random.default_rng(43)
    rows: list[list[float]] = []
    while len(rows) < READINGS:
        place = centre + np.array([rng.uniform(-1.5, 1.5), rng.uniform(-1.3, -0.9)])
        to = centre - place
        axis = math.atan2(to[1], to[0]) + rng.uniform(-1, 1) * S.half_angle_rad
        if rays == 0:
            r = float(np.hypot(*to)) - RADIUS
        else:
            r = first_hit(rays_of(axis, S.half_angle_rad, rays), to, RADIUS)
        r = round(r / 0.03048) * 0.03048 if math.isfinite(r) else 2 * FAR
        rows.append([*place, math.cos(axis), math.sin(axis), r])
    return np.array(rows)


def with_history(rows: Floats) -> Memory:
    """Return a memory whose sensors have heard these readings, and whose hypothesis is near the drum."""
    memory = Memory(SENSORS, 2)
    memory.state["noise_level"] = 0
    sensors = memory.state["sensors"][0]
    for j, row in enumerate(rows):
        sensor = sensors[j // HISTORY]
        sensor["history"][j % HISTORY] = (*row, 0.0, 0.0)
        sensor["kept"] += 1
    hypothesis = memory.s[0].scratch.hypothesis
    hypothesis.x, hypothesis.y = CENTRE[0] + 0.02, CENTRE[1] - 0.02
    return memory


def with_track(memory: Memory, rows: Floats, centre: Floats = CENTRE) -> None:
    """Let the first track be an established drum on these readings."""
    keep(memory, 0, rows)
    track = memory.tracks[0]
    track.status, track.radius = ESTABLISHED, RADIUS
    track.x, track.y = centre.tolist()


def tries(memory: Memory, count: int) -> bool:
    """Return whether the place is heard otherwise after so many hypotheses that failed."""
    return any(heard_rays.try_other_rays(memory.s, memory.tracks, P, 0) for _ in range(count))


ROUND = RAYS_MAX * heard_rays.OTHER_RAYS_EVERY


@pytest.mark.parametrize("rays", [1, 2, 3])
def test_a_drum_that_fails_decides_how_the_place_is_heard(rays: int) -> None:
    memory = with_history(heard_by(rays))
    assert tries(memory, 2 * ROUND)
    with_track(memory, heard_by(rays))
    track = memory.tracks[0]
    for _ in range(2 * RAYS_MAX):
        enter_readings(memory, heard_by(rays))
        beam.assume_rays(memory.s, P, memory.s[0].rays)
        heard_rays.compare_rays(memory.s, P, track, READINGS)
        heard_rays.decide_rays(memory.s, memory.tracks, P)
    assert memory.s[0].rays == rays
    assert memory.s[0].scratch.predicted.rays == rays


def test_a_drum_heard_by_its_nearest_point_changes_nothing() -> None:
    memory = with_history(heard_by(0))
    assert not tries(memory, 2 * ROUND)
    assert memory.s[0].rays == 0
    assert memory.s[0].scratch.predicted.rays == 0


def test_tracks_speak_before_the_place_is_heard_otherwise() -> None:
    """One body that rays explain does not decide where another denies it."""
    elsewhere = CENTRE + np.array([3.0, 0.0])
    memory = with_history(heard_by(1))
    with_track(memory, heard_by(0, elsewhere), elsewhere)
    assert heard_rays.lead_of_track(memory.s, memory.tracks, P, 0, 1) < -heard_rays.RAYS_LEAD_NAT
    assert not tries(memory, 2 * ROUND)
    assert memory.s[0].rays == 0


def test_a_mistake_is_taken_back() -> None:
    memory = with_history(heard_by(0))
    with_track(memory, heard_by(0))
    track = memory.tracks[0]
    heard_rays.change_rays(memory.s, memory.tracks, P, 2)
    assert (memory.s[0].rays, track.refinements) == (2, 0)
    assert track.unseen > 0
    for _ in range(RAYS_MAX):
        enter_readings(memory, heard_by(0))
        beam.assume_rays(memory.s, P, memory.s[0].rays)
        heard_rays.compare_rays(memory.s, P, track, READINGS)
    heard_rays.decide_rays(memory.s, memory.tracks, P)
    assert memory.s[0].rays == 0
    assert not track.rays_leads.any()
