"""Naming of circles and polygons against oracles on random cases, and reports of what changed only."""

from __future__ import annotations

import numpy as np

from perception.bayes.memory.elements import MAX_POLYGONS, POLYGON_BIN_CAPACITY
from perception.bayes.memory.state import CONFIRMED, ESTABLISHED, FREE, PLACED, TENTATIVE, Memory
from perception.bayes.tracks import naming
from perception.records import records, zeros
from tests import naive_naming
from tests.perception.bayes.random_tracks import (
    ALTERNATIVES,
    RADII,
    TRACKS,
    P,
    S,
    around,
    examples,
    new_memory,
    places,
    random_track,
    unit,
)


@examples(200, 2000)
def test_sure_and_marked_circles_are_reported(examples: int) -> None:
    rng, memory, out, sure = np.random.default_rng(16), new_memory(), np.zeros(TRACKS, np.int64), 0
    circles, reported = memory.circles, records(naming.Reported, zeros(naming.Reported, TRACKS))

    def report() -> list[int]:
        n = naming.report_circles(memory.tracks, P, reported, out)
        return [t if t >= 0 else ~t for t in out[:n].tolist()]

    for _ in range(examples):
        for t in range(TRACKS):
            random_track(rng, memory, t)
        circles["kind"] = rng.integers(0, 2, TRACKS)
        circles["probability"] = rng.uniform(0.4, 1, TRACKS)
        circles["unknown_nat"] = circles["log_likelihood_ratio"] / rng.uniform(1, 1.4, TRACKS)
        circles["covariance_xx"], circles["covariance_yy"] = rng.uniform(0, 0.07, (2, TRACKS)) ** 2
        leads = circles["leads"][:, :ALTERNATIVES]
        leads[...] = rng.uniform(-60, -15, leads.shape)
        leads[:, -2] = rng.choice([0.0, -3.9, -4.1, -30.0], TRACKS)
        circles["dispersion"] = rng.uniform(0.004, 0.03, TRACKS)
        circles["is_named"] = rng.integers(0, 2, TRACKS)
        circles["room_lead"] = rng.choice([-90.0, -8.1, -7.9], TRACKS)
        circles["outline_lead"] = rng.choice([0.0, -2.0, -2.9, -3.1, -5.3, -5.6, -20.0], TRACKS)
        circles["reservoir"] = rng.choice([20, 79, 80, 200], TRACKS)
        circles["refinements"] = rng.integers(0, 12, TRACKS)
        careful, is_standing = (bool(rng.random() < 0.3) for _ in range(2))
        doubtful = [
            naive_naming.is_doubtful(
                careful,
                it["room_lead"],
                it["outline_lead"],
                np.delete(leads[t], it["kind"]).tolist(),
                0.5 if it["is_named"] else 0.92,
            )
            for t, it in enumerate(circles)
        ]
        want = [
            t for t, it in enumerate(circles)
            if not doubtful[t] and naive_naming.is_called(
                it["is_named"] == 1, it["status"] == ESTABLISHED, it["kind"] < S.model_count, it["probability"], 0.92,
                0.7, np.delete(leads[t], it["kind"]).tolist(), leads[t, -2], it["dispersion"],
                it["log_likelihood_ratio"], it["unknown_nat"], [it["covariance_xx"], it["covariance_yy"]],
                it["reservoir"] < 80 or it["refinements"] >= 1 + len(RADII), is_standing,
            )
        ]  # fmt: skip
        for t in range(TRACKS):
            naming.update_name(memory.tracks[t], P, 0.92, 0.7, careful, is_standing)
        circles["marks"] = 0
        assert report() == want
        sure += len(want)
        circles["marks"] = rng.choice([0, CONFIRMED, PLACED], TRACKS)
        is_marked = (circles["status"] != FREE) & (circles["marks"] > 0) & (circles["kind"] < S.model_count)
        marked = np.flatnonzero(is_marked).tolist()
        assert report() == sorted({*want, *marked})
    assert sure > 0.05 * examples


@examples(300, 5000)
def test_of_two_named_circles_that_overlap_the_one_of_more_evidence_is_named(examples: int) -> None:
    rng, memory, withdrawn, kept = np.random.default_rng(18), new_memory(), 0, 0
    circles = memory.circles
    for _ in range(examples):
        for t in range(TRACKS):
            random_track(rng, memory, t, int(rng.choice([TENTATIVE, ESTABLISHED], p=(0.2, 0.8))))
        circles["is_named"] = rng.integers(0, 2, TRACKS)
        named = ((circles["status"] == ESTABLISHED) & (circles["is_named"] == 1)).tolist()
        circles["is_named"] = named
        t = int(rng.integers(TRACKS))
        naming.withdraw_overlapping(memory.tracks, t)
        want = naive_naming.without_overlaps(
            t, named, places(memory), circles["radius"].tolist(), circles["log_likelihood_ratio"].tolist()
        )
        assert circles["is_named"].tolist() == want
        withdrawn += sum(named) - sum(want)
        kept += sum(want)
    assert withdrawn > 0.15 * examples
    assert kept > examples


@examples(10, 200)
def test_polygons_are_sure_when_seen_from_near_and_from_two_sides(examples: int) -> None:
    rng, memory, out, sure = np.random.default_rng(17), new_memory(), np.zeros(MAX_POLYGONS, np.int64), 0
    polygons = memory.polygons
    for _ in range(examples):
        polygons.view(np.uint8)[...] = 0
        kept = []
        for t in range(MAX_POLYGONS):
            track = memory.s[0].polygons[t]
            track.status = int(rng.choice([TENTATIVE, ESTABLISHED]))
            track.probability, track.hits = rng.uniform(0.85, 1), rng.uniform(10, 40)
            polygons["covariance"]["xx"][t], polygons["covariance"]["yy"][t] = rng.uniform(0, 0.005, 2)
            w = around(rng, int(rng.integers(0, 120)), np.zeros(2), 0.2)
            w[:, 4] += rng.choice([0.0, 1.8])
            w[:, 2:4] = unit(rng.uniform(0, 7) + rng.normal(0, rng.uniform(0, 0.5), len(w)))
            for i, q in enumerate(w):
                held = polygons["bins"][t, i % 10]
                held["readings"][held["count"] % POLYGON_BIN_CAPACITY] = (*q, 0.0, 0.0)
                polygons["bins"]["count"][t, i % 10] += 1
            kept.append(w)
        want = [
            t for t, it in enumerate(polygons)
            if naive_naming.is_sure_polygon(
                it["status"] == ESTABLISHED, it["probability"], 0.9, it["hits"],
                [it["covariance"]["xx"], it["covariance"]["yy"]], kept[t],
            )
        ]  # fmt: skip
        n = naming.sure_polygons(memory.s, 0.9, out)
        assert out[:n].tolist() == want
        sure += n
        polygons["marks"][5] = CONFIRMED
        n = naming.sure_polygons(memory.s, 0.9, out)
        assert out[:n].tolist() == sorted({*want, 5})
    assert sure > examples


def test_only_a_changed_circle_is_reported_as_changed() -> None:
    rng, memory = np.random.default_rng(5), Memory(4, 6)
    circles = memory.circles
    last = zeros(naming.Reported, 6)
    last["x"] = np.nan
    reported = records(naming.Reported, last)
    for name in ("x", "y", "covariance_xx", "covariance_xy", "covariance_yy", "hits", "probability"):
        circles[name] = rng.normal(size=6)
    circles["kind"] = rng.integers(0, 3, 6)
    circles["is_named"] = 1

    def report(*tracks: int) -> list[int]:
        circles["status"] = 0
        circles["status"][list(tracks)] = ESTABLISHED
        sure = np.full(8, 99, np.int64)
        n = naming.report_circles(memory.tracks, P, reported, sure)
        assert sure[n:].tolist() == [99] * (8 - n)
        found: list[int] = sure[:n].tolist()
        return found

    assert report(0, 2, 5) == [~0, ~2, ~5]
    assert report(0, 2, 4, 5) == [0, 2, ~4, 5]
    for name in ("x", "y", "covariance_xx", "covariance_xy", "covariance_yy", "hits", "probability"):
        circles[name][2] += 1e-12
        assert report(0, 2, 5) == [0, ~2, 5], name
        assert report(0, 2, 5) == [0, 2, 5], name
    circles["kind"][5] += 1
    assert report(2, 5) == [2, ~5]
    for name in ("number", "marks"):
        circles[name][2] += 1
        assert report(2, 5) == [~2, 5], name
    circles["is_named"], circles["marks"], circles["kind"] = 0, PLACED, S.model_count
    assert report(2, 5) == [], "a mark makes no model of another circle"
