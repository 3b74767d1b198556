"""What is reported, against its oracle on random cases: what is sure, how well placed, and what a rival is called."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes import naming, object_report, walls
from perception.bayes.elements import MAX_POLYGONS, POLYGON_BIN_CAPACITY
from perception.bayes.state import CONFIRMED, ESTABLISHED, FREE, PLACED, TENTATIVE
from perception.records import records, zeros
from tests import naive_tracks
from tests.naive_tracks import FT
from tests.perception.tracks import (
    ALTERNATIVES,
    TRACKS,
    P,
    S,
    around,
    line_rows,
    place_of,
    random_lines,
    random_track,
    shared,
    unit,
)


def test_what_is_sure_is_reported() -> None:
    rng, memory, out, sure = np.random.default_rng(16), shared(), np.zeros(max(MAX_POLYGONS, TRACKS), np.int64), 0
    circles, reported = memory.circles, records(naming.Reported, zeros(naming.Reported, TRACKS))

    def report() -> list[int]:
        n = naming.report_circles(memory.tracks, reported, out)
        return [t if t >= 0 else ~t for t in out[:n].tolist()]

    for _ in range(2000):
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
        want = [
            t for t, it in enumerate(circles)
            if naive_tracks.is_called(
                it["is_named"] == 1, it["status"] == ESTABLISHED, it["kind"] < S.model_count, it["probability"], 0.92,
                0.7, np.delete(leads[t], it["kind"]).tolist(), leads[t, -2], it["dispersion"],
                it["log_likelihood_ratio"], it["unknown_nat"], [it["covariance_xx"], it["covariance_yy"]],
            )
        ]  # fmt: skip
        for t in range(TRACKS):
            naming.update_name(memory.tracks[t], P, 0.92, 0.7)
        circles["marks"] = 0
        assert report() == want
        sure += len(want)
        circles["marks"] = rng.choice([0, CONFIRMED, PLACED], TRACKS)
        marked = np.flatnonzero((circles["status"] != FREE) & (circles["marks"] > 0)).tolist()
        assert report() == sorted({*want, *marked})
    assert sure > 200


def test_polygons_are_sure_when_seen_from_near_and_from_two_sides() -> None:
    rng, memory, out, sure = np.random.default_rng(17), shared(), np.zeros(MAX_POLYGONS, np.int64), 0
    polygons = memory.polygons
    for _ in range(200):
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
                held["readings"][held["count"] % POLYGON_BIN_CAPACITY] = tuple(q)
                polygons["bins"]["count"][t, i % 10] += 1
            kept.append(w)
        want = [
            t for t, it in enumerate(polygons)
            if naive_tracks.is_sure_polygon(
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
    assert sure > 200


def test_a_covariances_worst_axis_and_the_names_of_rivals() -> None:
    rng, memory, corners = np.random.default_rng(18), shared(), 0
    for _ in range(1000):
        root = rng.normal(0, 1, (2, 2))
        cov = root @ root.T
        worst = math.sqrt(float(np.linalg.eigvalsh(cov)[1]))
        assert object_report.worst_sigma(cov[0, 0], cov[0, 1], cov[1, 1]) == pytest.approx(worst, rel=1e-12)
        lines = random_lines(rng, memory, 4)
        long = [k for k, line in lines.items() if line.echoes > 10 and line.high - line.low > 2 * FT]
        assert [wall["normal_x"] for wall in object_report.known_walls(memory)] == [
            line_rows(memory)[k, 0] for k in long
        ]
        for k, line in lines.items():
            seen, length = object_report.wall_object(tuple(line_rows(memory)[k].tolist())), line.high - line.low
            middle = line.origin + line.c * line.normal + 0.5 * (line.low + line.high) * line.along
            assert (seen.x, seen.y) == pytest.approx(middle, abs=1e-12)
            assert unit(seen.theta) == pytest.approx(line.along, abs=1e-12)
            lever = np.array([0.5 * (line.low + line.high), 1.0])
            across = float(line.cov[1, 1] + lever[0] ** 2 * line.cov[0, 0])
            assert seen.sigma == pytest.approx(math.sqrt(max(across, length**2 / 12)), rel=1e-9)
            assert walls.is_wall(memory.s[0].lines[k]) == (k in long)
        random_track(rng, memory, 0)
        memory.circles["radius"][0] = radius = float(rng.choice([0.0, 0.1, 0.6]))
        place = place_of(memory, 0)
        by_wall = any(
            abs(lines[k].off(place)) < FT and lines[k].low - FT < lines[k].foot(place) < lines[k].high + FT
            for k in long
        )  # fmt: skip
        corner = "inside corner" if by_wall else "edge"
        assert object_report.rival_label(memory, 0) == {0.0: corner, 0.1: "post", 0.6: "barrel"}[radius]
        corners += by_wall
    assert corners > 50
