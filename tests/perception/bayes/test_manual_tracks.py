"""A person's word among the kernels: numbers, bars, and tracks that nothing but that person ends."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes import manual_tracks as by_hand
from perception.bayes import polygon_job, polygon_tracks, refine
from perception.bayes import track_labels as marks
from perception.bayes.evidence import weigh_circle
from perception.bayes.kernel_settings import library, make_settings
from perception.bayes.map_edits import edit_memory
from perception.bayes.pinned_segments import Pins, delete, where
from perception.bayes.segment_list import listed
from perception.bayes.segment_pairs import map_add
from perception.bayes.state import (
    BARRED,
    BARS,
    CONFIRMED,
    DIRTY,
    ESTABLISHED,
    FREE,
    KIND,
    MARK,
    MODEL,
    NUMBER,
    NUMBERED,
    PHITS,
    PLACED,
    PLLR,
    PT,
    PX,
    PY,
    R00,
    R11,
    ST,
    STAMP,
    TENTATIVE,
    TRHO,
    TX,
    TY,
    make_state,
)
from perception.bayes.state_migration import inherit
from perception.bayes.track_initiation import CELL_M
from perception.edits import PinSegments
from tests import naive_bayes as naive_full
from tests.naive_tracks import FT
from tests.perception.tracks import (
    BOXES,
    COSINES,
    SENSORS,
    SETTINGS,
    TRACKS,
    P,
    around,
    noises,
    random_track,
    shared,
)

BOX_P = make_settings(BOXES.ring, BOXES.models, BOXES.perception.bayes)


def test_numbers_are_given_once() -> None:
    s = shared()
    for row in (3, 5, 3):
        s.names[row, MARK] = CONFIRMED
        marks.give_number(s.names, s.tally, row)
    assert (s.names[3].tolist(), s.names[5].tolist(), int(s.tally[NUMBERED])) == ([3, 0], [2, 0], 3)


def test_a_bar_holds_for_its_kind_its_place_and_less_evidence() -> None:
    s = shared()
    assert not marks.is_barred(s, 1.0, 1.0, 0, -1e9)
    for k in range(BARRED + 3):
        s.barred[k % BARRED] = (float(k), 0.0, 0.3, 7, 40.0)
        s.tally[BARS] += 1
    at = float(BARRED + 2)
    assert marks.is_barred(s, at + 0.2, 0.2, 7, 39.9)
    assert not marks.is_barred(s, at + 0.2, 0.2, 7, 40.0)
    assert not marks.is_barred(s, at + 0.2, 0.2, 8, 0.0)
    assert not marks.is_barred(s, at + 0.2, 0.25, 7, 0.0)
    assert not marks.is_barred(s, 0.0, 0.0, 7, 0.0), "the oldest made room"
    assert marks.is_barred(s, 3.0, 0.0, 7, 0.0)


@pytest.mark.parametrize("mark", [CONFIRMED, PLACED, CONFIRMED | PLACED])
def test_no_reading_ends_a_circle_that_a_person_spoke_of_nor_makes_it_something_else(mark: int) -> None:
    rng, s = np.random.default_rng(mark), shared()
    tentative = 0
    for turn in range(150):
        s.ti[...], s.tf[...], s.bn[...], s.comp[...], s.lines[...] = 0, 0.0, 0, 0.0, 0.0
        random_track(rng, s, 0, int(rng.choice([TENTATIVE, ESTABLISHED])))
        s.tf[0, [R00, R11]] = 0.01
        s.names[0] = (9, mark)
        kind = int(s.ti[0, KIND])
        w = around(rng, int(rng.integers(0, 60)), s.tf[0, [TX, TY]], float(rng.choice([s.tf[0, TRHO], 0.6, 0.0])))
        if turn % 3 == 0:  # a wall before it
            w[:, 4] = np.abs(w[:, 2]) * 0.5
        for j, q in enumerate(w):
            s.bins[0, j % 36, j // 36] = q
            s.bn[0, j % 36] += 1
        refine.refine(s, P, 0)
        assert s.ti[0, ST] != FREE
        assert s.ti[0, KIND] == kind
        assert s.names[0, NUMBER] == 9
        assert s.names[0, MARK] & CONFIRMED == mark & CONFIRMED
        tentative += s.ti[0, ST] == TENTATIVE
    assert tentative > 20


def test_no_reading_ends_a_polygon_that_a_person_spoke_of() -> None:
    s = make_state(SENSORS, BOX_P, TRACKS, 64)
    for mark, left in ((0, FREE), (PLACED, TENTATIVE)):
        s.pi[2, ST], s.pf[2, PLLR] = ESTABLISHED, -50.0
        s.names[TRACKS + 2, MARK] = mark
        polygon_tracks.judge(s, BOX_P, 2)
        assert s.pi[2, ST] == left


def test_of_two_polygons_in_one_place_that_stays_which_a_person_spoke_of() -> None:
    rng = np.random.default_rng(8)
    inner = float(BOX_P.inner[0])
    for _ in range(300):
        s = make_state(SENSORS, BOX_P, TRACKS, 64)
        s.pi[:2, ST] = rng.choice([TENTATIVE, ESTABLISHED], 2)
        s.pi[:, MODEL] = 0
        s.pf[:2, PLLR], s.pf[:2, PHITS] = rng.normal(20, 10, 2), 20.0
        s.pf[1, [PX, PY]] = float(rng.choice([0.2, 1.0, 2.5])) * inner, 0.0
        s.names[TRACKS : TRACKS + 2] = [[4, int(rng.choice([0, PLACED]))], [3, int(rng.choice([0, CONFIRMED]))]]
        said = s.names[TRACKS : TRACKS + 2, MARK] != 0
        before, apart = s.pi[:2, ST].copy(), s.pf[1, PX]
        more = s.pf[:2, PLLR].copy()
        polygon_tracks.merge_polygons(s, BOX_P, 0)
        live = s.pi[:2, ST] != FREE
        if apart >= 1.8 * inner:
            assert live.all()
        elif said.any():
            winner = int(np.argmax(said)) if said[0] != said[1] else int(np.argmax(more))
            assert live.tolist() == [winner == 0, winner == 1]
            assert s.names[TRACKS + winner, NUMBER] == [4, 3][winner], "it keeps its own number"
        elif apart < 0.4 * inner:
            winner = int(np.argmax(more))
            assert live.tolist() == [winner == 0, winner == 1]
            assert s.names[TRACKS + winner, NUMBER] == 3, "of twins the older number stays"
        else:
            winner = int(np.argmax(more))
            assert live[winner]
            assert live[1 - winner] == (before[winner] != ESTABLISHED)


def test_what_each_reading_says_of_a_circle_equals_its_oracle() -> None:
    rng, s, said = np.random.default_rng(12), shared(), 0
    for _ in range(200):
        s.ti[...] = 0
        random_track(rng, s, 0, ESTABLISHED)
        place, rho = s.tf[0, [TX, TY]], float(s.tf[0, TRHO])
        w = around(rng, 40, place, rho)
        stats, nats = np.zeros(12), np.full(40, np.nan)
        weigh_circle(s, P, 0, w, 40, stats, nats)
        noise = noises()[int(s.g[0])]
        want = [
            naive_full.score_circle(w[j : j + 1], place, rho, COSINES, P.gate, P.miss, P.short, noise)["llr"]
            for j in range(40)
        ]
        assert nats == pytest.approx(want, rel=1e-12, abs=1e-11), "alone nothing hides it and nobody else explains it"
        said += int(np.count_nonzero(nats))
        # One that stands right before it hides it from where silence would speak against it.
        random_track(rng, s, 1, ESTABLISHED)
        s.tf[1, [TX, TY]], s.tf[1, TRHO] = 0.5 * (place + w[0, :2]), 0.05
        weigh_circle(s, P, 0, w, 40, stats, nats)
        silent = w[0, 4] - (math.dist(place, w[0, :2]) - rho) > P.gate
        if silent and math.dist(place, w[0, :2]) > 0.1 + 2.5 * rho:
            assert nats[0] == 0.0
    assert said > 2000


def test_a_bucket_is_left_in_its_order_and_pins_come_back() -> None:
    """Against a list: which of a bucket's segments are there, oldest first, and which a pin brings back."""
    rng, s, pins, total = np.random.default_rng(5), make_state(4, P, TRACKS, 8), Pins(), 0
    kept: dict[int, np.ndarray] = {}
    for _ in range(2000):
        turn = rng.random()
        numbers = listed(s)[0]
        assert len(set(numbers.tolist())) == len(numbers)
        some = tuple(int(n) for n in rng.choice(numbers, min(2, len(numbers)), replace=False))
        if turn < 0.7:
            row = np.array([*rng.uniform(-1.0, 1.0, 2), 1.0, 0.0])
            bucket = map_add(row, CELL_M, s.tags, s.fill, s.store)
            total += 1
            s.stamps[bucket, (s.fill[bucket] - 1) % s.store.shape[1]] = (total, 0.1 * total)
            pins.renew(s)
        elif turn < 0.8:
            before = set(numbers.tolist())
            assert delete(s, pins, (*some, 10**6)) == {10**6}
            assert set(listed(s)[0].tolist()) == before - set(some)
            kept = {n: row for n, row in kept.items() if n not in some}
        elif turn < 0.9:
            missing, full = pins.add(s, (*some, 10**6))
            assert missing == {10**6}
            for n in set(some) - full:
                ((k, j),) = where(s, (n,)).tolist()
                kept[n] = s.store[k, j].copy()
        elif kept:
            n = int(rng.choice(list(kept)))
            assert pins.remove((n, 10**6)) == {10**6}
            del kept[n]
        assert set(pins.numbers.astype(int).tolist()) == set(kept)
        there = dict(zip(listed(s)[0].tolist(), listed(s)[2].tolist(), strict=True))
        for n, row in kept.items():
            assert there[n] == row.tolist(), "what is pinned is there, as it was"
        for k in range(8):
            held = min(int(s.fill[k]), 8)
            order = (int(s.fill[k]) - held + np.arange(held)) % 8
            fresh = [n for n in s.stamps[k, order, STAMP].tolist() if n not in kept]
            assert fresh == sorted(fresh), "a bucket's oldest is the first to go"
    assert total > 1000
    pins.clear()
    assert (pins.count, PT) == (0, 24)


def test_a_bucket_is_never_pinned_altogether_and_that_is_said() -> None:
    s, pins = make_state(4, P, TRACKS, 64), Pins()
    for number in range(1, 9):
        bucket = map_add(np.array([0.1, 0.1, 1.0, 0.0]), CELL_M, s.tags, s.fill, s.store)
        s.stamps[bucket, number - 1] = (number, 0.0)
    refused = edit_memory(s, P, pins, (), (), PinSegments(tuple(range(1, 9)), pinned=True))
    assert refused is not None
    assert refused.startswith("2 of these segments cannot be pinned")
    assert pins.count == 6


def test_relaxation_from_a_hand_stays_near_it() -> None:
    """Whatever lies in the map; what leads farther away is not what the hand meant."""
    rng, strayed = np.random.default_rng(4), 0
    for _ in range(300):
        s = make_state(SENSORS, BOX_P, TRACKS, 64)
        for _ in range(int(rng.integers(3, 14))):
            normal = rng.uniform(-math.pi, math.pi)
            row = np.array([*rng.uniform(-0.7, 0.7, 2), math.cos(normal), math.sin(normal)])
            map_add(row, CELL_M, s.tags, s.fill, s.store)
        by_hand.settle_circle(s, BOX_P, 0, 0.1, -0.1)
        assert math.hypot(s.pose[0] - 0.1, s.pose[1] + 0.1) <= by_hand.STRAYED_M
        by_hand.settle_polygon(s, BOX_P, 0, 0.1, -0.1, 0.3)
        assert math.hypot(s.pose[0] - 0.1, s.pose[1] + 0.1) <= by_hand.STRAYED_M
        assert abs(s.pose[2] - 0.3) <= by_hand.STRAYED_RAD
        strayed += s.pose.tolist() == [0.1, -0.1, 0.3]
    assert strayed > 0


def test_a_polygon_under_work_that_is_moved_or_goes_is_worked_on_no_more() -> None:
    s = make_state(SENSORS, BOX_P, TRACKS, 64)
    t = by_hand.place_polygon(s, BOX_P, 0, 0.5, 0.5, 0.1)
    for other, left in ((t + 1, polygon_job.TRACK), (t, polygon_job.NO_JOB)):
        s.job[polygon_job.JOB], s.job[polygon_job.WHO] = polygon_job.TRACK, other
        by_hand.move_polygon(s, BOX_P, t, 0.6, 0.5, 0.1)
        assert s.job[polygon_job.JOB] == left
    assert s.names[TRACKS + t].tolist() == [1, PLACED]
    assert s.pf[t, [PX, PY]].tolist() == [0.6, 0.5]


def test_a_rival_that_has_become_a_model_is_looked_at_as_one() -> None:
    """A post of 0.35 ft is a rival of the drums; a model of 0.11 m is that post."""
    post = SETTINGS.models[0].model_copy(update={"name": "bollard", "arc_radius_m": 0.11})
    after = P._replace(**library((*SETTINGS.models, post)))
    rival = int(np.argmin(np.abs(P.radii - 0.35 * FT)))
    s = shared()
    for t, kind in enumerate((0, rival, len(P.radii) - 1)):
        s.ti[t, ST], s.ti[t, KIND], s.tf[t, TRHO] = ESTABLISHED, kind, P.radii[kind]
        s.comp[t] = np.arange(len(P.radii) + 2) + 10.0 * t
        s.comp[t, kind] = 0.0
    s.barred[0] = (1.0, 1.0, 0.3, 0, 40.0)
    s.tally[BARS] = 1
    heirs = inherit(s, P, after)
    assert heirs.comp.shape == (TRACKS, len(after.radii) + 2)
    kinds = s.ti[:3, KIND].tolist()
    assert after.radii[kinds].tolist() == s.tf[:3, TRHO].tolist() == [P.radii[0], 0.11, P.radii[-1]]
    assert kinds[1] < after.models
    assert (s.ti[:3, DIRTY] > 0).tolist() == [False, True, False]
    for t, kind in enumerate((0, rival, len(P.radii) - 1)):
        for k, rho in enumerate(P.radii.tolist()):
            to = int(np.argmin(np.abs(after.radii - rho)))
            assert heirs.comp[t, to] == (0.0 if k == kind else k + 10.0 * t)
        assert heirs.comp[t, -2:].tolist() == [len(P.radii) + 10.0 * t, len(P.radii) + 1 + 10.0 * t]
    assert after.radii[int(s.barred[0, 3])] == P.radii[0]
