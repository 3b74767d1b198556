"""Searches for a polygon's pose: which search a refinement begins, and the other maxima that it tries."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.inference.kernel_settings import make_settings
from perception.bayes.memory.job_records import JUDGE, RESTART, SEARCH_NEAR, SEARCH_WIDE
from perception.bayes.memory.polygon_parameters import NARROW_ROUNDS, NARROW_STEP_M, WIDE_ROUNDS, WIDE_STEP_M
from perception.bayes.memory.state import Memory
from perception.bayes.polygons import pose_restarts as restarts
from tests.perception.bayes.box_readings import LEVEL, SETTINGS, P, S, enter_job
from tests.perception.bayes.polygons.test_initiation import CHAIN
from tests.perception.bayes.random_tracks import SENSORS, TRACKS, pair, unit

INNER = float(S.polygons[0].inner_radius_m)
OPEN = make_settings(SETTINGS.ring, [CHAIN], SETTINGS.perception.bayes)


@pytest.mark.parametrize(
    ("refinements", "hits", "variance", "has_challenger", "stage"),
    [
        (1, 20.0, 1e-4, 0, SEARCH_WIDE),
        (3, 20.0, 1e-4, 0, SEARCH_WIDE),
        (8, 20.0, 1e-4, 0, SEARCH_WIDE),
        (5, 20.0, 1e-4, 1, SEARCH_WIDE),
        (6, 16.0, 1e-4, 0, SEARCH_WIDE),
        (5, 16.0, 1e-4, 0, SEARCH_NEAR),
        (5, 20.0, 1e-4, 0, JUDGE),
        (5, 20.0, 0.0, 0, SEARCH_NEAR),
        (12, 20.0, 1e-4, 0, SEARCH_NEAR),
    ],
)
def test_the_search_is_wide_for_young_doubtful_or_challenged_tracks_else_near_or_none(
    refinements: int, hits: float, variance: float, has_challenger: int, stage: int
) -> None:
    memory = Memory(SENSORS, TRACKS)
    track, job = memory.s[0].polygons[0], memory.s[0].job
    track.refinements, track.hits, track.near, track.has_challenger = refinements, hits, 20.0, has_challenger
    track.covariance.xx, track.x, track.y, track.heading = variance, 0.1, 0.2, 0.3
    restarts.begin_pose_search(memory.s, 0)
    assert job.stage == stage
    assert (job.best.x, job.best.y, job.best.heading) == (0.1, 0.2, 0.3)
    if stage != JUDGE:
        wide = (WIDE_STEP_M, WIDE_ROUNDS)
        near = (NARROW_STEP_M, NARROW_ROUNDS)
        assert (job.search.step_m, job.search.rounds_left) == (wide if stage == SEARCH_WIDE else near)


@pytest.mark.parametrize("angle_deg", [5.0, 85.0, 100.0, 170.0, -95.0, -60.0])
def test_the_side_that_faces_the_readings_is_the_one_they_are_most_squarely_before(angle_deg: float) -> None:
    memory, place = Memory(SENSORS, TRACKS), unit(math.radians(angle_deg))
    job = memory.s[0].job
    job.middle.x, job.middle.y, job.middle.heading = 0.5, -0.3, 0.4
    turned = 2.0 * unit(math.radians(angle_deg) + 0.4)
    enter_job(memory, np.array([[0.5 + turned[0], -0.3 + turned[1], 1.0, 0.0, 1.0]]), LEVEL)
    sides = S.polygons[0].sides[:4]
    side, face = restarts.facing_side(memory.s, sides, is_closed=True)
    squareness = []
    for it in sides:
        to = 2.0 * place - [it.x + 0.5 * it.length * it.tangent_x, it.y + 0.5 * it.length * it.tangent_y]
        squareness.append((to[0] * it.tangent_y - to[1] * it.tangent_x) / math.hypot(*pair(to)))
    assert (side, face) == (int(np.argmax(squareness)), 1.0)


def test_an_open_outline_is_faced_on_its_inner_side_too() -> None:
    memory = Memory(SENSORS, TRACKS)
    sides = OPEN[0].polygons[0].sides[:2]
    for place, wanted in (
        ((2.0, -1.0), (0, 1.0)),
        ((2.0, 1.0), (1, 1.0)),
        ((-2.0, 1.6), (0, -1.0)),
        ((-2.0, -1.6), (1, -1.0)),
    ):
        enter_job(memory, np.array([[*place, 1.0, 0.0, 1.0]]), LEVEL)
        assert restarts.facing_side(memory.s, sides, is_closed=False) == wanted


def test_a_rolled_box_has_another_side_where_the_facing_side_was() -> None:
    """The box is symmetric to quarter turns, so it has no other side; the open chain has three other ways to lie."""
    memory = Memory(SENSORS, TRACKS)
    job, at = memory.s[0].job, memory.s[0].scratch.hypothesis
    enter_job(memory, np.array([[2.0, -1.0, 1.0, 0.0, 1.0]]), LEVEL)
    assert restarts.roll(memory.s, P, 0, 1) == (S.polygons[0].symmetry < 4)
    job.middle.x, job.middle.y, job.middle.heading = 0.2, 0.1, 0.0
    sides = OPEN[0].polygons[0].sides[:2]
    middles = [complex(it.x, it.y) + 0.5 * it.length * complex(it.tangent_x, it.tangent_y) for it in sides]
    face = complex(0.2, 0.1) + middles[0]
    found = set()
    for k in (1, 2, 3):
        assert restarts.roll(memory.s, OPEN, 0, k)
        turn = complex(math.cos(at.heading), math.sin(at.heading))
        laid = [abs(complex(at.x, at.y) + middle * turn - face) < 1e-9 for middle in middles]
        assert sum(laid) == 1
        found.add((laid.index(True), round(math.degrees(math.remainder(at.heading, 2.0 * math.pi)))))
    assert len(found) == 3
    assert (0, 0) not in found
    assert not restarts.roll(memory.s, OPEN, 0, 4)


def test_restarts_are_shifts_turns_rolls_and_the_challenger_and_then_a_search_near_the_best() -> None:
    memory = Memory(SENSORS, TRACKS)
    s, job, track = memory.s, memory.s[0].job, memory.s[0].polygons[0]
    enter_job(memory, np.array([[2.0, 0.0, -1.0, 0.0, 1.0]]), LEVEL)
    job.middle.x, job.middle.y, job.middle.heading, job.stage = 1.0, 2.0, 0.5 * math.pi, RESTART
    track.has_challenger, track.challenger.x, track.challenger.y, track.challenger.heading = 1, 7.0, 8.0, 0.9
    poses = []
    while job.stage == RESTART:
        restarts.next_restart(s, P, 0)
        poses.append((float(job.search.x), float(job.search.y), float(job.search.heading)))
    half_turn = 0.5 * math.pi / int(S.polygons[0].symmetry)
    near, far = 0.5 * INNER, 1.0 * INNER
    heading = 0.5 * math.pi
    expected = [
        *((1.0, 2.0 + along, heading) for along in (near, -near)),
        *((1.0 - across, 2.0, heading) for across in (near, -near)),
        *((1.0, 2.0 + along, heading) for along in (far, -far)),
        *((1.0 - across, 2.0, heading) for across in (far, -far)),
        (1.0, 2.0, heading - half_turn),
        (1.0, 2.0, heading + half_turn),
    ]
    assert np.array(poses[: len(expected)]) == pytest.approx(np.array(expected), abs=1e-12)
    assert poses[-2] == (7.0, 8.0, 0.9)
    assert (job.stage, track.has_challenger) == (SEARCH_NEAR, 0)
