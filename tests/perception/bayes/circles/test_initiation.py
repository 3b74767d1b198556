"""Circle hypotheses: what is known already, and a drum started from its segments."""

from __future__ import annotations

import math

import numpy as np

from perception.bayes.circles import initiation as track_initiation
from perception.bayes.inference.outline_map import add_to_map
from perception.bayes.memory.elements import HISTORY
from perception.bayes.memory.parameters import OUTLINE_CELL_M
from perception.bayes.memory.state import FREE, TENTATIVE, CircleTrack, Memory
from perception.records import records, zeros
from perception.shared_numbers import FAR
from tests.perception.bayes.random_tracks import (
    RADII,
    SENSORS,
    TRACKS,
    P,
    S,
    examples,
    history,
    new_memory,
    pair,
    places,
    random_track,
    unit,
)


def test_a_reset_track_keeps_only_its_number_its_marks_and_readings_beyond_the_counts() -> None:
    array = zeros(CircleTrack, 2)
    array.view(np.int64)[...] = np.arange(1, 1 + array.nbytes // 8)
    before = array.copy()
    track_initiation.reset_circle(records(CircleTrack, array)[0])
    kept = {"number", "marks", "bins"}
    assert not any(array[0][name].any() for name in CircleTrack.DTYPE.names or () if name not in kept)
    assert all(array[0][name] == before[0][name] for name in ("number", "marks"))
    assert not array[0]["bins"]["count"].any()
    assert array[1] == before[1]


@examples(300, 3000)
def test_a_segment_of_a_known_body_is_known(examples: int) -> None:
    rng, memory, known = np.random.default_rng(13), new_memory(), 0
    circles = memory.circles
    for _ in range(examples):
        for k in range(TRACKS):
            random_track(rng, memory, k)
        normal, rho, surface = unit(rng.uniform(0, 7)), float(rng.choice(RADII)), rng.uniform(-1, 1, 2)
        live = circles["status"] != FREE
        place = surface + rho * normal
        behind = surface + circles["radius"][:, None] * normal
        want = (live & (np.hypot(*(behind - places(memory)).T) < S.merge_m)).any()
        assert track_initiation.is_known(memory.tracks, P, *pair(place), rho, *pair(normal)) == want
        here = (live & (np.hypot(*(place - places(memory)).T) < S.merge_m)).any()
        assert track_initiation.is_known(memory.tracks, P, *pair(place), -1.0, *pair(normal)) == here
        known += int(want)
    assert 0.1 * examples < known < 0.9 * examples


def hear_drum(memory: Memory, x: float, y: float, radius: float) -> None:
    """Fill the sensors' histories with exact ranges to a circle, from a half circle of places 1 m around it."""
    k = 0
    for i in range(SENSORS):
        memory.s[0].sensors[i].kept = count = 6 if i < 12 else 0
        rows = history(memory, i)
        for j in range(count):
            towards = unit(-math.pi + math.pi * k / 72)
            rows[j] = (x - (1.0 + radius) * towards[0], y - (1.0 + radius) * towards[1], *towards, 1.0)
            k += 1


def map_drum(memory: Memory, x: float, y: float, radius: float) -> None:
    """Put segments of the same half circle into the map."""
    for number, angle in enumerate(np.linspace(-math.pi, 0.0, 7)[1:-1].tolist(), start=1):
        nx, ny = unit(angle).tolist()
        add_to_map(memory.s[0].buckets, OUTLINE_CELL_M, x - radius * nx, y - radius * ny, nx, ny, number, 0.0)


def initiate(memory: Memory, off: float = 0.0) -> int:
    """Try a drum behind a segment of the drum at (0.4, 0.7), laid `off` metres beside its place."""
    nx, ny = unit(-0.5 * math.pi).tolist()
    x, y = 0.4 + off, 0.7 - RADII[0] * ny
    return track_initiation.initiate_circle(memory.s, memory.tracks, P, 0, x, float(y), nx, ny)


def test_a_drum_is_started_where_its_segments_and_ranges_are() -> None:
    memory = new_memory()
    hear_drum(memory, 0.4, 0.7, RADII[0])
    map_drum(memory, 0.4, 0.7, RADII[0])
    assert initiate(memory, off=0.05) == 1
    track = memory.tracks[0]
    assert (track.status, track.kind, track.number) == (TENTATIVE, 0, 1)
    assert math.dist((track.x, track.y), (0.4, 0.7)) < 0.01
    assert track.unseen == 72
    assert track.log_likelihood_ratio > 100.0
    assert 0.0 < track.root_xx < 0.05
    assert initiate(memory) == 0, "the drum is known"
    assert np.count_nonzero(memory.circles["status"]) == 1


def test_nothing_is_started_without_echoes_or_on_a_rejected_place() -> None:
    memory = new_memory()
    assert initiate(memory) == 0, "without readings"
    hear_drum(memory, 0.4, 0.7, RADII[0])
    memory.state["rejections"][0, 0] = (0.4, 0.7, 0.3, 0, 1e9)
    memory.state["rejection_count"] = 1
    assert initiate(memory) == 1, "tried, and rejected"
    for i in range(SENSORS):
        history(memory, i)[:HISTORY, 4] = 2 * FAR
    assert initiate(memory) == 1, "tried, and nothing heard"
    assert not memory.circles["status"].any()


def test_a_wall_starts_no_drum() -> None:
    """Exact ranges to the line y = 1, heard at right angles from places 5 cm apart, 2 m away."""
    memory = new_memory()
    for i in range(10):
        memory.s[0].sensors[i].kept = 4
        history(memory, i)[:4] = [(0.05 * (4 * i + j) - 0.6, -1.0, 0.0, 1.0, 2.0) for j in range(4)]
    track_initiation.initiate_circle(memory.s, memory.tracks, P, 0, 0.4, 1.0, 0.0, 1.0)
    assert not memory.circles["status"].any()


def test_relaxation_moves_a_hypothesis_onto_the_map_and_leaves_it_without_segments() -> None:
    memory = new_memory()
    at = memory.s[0].scratch.hypothesis
    for moves in (False, True):
        if moves:
            map_drum(memory, 0.4, 0.7, RADII[0])
        at.x, at.y, at.heading = 0.46, 0.65, 0.0
        before = math.dist((at.x, at.y), (0.4, 0.7))
        track_initiation.relax_onto_map(memory.s, P, 0)
        assert (math.dist((at.x, at.y), (0.4, 0.7)) < 0.7 * before) == moves
