"""Edits by a user: numbers, rejections, and tracks that nothing but that user ends."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes import manual_tracks, polygon_job, polygon_tracks, refine, track_labels
from perception.bayes.elements import BUCKET_CAPACITY, BUCKETS, READINGS_MAX, REJECTIONS_MAX
from perception.bayes.evidence import circle_evidence
from perception.bayes.kernel_settings import apply_library, copied, make_settings
from perception.bayes.map_edits import edit_memory
from perception.bayes.parameters import CELL_M, PLACED_STRAY_MAX_M, PLACED_STRAY_MAX_RAD
from perception.bayes.pinned_segments import Pins, delete, places_of
from perception.bayes.scratch import Score
from perception.bayes.segment_list import mapped_segments
from perception.bayes.segment_pairs import add_to_map, bucket_index
from perception.bayes.state import CONFIRMED, ESTABLISHED, FREE, PLACED, TENTATIVE, Memory
from perception.bayes.state_migration import migrate, radii_of
from perception.edits import PinSegments
from perception.records import array_of, records, zeros
from tests import naive_bayes
from tests.naive_tracks import FT
from tests.perception.tracks import (
    BOXES,
    COSINES,
    RADII,
    SENSORS,
    SETTINGS,
    TRACKS,
    P,
    S,
    around,
    noises,
    numbers,
    place_of,
    random_track,
    readings_of,
    shared,
)

BOX_P = make_settings(BOXES.ring, BOXES.models, BOXES.perception.bayes)


def listed(memory: Memory) -> dict[int, tuple[float, ...]]:
    """Return the mapped segments' middles and normals by number."""
    return {row[4]: row[:4] for row in mapped_segments(memory).tolist()}


def keep(memory: Memory, t: int, w: np.ndarray, bins: int = 36) -> None:
    """Have a circle keep readings, one after another in so many bins."""
    for j, q in enumerate(w):
        held = memory.circles["bins"][t, j % bins]
        held["readings"][j // bins] = tuple(q)
        held["count"] += 1


def add_segment(memory: Memory, row: np.ndarray, number: int) -> int:
    """Put a segment (middle, normal) into the map; return its bucket."""
    x, y, nx, ny = row.tolist()
    return add_to_map(memory.s[0].buckets, CELL_M, x, y, nx, ny, number, 0.1 * number)


def test_numbers_are_given_once() -> None:
    memory = shared()
    for t in (3, 5, 3):
        memory.circles["marks"][t] = CONFIRMED
        track_labels.assign_number(memory.s, memory.tracks[t])
    assert memory.circles["number"][[3, 5]].tolist() == [3, 2]
    assert memory.circles["marks"][[3, 5]].tolist() == [0, 0]
    assert memory.state["objects_numbered"][0] == 3


def test_a_rejection_holds_for_its_kind_its_place_and_less_evidence() -> None:
    memory = shared()

    def is_rejected(x: float, y: float, what: int, evidence_nat: float) -> bool:
        return track_labels.is_rejected(memory.s, x, y, what, evidence_nat)

    assert not is_rejected(1.0, 1.0, 0, -1e9)
    for k in range(REJECTIONS_MAX + 3):
        memory.state["rejections"][0, k % REJECTIONS_MAX] = (float(k), 0.0, 0.3, 7, 40.0)
        memory.state["rejection_count"] += 1
    at = float(REJECTIONS_MAX + 2)
    assert is_rejected(at + 0.2, 0.2, 7, 39.9)
    assert not is_rejected(at + 0.2, 0.2, 7, 40.0)
    assert not is_rejected(at + 0.2, 0.2, 8, 0.0)
    assert not is_rejected(at + 0.2, 0.25, 7, 0.0)
    assert not is_rejected(0.0, 0.0, 7, 0.0), "the oldest made room"
    assert is_rejected(3.0, 0.0, 7, 0.0)


@pytest.mark.parametrize("mark", [CONFIRMED, PLACED, CONFIRMED | PLACED])
def test_no_reading_ends_a_circle_that_a_user_marked_nor_makes_it_something_else(mark: int) -> None:
    rng, memory = np.random.default_rng(mark), shared()
    circles, track = memory.circles, memory.tracks[0]
    tentative = 0
    for turn in range(150):
        circles.view(np.uint8)[...] = 0
        memory.state["lines"].view(np.uint8)[...] = 0
        random_track(rng, memory, 0, int(rng.choice([TENTATIVE, ESTABLISHED])))
        track.root_xx = track.root_yy = 0.01
        track.number, track.marks = 9, mark
        kind, radius = int(track.kind), float(track.radius)
        w = around(rng, int(rng.integers(0, 60)), place_of(memory, 0), float(rng.choice([radius, 0.6, 0.0])))
        if turn % 3 == 0:  # a wall before it
            w[:, 4] = np.abs(w[:, 2]) * 0.5
        keep(memory, 0, w)
        refine.refine(memory.s, memory.tracks, P, 0)
        assert track.status != FREE
        assert track.kind == kind
        assert track.number == 9
        assert track.marks & CONFIRMED == mark & CONFIRMED
        tentative += track.status == TENTATIVE
    assert tentative > 20


def test_no_reading_ends_a_polygon_that_a_user_marked() -> None:
    memory = Memory(SENSORS, TRACKS)
    track = memory.s[0].polygons[2]
    for mark, left in ((0, FREE), (PLACED, TENTATIVE)):
        track.status, track.log_likelihood_ratio, track.marks = ESTABLISHED, -50.0, mark
        polygon_tracks.update_status(memory.s, BOX_P, track)
        assert track.status == left


def test_of_two_polygons_in_one_place_that_stays_which_a_user_marked() -> None:
    rng = np.random.default_rng(8)
    inner = float(BOX_P[0].polygons[0].inner_radius_m)
    for _ in range(300):
        memory = Memory(SENSORS, TRACKS)
        two = memory.polygons[:2]
        two["status"] = rng.choice([TENTATIVE, ESTABLISHED], 2)
        two["log_likelihood_ratio"], two["hits"] = rng.normal(20, 10, 2), 20.0
        two["x"][1] = apart = float(rng.choice([0.2, 1.0, 2.5])) * inner
        two["number"] = [4, 3]
        two["marks"] = int(rng.choice([0, PLACED])), int(rng.choice([0, CONFIRMED]))
        marked = two["marks"] != 0
        before = two["status"].copy()
        more = two["log_likelihood_ratio"].copy()
        polygon_tracks.merge_polygons(memory.s, BOX_P, 0)
        live = two["status"] != FREE
        if apart >= 1.8 * inner:
            assert live.all()
        elif marked.any():
            winner = int(np.argmax(marked)) if marked[0] != marked[1] else int(np.argmax(more))
            assert live.tolist() == [winner == 0, winner == 1]
            assert two["number"][winner] == [4, 3][winner], "it keeps its own number"
        elif apart < 0.4 * inner:
            winner = int(np.argmax(more))
            assert live.tolist() == [winner == 0, winner == 1]
            assert two["number"][winner] == 3, "of twins the older number stays"
        else:
            winner = int(np.argmax(more))
            assert live[winner]
            assert live[1 - winner] == (before[winner] != ESTABLISHED)


def test_what_each_reading_says_of_a_circle_equals_its_oracle() -> None:
    rng, memory, said = np.random.default_rng(12), shared(), 0
    for _ in range(200):
        memory.circles.view(np.uint8)[...] = 0
        random_track(rng, memory, 0, ESTABLISHED)
        place, rho = place_of(memory, 0), float(memory.circles["radius"][0])
        keep(memory, 0, around(rng, 40, place, rho))
        readings, nats = readings_of(np.zeros((READINGS_MAX, 5))), np.zeros(READINGS_MAX)
        score = records(Score, zeros(Score, 1))
        assert circle_evidence(memory.s, memory.tracks, P, 0, readings, score, nats) == 40
        w = numbers(array_of(readings))[:40]
        noise = noises()[int(memory.s[0].noise_level)]
        want = [
            naive_bayes.score_circle(
                w[j : j + 1], place, rho, COSINES, S.gate_m, S.missed_echo_nat, S.short_echo_nat, noise
            )["llr"]
            for j in range(40)
        ]  # fmt: skip
        assert nats[:40] == pytest.approx(want, rel=1e-12, abs=1e-11), "alone nothing hides or explains anything"
        said += int(np.count_nonzero(nats))
        # One that stands right before it hides it from where silence would speak against it.
        random_track(rng, memory, 1, ESTABLISHED)
        memory.circles["x"][1], memory.circles["y"][1] = 0.5 * (place + w[0, :2])
        memory.circles["radius"][1] = 0.05
        circle_evidence(memory.s, memory.tracks, P, 0, readings, score, nats)
        is_silent = w[0, 4] - (math.dist(place, w[0, :2]) - rho) > S.gate_m
        if is_silent and math.dist(place, w[0, :2]) > 0.1 + 2.5 * rho:
            assert nats[0] == 0.0
    assert said > 2000


def cells_of_eight_buckets() -> np.ndarray:
    """Return cells of the map that share eight buckets, shape (n, 2)."""
    cells = np.stack(np.meshgrid(np.arange(-200, 200), np.arange(-200, 200)), axis=-1).reshape(-1, 2)
    buckets = [bucket_index(x, y, BUCKETS) for x, y in cells.tolist()]
    return cells[np.array(buckets) < 8]


def test_a_bucket_is_left_in_its_order_and_pins_come_back() -> None:
    """Against a list: which of a bucket's segments are there, oldest first, and which a pin brings back."""
    rng, memory, pins, total = np.random.default_rng(5), Memory(4, TRACKS), Pins(), 0
    buckets = memory.state["buckets"][0]
    kept: dict[int, tuple[float, ...]] = {}
    cells = cells_of_eight_buckets()[rng.permutation(300)[:49]]  # so that cells take buckets from one another
    for _ in range(2000):
        turn = rng.random()
        present = list(listed(memory))
        assert len(set(present)) == len(mapped_segments(memory))
        some = tuple(int(n) for n in rng.choice(present, min(2, len(present)), replace=False)) if present else ()
        if turn < 0.7:
            total += 1
            place = (cells[rng.integers(len(cells))] + rng.uniform(0.1, 0.9, 2)) * CELL_M
            add_segment(memory, np.array([*place, 1.0, 0.0]), total)
            pins.renew(memory)
        elif turn < 0.8:
            assert delete(memory, pins, (*some, 10**6)) == {10**6}
            assert set(listed(memory)) == set(present) - set(some)
            kept = {n: row for n, row in kept.items() if n not in some}
        elif turn < 0.9:
            missing, full = pins.add(memory, (*some, 10**6))
            assert missing == {10**6}
            for n in set(some) - full:
                ((k, j),) = places_of(memory, (n,)).tolist()
                kept[n] = buckets["segments"][k, j].item()[:4]
        elif kept:
            n = int(rng.choice(list(kept)))
            assert pins.remove((n, 10**6)) == {10**6}
            del kept[n]
        assert set(pins.numbers.tolist()) == set(kept)
        there = listed(memory)
        for n, row in kept.items():
            assert there[n] == row, "what is pinned is there, as it was"
        for k in np.flatnonzero(buckets["count"]).tolist():
            count = int(buckets["count"][k])
            held = min(count, BUCKET_CAPACITY)
            order = (count - held + np.arange(held)) % BUCKET_CAPACITY
            fresh = [n for n in buckets["segments"]["number"][k, order].tolist() if n not in kept]
            assert fresh == sorted(fresh), "a bucket's oldest is the first to go"
    assert total > 1000
    assert np.count_nonzero(buckets["count"]) <= 8
    pins.clear()
    assert pins.count == 0


def test_a_bucket_is_never_pinned_altogether_and_that_is_said() -> None:
    memory, pins = Memory(4, TRACKS), Pins()
    for number in range(1, 9):
        add_segment(memory, np.array([0.1, 0.1, 1.0, 0.0]), number)
    refused = edit_memory(memory, P, pins, (), (), PinSegments(tuple(range(1, 9)), pinned=True))
    assert refused is not None
    assert refused.startswith("2 of 8 segments could not be pinned")
    assert pins.count == 6


def test_relaxation_from_a_users_pose_stays_near_it() -> None:
    """Whatever lies in the map; what leads farther away is not what the user meant."""
    rng, strayed = np.random.default_rng(4), 0
    for _ in range(300):
        memory = Memory(SENSORS, TRACKS)
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
    for other, left in ((t + 1, polygon_job.REFINEMENT), (t, polygon_job.NO_JOB)):
        job.kind, job.track = polygon_job.REFINEMENT, other
        manual_tracks.move_polygon(s, BOX_P, t, 0.6, 0.5, 0.1)
        assert job.kind == left
    track = s[0].polygons[t]
    assert (track.number, track.marks) == (1, PLACED)
    assert (track.x, track.y) == (0.6, 0.5)


def test_a_rival_that_has_become_a_model_is_looked_at_as_one() -> None:
    """A post of 0.35 ft is a rival of the drums; a model of 0.11 m is that post."""
    post = SETTINGS.models[0].model_copy(update={"name": "bollard", "arc_radius_m": 0.11})
    after = copied(P)
    apply_library(after, (*SETTINGS.models, post))
    new = radii_of(after)
    assert radii_of(P).tolist() == RADII.tolist(), "the settings before are left as they were"
    rival = int(np.argmin(np.abs(RADII - 0.35 * FT)))
    memory, many = shared(), len(RADII)
    circles, kinds = memory.circles, (0, rival, many - 1)
    for t, kind in enumerate(kinds):
        circles["status"][t], circles["kind"][t], circles["radius"][t] = ESTABLISHED, kind, RADII[kind]
        circles["leads"][t, : many + 2] = np.arange(many + 2) + 10.0 * t
        circles["leads"][t, kind] = 0.0
    memory.state["rejections"][0, 0] = (1.0, 1.0, 0.3, 0, 40.0)
    memory.state["rejection_count"] = 1
    migrate(memory, P, after)
    leads = circles["leads"]
    assert not leads[:, len(new) + 2 :].any()
    found = circles["kind"][:3].tolist()
    assert new[found].tolist() == circles["radius"][:3].tolist() == [RADII[0], 0.11, RADII[-1]]
    assert found[1] < after[0].model_count
    assert (circles["unseen"][:3] > 0).tolist() == [False, True, False]
    for t, kind in enumerate(kinds):
        for k, rho in enumerate(RADII.tolist()):
            to = int(np.argmin(np.abs(new - rho)))
            assert leads[t, to] == (0.0 if k == kind else k + 10.0 * t)
        assert leads[t, len(new) : len(new) + 2].tolist() == [many + 10.0 * t, many + 1 + 10.0 * t]
    assert new[memory.state["rejections"]["what"][0, 0]] == RADII[0]
