"""Association of readings with polygons, and their division between neighbours that almost touch."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.elements import MAX_POLYGONS
from perception.bayes.memory.scratch import POLYGON, UNEXPLAINED
from perception.bayes.memory.state import ESTABLISHED, TENTATIVE, Memory
from perception.bayes.polygons import association
from perception.bayes.polygons.readings import bears_on_polygon
from perception.kernel import Floats
from perception.shared_numbers import FAR
from tests.perception.bayes.box_readings import BOX, CLOSED, LEVEL, SIDES, P, S, enter_job, heard, random_pose, rules
from tests.perception.bayes.random_tracks import SENSORS, TRACKS, examples, numbers, readings_of

INNER = float(S.polygons[0].inner_radius_m)


def place(memory: Memory, t: int, pose: Floats, status: int = ESTABLISHED) -> None:
    """Put a box that explains all its readings at a pose."""
    track = memory.s[0].polygons[t]
    track.status, track.hits, track.near = status, 20.0, 20.0
    track.x, track.y, track.heading = pose.tolist()


@examples(60, 600)
def test_the_range_error_is_the_lesser_of_both_rules(examples: int) -> None:
    rng, memory, small = np.random.default_rng(31), Memory(SENSORS, TRACKS), 0
    for _ in range(examples):
        pose = random_pose(rng)
        place(memory, 0, pose)
        (q,) = heard(rng, pose, 1, 0.02, int(rng.integers(2)))
        both = rules(complex(q[0], q[1]), complex(q[2], q[3]), pose, BOX, closed=True)
        want = min((abs(q[4] - it.expected) for it in both if it.expected is not None), default=math.inf)
        error = association.range_error(readings_of(q[None])[0], memory.s[0].polygons[0], SIDES, CLOSED, P)
        assert error == pytest.approx(want, abs=1e-9) if want < math.inf else error > FAR
        small += want < 0.1
    assert small > 0.2 * examples


def test_an_established_polygon_takes_the_readings_it_explains_and_keeps_all_that_bear_on_it() -> None:
    rng, memory = np.random.default_rng(32), Memory(SENSORS, TRACKS)
    pose = np.array([0.2, -0.1, 0.3])
    w = heard(rng, pose, 12, 0.0, 1)
    w[0, 4] += 0.1
    w[1, :2] += 20.0
    scratch, bound = memory.state["scratch"], float(S.polygons[0].outer_radius_m)
    for status in (ESTABLISHED, TENTATIVE):
        memory.clear()
        place(memory, 2, pose, status)
        numbers(scratch["fired"][0])[:12, :5] = w
        explained_by = scratch["explained_by"][0, :12]
        explained_by[...] = UNEXPLAINED
        explained_by[2] = 0  # a circle of a model took it
        association.associate_polygons(memory.s, memory.tracks, P, 12)
        track = memory.s[0].polygons[2]
        bears = [bears_on_polygon(q, track.x, track.y, bound, P) for q in readings_of(w)]
        count = sum(bears) - bears[2]
        assert track.unseen == int(memory.polygons["bins"]["count"][2].sum()) == count >= 8
        assert (track.idle_firings, track.final_refinements) == (0, S.final_refinements)
        is_heard = (w[:, 4] < FAR) & ~np.isin(np.arange(12), (0, 1, 2))
        taken = explained_by == POLYGON + 2
        if status == ESTABLISHED:
            assert (taken == is_heard).all()
            assert taken.sum() > 4
        else:
            assert not taken.any()
        assert explained_by[0] == UNEXPLAINED


def test_a_polygon_without_new_readings_becomes_idle() -> None:
    memory = Memory(SENSORS, TRACKS)
    place(memory, 0, np.zeros(3))
    for firings in (1, 2):
        association.associate_polygons(memory.s, memory.tracks, P, 0)
        assert memory.polygons["idle_firings"].tolist() == [firings] + [0] * (MAX_POLYGONS - 1)


@pytest.mark.parametrize(
    ("other", "hidden"),
    [
        ((1.0, 0.0), True),
        ((1.0, INNER * 1.4), True),
        ((1.0, INNER * 1.6), False),
        ((-1.0, 0.0), False),
        ((2.1, 0.0), False),
    ],
)
def test_a_body_hides_another_if_it_stands_before_it_and_near_the_line_of_sight(
    other: tuple[float, float], hidden: bool
) -> None:
    memory = Memory(SENSORS, TRACKS)
    place(memory, 0, np.array([2.0, 0.0, 0.0]))
    place(memory, 1, np.array([*other, 0.0]))
    q = readings_of(np.array([[0.0, 0.0, 1.0, 0.0, 5.0]]))[0]
    track, stands = memory.s[0].polygons[0], memory.s[0].polygons[1]
    assert association.hides(q, track, INNER, stands, INNER) == hidden


def test_the_jobs_readings_are_left_to_a_neighbour_that_explains_them_better_or_hides_the_track() -> None:
    """Two boxes side by side: the track keeps its own echoes, and silence where nothing stands before it."""
    rng, memory = np.random.default_rng(33), Memory(SENSORS, TRACKS)
    s, own, other = memory.s, np.zeros(3), np.array([2.2 * INNER, 0.0, 0.0])
    place(memory, 0, own)
    place(memory, 1, other)
    s[0].noise_level = LEVEL
    mine, theirs = (w[w[:, 4] < FAR] for w in (heard(rng, own, 150, 0.0), heard(rng, other, 150, 0.0)))
    mine, theirs = mine[mine[:, 0] < 0.0], theirs[theirs[:, 0] > other[0]]
    assert min(len(mine), len(theirs)) > 2
    open_view, hidden = (-2.0, 0.0, 1.0, 0.0, 2 * FAR), (4.0, 0.0, -1.0, 0.0, 2 * FAR)
    job = s[0].job
    for u in (0, 1, 2):
        enter_job(memory, np.array([*mine, *theirs, open_view, hidden]), LEVEL)
        job.next_step = u
        association.leave_to_next_neighbour(s, P, 0)
        assert job.next_step == u + 1
        rows = numbers(memory.state["job_readings"][0])[: job.reading_count, :5].tolist()
        if u == 1:
            assert rows == [*mine.tolist(), list(open_view)]
        else:
            assert rows == [*mine.tolist(), *theirs.tolist(), list(open_view), list(hidden)], "no neighbour"
    place(memory, 1, np.array([9.0, 0.0, 0.0]))
    enter_job(memory, theirs, LEVEL)
    job.next_step = 1
    assert association.leave_to_next_neighbour(s, P, 0) == 1, "too far away to be compared"
    assert job.reading_count == len(theirs)
