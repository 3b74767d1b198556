"""What a firing leaves in the memory, against its oracle on random cases: placed, paired, claimed, kept."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from perception.bayes import noise_estimation, observe, pairing, reservoir
from perception.bayes.elements import BEARING_BINS, BIN_CAPACITY, HISTORY
from perception.bayes.range_fit import FAR
from perception.bayes.scratch import PairSegment
from perception.bayes.segment_pairs import tangent
from perception.bayes.state import ESTABLISHED, FREE, Memory
from perception.kernel import Floats
from perception.records import records, zeros
from tests import naive_tracks
from tests.naive_tracks import rows
from tests.perception.tracks import (
    MOUNTS,
    NOISES,
    RADII,
    SENSORS,
    TRACKS,
    P,
    S,
    around,
    numbers,
    pair,
    place_of,
    random_track,
    readings_of,
    scratch_readings,
    shared,
    sigma,
    unit,
)


def history(memory: Memory, i: int) -> Floats:
    """Return a sensor's history as rows: a view."""
    return numbers(memory.state["sensors"]["history"][0, i])


def kept_by(memory: Memory, t: int) -> Floats:
    """Return the readings that a circle keeps, as rows."""
    n = reservoir.copy_reservoir(memory.tracks[t], memory.s[0].scratch.readings)
    return scratch_readings(memory, n)


def test_a_reservoir_keeps_the_newest_of_each_direction() -> None:
    rng, memory = np.random.default_rng(1), shared()
    for t in range(TRACKS):
        want, centre = naive_tracks.Reservoir(BEARING_BINS, BIN_CAPACITY), rng.uniform(-1, 1, 2)
        for q in around(rng, int(rng.choice([0, 5, 600, 1500])), centre, 0.3):
            reservoir.keep_reading(memory.tracks[t], *pair(centre), readings_of(q[None])[0])
            want.put(centre, q)
        assert rows(kept_by(memory, t)) == rows(q for kept in want.kept for q in kept)


def test_what_sensors_remember_of_a_circle_is_gathered() -> None:
    rng, memory, total = np.random.default_rng(2), shared(), 0
    for _ in range(300):
        centre, rho = rng.uniform(-1, 1, 2), float(rng.choice(RADII))
        remembered: list[Floats] = []
        for i in range(SENSORS):
            count = int(rng.integers(0, 2 * HISTORY))
            memory.s[0].sensors[i].kept = count
            history(memory, i)[...] = around(rng, HISTORY, centre + rng.normal(0, 0.1, 2), rho)
            remembered += list(history(memory, i)[: min(count, HISTORY)].copy())
        n = reservoir.gather_history(memory.s, P, *pair(centre), rho)
        want = naive_tracks.gather(remembered, centre, rho, S.cos_may_answer, S.range_max_m)
        assert rows(scratch_readings(memory, n)) == want[:n]
        total += n
    assert total > 10_000


def drive(rng: np.random.Generator, firings: int) -> Iterator[tuple[tuple[float, float, float], float, np.ndarray]]:
    """A ring that goes, stops and turns, and what it hears: pose, time, ranges."""
    place, yaw, now, truth = np.zeros(2), 0.0, 0.0, rng.uniform(0.3, 2, SENSORS)
    for _ in range(firings):
        go = rng.choice([0.0, 0.01, 0.1])
        yaw += rng.choice([0.0, 0.01, 0.1]) * rng.normal()
        place = place + go * unit(yaw)
        now += rng.choice([0.2, 0.2, 0.2, 40.0], p=[0.33, 0.33, 0.33, 0.01])
        truth = np.abs(truth + rng.normal(0, 0.02, SENSORS) * (rng.random(SENSORS) < 0.5))
        chance = rng.random(SENSORS)
        ranges = np.where(chance < 0.4, np.nan, np.where(chance < 0.5, np.inf, truth))
        ranges[rng.random(SENSORS) < 0.01] = -1.0
        yield (float(place[0]), float(place[1]), yaw), now, ranges


def test_readings_are_placed_paired_and_remembered() -> None:
    rng, memory = np.random.default_rng(9), shared()
    scratch, sensors = memory.state["scratch"], memory.state["sensors"][0]
    last: dict[int, np.ndarray] = {}
    memories: list[list[np.ndarray]] = [[] for _ in range(SENSORS)]
    entered = segments = 0
    segment = zeros(PairSegment, 1)
    for pose, now, ranges in drive(rng, 500):
        m = observe.place_readings(memory.s, P, MOUNTS, *pose, ranges)
        want = naive_tracks.place_readings(last, MOUNTS, pose, ranges, S.range_max_m, S.half_resolution_m)
        assert m == len(want)
        cur = np.column_stack([numbers(scratch["fired"][0])[:m], scratch["fired_sensors"][0, :m]])
        assert cur == pytest.approx(np.array(want).reshape(m, 6), rel=1e-12, abs=1e-12)
        assert (scratch["explained_by"][0, :m] == -1).all()
        entered += m
        memory.s[0].noise_level = int(rng.integers(len(NOISES)))
        var0, rel2 = noise_estimation.noise_variance(memory.s, P)
        made = pairing.make_segments(memory.s, P, m, now)
        expected = []
        for i in range(m):
            if cur[i, 4] < FAR:
                for old in naive_tracks.partners(i, cur, memories, now, S.pair_gap_s):
                    var = var0 + rel2 * float(cur[i, 4]) ** 2
                    a, b = readings_of(np.array([old[:5], cur[i, :5]]))
                    if tangent(a, b, float(S.cos_half_angle), var, records(PairSegment, segment)[0]):
                        expected.append((*segment[0].item()[:7], i))
        assert made == len(expected)
        got = scratch["segments"][0, :made]
        actual = np.array([row[:7] for row in got.tolist()]).reshape(made, 7)
        assert actual == pytest.approx(np.array([e[:7] for e in expected]).reshape(made, 7), rel=1e-12, abs=1e-12)
        assert got["reading"].tolist() == [e[7] for e in expected]
        segments += made
        observe.update_history(memory.s, P, m, now)
        for q in cur:
            sensor = int(q[5])
            memories[sensor] = naive_tracks.remembered(
                memories[sensor], q, now, S.history_spacing_m, S.pair_gap_s, HISTORY
            )  # fmt: skip
        for i in range(SENSORS):
            held = min(int(sensors["kept"][i]), HISTORY)
            mine = np.column_stack([history(memory, i)[:held], sensors["times_s"][i, :held]])
            assert rows(mine) == rows(memories[i])
    assert entered > 1500
    assert segments > 300


def test_readings_go_to_the_best_circle_and_are_kept_by_all_they_bear_on() -> None:
    rng, memory = np.random.default_rng(10), shared()
    circles, scratch = memory.circles, memory.state["scratch"]
    fired, explained_by = numbers(scratch["fired"][0])[:SENSORS], scratch["explained_by"][0, :SENSORS]
    taken = kept = 0
    for _ in range(400):
        circles.view(np.uint8)[...] = 0
        memory.s[0].noise_level = int(rng.integers(len(NOISES)))
        for t in range(TRACKS):
            random_track(rng, memory, t)
        circles["idle_firings"], circles["unseen"] = 7, 2
        t = int(rng.integers(TRACKS))
        fired[...] = around(rng, SENSORS, place_of(memory, t), float(circles["radius"][t]))
        explained_by[...] = -1
        observe.associate_circles(memory.s, memory.tracks, P, SENSORS)
        sure = [
            (k, place_of(memory, k), float(circles["radius"][k]), float(circles["root_xx"][k]))
            for k in np.flatnonzero(circles["status"] == ESTABLISHED).tolist()
        ]
        owner = [
            naive_tracks.claimed_by(q, sure, S.cos_may_answer, S.half_resolution_m, sigma(memory)) for q in fired
        ]
        assert explained_by.tolist() == owner
        taken += sum(o >= 0 for o in owner)
        explained_by[rng.random(SENSORS) < 0.2] = -5  # a wall's
        observe.keep_readings(memory.s, memory.tracks, P, SENSORS)
        for k in range(TRACKS):
            status, centre, radius = circles["status"][k], place_of(memory, k), float(circles["radius"][k])
            want = [
                q for q, o in zip(fired.copy(), explained_by.tolist(), strict=True)
                if status != FREE and naive_tracks.bears_on(
                    q, centre, radius, o == -1, o in (-1, k) or (o < 0 and status == ESTABLISHED),
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
    assert taken > 1000
    assert kept > 3000
