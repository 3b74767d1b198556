"""What a firing leaves in the memory against its oracle: readings are placed, remembered, associated and kept."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.elements import BEARING_BINS, BIN_CAPACITY
from perception.bayes.memory.scratch import UNEXPLAINED
from perception.bayes.memory.state import ESTABLISHED, FREE, TENTATIVE
from perception.bayes.tracks import observe
from tests import naive_occlusion, naive_tracks
from tests.naive_tracks import rows
from tests.perception.bayes.random_tracks import (
    NOISES,
    SENSORS,
    TRACKS,
    P,
    S,
    around,
    examples,
    kept_by,
    new_memory,
    numbers,
    place_of,
    random_track,
    sigma,
)


@examples(25, 400)
def test_readings_go_to_the_circle_with_the_least_error_and_every_circle_they_bear_on_keeps_them(
    examples: int,
) -> None:
    rng, memory = np.random.default_rng(10), new_memory()
    circles, scratch = memory.circles, memory.state["scratch"]
    fired, explained_by = numbers(scratch["fired"][0])[:SENSORS, :5], scratch["explained_by"][0, :SENSORS]
    taken = kept = 0
    for _ in range(examples):
        circles.view(np.uint8)[...] = 0
        memory.s[0].noise_level = int(rng.integers(len(NOISES)))
        for t in range(TRACKS):
            random_track(rng, memory, t)
        circles["idle_firings"], circles["unseen"] = 7, 2
        t = int(rng.integers(TRACKS))
        fired[...] = around(rng, SENSORS, place_of(memory, t), float(circles["radius"][t]))
        explained_by[...] = UNEXPLAINED
        observe.associate_circles(memory.s, memory.tracks, P, SENSORS)
        established = [
            (k, place_of(memory, k), float(circles["radius"][k]), float(circles["root_xx"][k]))
            for k in np.flatnonzero(circles["status"] == ESTABLISHED).tolist()
        ]
        owner = [
            naive_tracks.claimed_by(q, established, S.cos_may_answer, S.half_resolution_m, sigma(memory))
            for q in fired
        ]
        assert explained_by.tolist() == owner
        taken += sum(o >= 0 for o in owner)
        observe.keep_readings(memory.s, memory.tracks, P, SENSORS)
        for k in range(TRACKS):
            status, centre, radius = circles["status"][k], place_of(memory, k), float(circles["radius"][k])
            same = {
                o for o in range(TRACKS)
                if not naive_occlusion.is_elsewhere(
                    math.dist(centre, place_of(memory, o)), radius, circles["radius"][o],
                    circles["kind"][o] < S.model_count, S.merge_m, S.gate_m,
                )
            }  # fmt: skip
            want = [
                q for q, o in zip(fired.copy(), explained_by.tolist(), strict=True)
                if status != FREE and naive_tracks.bears_on(
                    q, centre, radius, o == -1, o in (-1, k, *same),
                    S.cos_may_answer, S.cos_must_answer, S.gate_m, S.pair_range_max_m,
                )
            ]  # fmt: skip
            bins, n = naive_tracks.Reservoir(BEARING_BINS, BIN_CAPACITY), len(want)
            for q in want:
                bins.put(centre, q)
            assert rows(kept_by(memory, k)) == rows(q for room in bins.kept for q in room)
            assert circles["unseen"][k] == 2 + n
            assert circles["idle_firings"][k] == (0 if n else 7 + (status != FREE))
            assert circles["final_refinements"][k] == (S.final_refinements if n else 0)
            kept += n
    assert taken > 2 * examples
    assert kept > 7 * examples


@pytest.mark.parametrize(("kind", "status", "y", "range_m", "rays", "entered"), [
    (0, ESTABLISHED, 1e-3, 1.0, 0, 0), (0, TENTATIVE, 1e-3, 1.0, 0, 3), (1, ESTABLISHED, 1e-3, 1.0, 0, 3),
    (0, ESTABLISHED, 1e-3, 3.0, 0, 3), (0, ESTABLISHED, 1e-3, 2.0, 0, 3), (0, ESTABLISHED, 0.24, 1.95, 1, 0),
], ids=["in front", "of a tentative one", "of a rival", "passed", "hit", "of where a ray meets it"])  # fmt: skip
def test_a_reading_that_ends_in_front_of_an_established_model_replaces_none(
    kind: int, status: int, y: float, range_m: float, rays: int, entered: int
) -> None:
    memory = new_memory()
    memory.s[0].rays = rays
    track, counts = memory.tracks[0], memory.circles["bins"]["count"][0]
    track.kind, track.status, track.radius = kind, status, S.circles[kind].radius_m
    track.x = 2.0 + track.radius
    numbers(memory.state["scratch"]["fired"][0])[:1, :5] = (0.0, y, 1.0, 0.0, range_m)
    memory.state["scratch"]["explained_by"][0, 0] = UNEXPLAINED
    for _ in range(BIN_CAPACITY):
        observe.keep_readings(memory.s, memory.tracks, P, 1)
    assert counts.max() == counts.sum() == track.unseen == BIN_CAPACITY  # each takes a free place
    track.idle_firings = 7
    for _ in range(3):
        observe.keep_readings(memory.s, memory.tracks, P, 1)
    assert counts.sum() - BIN_CAPACITY == track.unseen - BIN_CAPACITY == entered
    assert track.idle_firings == (0 if entered else 7 + 3)


def test_the_surest_unexplained_segment_in_reach_is_proposed_first() -> None:
    memory = new_memory()
    scratch = memory.state["scratch"]
    segments, explained_by = scratch["segments"][0], scratch["explained_by"][0]
    segments["reading"][:5] = np.arange(5)
    segments["sigma_direction"][:5] = (0.02, 0.03, 0.001, 0.2, 0.002)
    numbers(scratch["fired"][0])[:5] = (0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0)
    explained_by[:5] = UNEXPLAINED
    explained_by[2] = 4
    scratch["fired"]["range_m"][0, 4] = S.pair_range_max_m + 0.1
    made = memory.s[0].scratch.segments[:5]
    for chosen in (0, 1, -1):
        assert observe.next_segment(made, memory.s, P, in_turn=False) == chosen
        explained_by[chosen] = 7


def test_a_sensor_whose_segment_started_a_hypothesis_waits_for_the_others() -> None:
    memory = new_memory()
    scratch = memory.state["scratch"]
    segments, explained_by = scratch["segments"][0], scratch["explained_by"][0]
    segments["reading"][:3], segments["sigma_direction"][:3] = (0, 1, 2), (0.01, 0.03, 0.02)
    scratch["fired_sensors"][0, :3] = (7, 3, 5)
    numbers(scratch["fired"][0])[:3] = (0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0)
    made, tried = memory.s[0].scratch.segments[:3], []
    for firing in range(1, 7):
        explained_by[:3] = UNEXPLAINED
        memory.state["segments_numbered"] = firing
        chosen = observe.next_segment(made, memory.s, P, in_turn=firing > 1)
        memory.s[0].sensors[scratch["fired_sensors"][0, chosen]].tried = firing
        tried.append(chosen)
    assert tried == [0, 2, 1, 0, 2, 1], "the surest first, then in turn"


def test_a_sensor_is_noted_as_tried_when_its_segment_starts_a_hypothesis() -> None:
    memory = new_memory()
    scratch, tried = memory.state["scratch"], memory.state["sensors"]["tried"][0]
    segments = scratch["segments"][0]
    segments["reading"][:2], segments["sigma_direction"][:2], segments["normal_x"][:2] = (0, 1), (0.01, 0.3), 1.0
    scratch["fired_sensors"][0, :2], scratch["explained_by"][0, :2] = (7, 3), UNEXPLAINED
    numbers(scratch["fired"][0])[:2] = (0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0)
    memory.state["segments_numbered"] = 9
    observe.propose(memory.s, memory.tracks, P, 2)
    assert (tried[7], tried[3]) == (9, 0), "the second one locates no centre"
    memory.clear()
    assert not memory.state["sensors"]["tried"].any()
