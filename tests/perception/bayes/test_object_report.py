"""What is reported, against its oracle on random cases: what is sure, how well placed, and what a rival is called."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes import object_report as report
from perception.bayes import walls
from perception.bayes.state import (
    C00,
    C11,
    CALLED,
    CONFIRMED,
    ESTABLISHED,
    FREE,
    KIND,
    LLR,
    MARK,
    PCAP,
    PHITS,
    PLACED,
    PPROB,
    PROB,
    PT,
    PXX,
    PYY,
    SPAN,
    ST,
    TENTATIVE,
    TRHO,
    TX,
    TY,
    UNK,
)  # fmt: skip
from tests import naive_tracks
from tests.naive_tracks import FT
from tests.perception.tracks import (
    TRACKS,
    P,
    around,
    random_lines,
    random_track,
    shared,
    unit,
)


def test_what_is_sure_is_reported() -> None:
    rng, s, out, sure = np.random.default_rng(16), shared(), np.zeros(max(PT, TRACKS), np.int64), 0
    for _ in range(2000):
        for t in range(TRACKS):
            random_track(rng, s, t)
        s.ti[:, KIND] = rng.integers(0, 2, TRACKS)
        s.tf[:, PROB] = rng.uniform(0.4, 1, TRACKS)
        s.tf[:, UNK] = s.tf[:, LLR] / rng.uniform(1, 1.4, TRACKS)
        s.tf[:, [C00, C11]] = rng.uniform(0, 0.07, (TRACKS, 2)) ** 2
        s.comp[...] = rng.uniform(-60, -15, s.comp.shape)
        s.comp[:, -2] = rng.choice([0.0, -3.9, -4.1, -30.0], TRACKS)
        s.tf[:, SPAN] = rng.uniform(0.004, 0.03, TRACKS)
        s.ti[:, CALLED] = rng.integers(0, 2, TRACKS)
        want = [
            t for t in range(TRACKS)
            if naive_tracks.is_called(
                s.ti[t, CALLED] == 1, s.ti[t, ST] == ESTABLISHED, s.ti[t, KIND] < P.models, s.tf[t, PROB], 0.92, 0.7,
                np.delete(s.comp[t], s.ti[t, KIND]).tolist(), s.comp[t, -2], s.tf[t, SPAN], s.tf[t, LLR],
                s.tf[t, UNK],
                s.tf[t, [C00, C11]].tolist(),
            )
        ]  # fmt: skip
        for t in range(TRACKS):
            report.call_or_not(s.ti, s.tf, s.comp, P.models, 0.92, 0.7, t)
        s.names[:TRACKS, MARK] = 0
        n = report.sure_circles(s.ti, s.names, out)
        assert out[:n].tolist() == want
        sure += n
        s.names[:TRACKS, MARK] = rng.choice([0, CONFIRMED, PLACED], TRACKS)
        said = [t for t in range(TRACKS) if s.ti[t, ST] != FREE and s.names[t, MARK] > 0]
        assert out[: report.sure_circles(s.ti, s.names, out)].tolist() == sorted({*want, *said})
    assert sure > 200


def test_polygons_are_sure_when_seen_from_near_and_from_two_sides() -> None:
    rng, s, out, sure = np.random.default_rng(17), shared(), np.zeros(PT, np.int64), 0
    for _ in range(200):
        s.pbn[...] = 0
        kept = []
        for t in range(PT):
            s.pi[t, ST] = rng.choice([TENTATIVE, ESTABLISHED])
            s.pf[t, PPROB], s.pf[t, PHITS] = rng.uniform(0.85, 1), rng.uniform(10, 40)
            s.pf[t, PXX], s.pf[t, PYY] = rng.uniform(0, 0.005, 2)
            w = around(rng, int(rng.integers(0, 120)), np.zeros(2), 0.2)
            w[:, 4] += rng.choice([0.0, 1.8])
            w[:, 2:4] = unit(rng.uniform(0, 7) + rng.normal(0, rng.uniform(0, 0.5), len(w)))
            for i, q in enumerate(w):
                s.pbins[t, i % 10, s.pbn[t, i % 10] % PCAP] = q
                s.pbn[t, i % 10] += 1
            kept.append(w)
        want = [
            t for t in range(PT)
            if naive_tracks.is_sure_polygon(
                s.pi[t, ST] == ESTABLISHED, s.pf[t, PPROB], 0.9, s.pf[t, PHITS], s.pf[t, [PXX, PYY]].tolist(), kept[t]
            )
        ]  # fmt: skip
        s.names[:] = 0
        n = report.sure_polygons(s.pi, s.pf, s.pbn, s.pbins, s.names, TRACKS, 0.9, out)
        assert out[:n].tolist() == want
        sure += n
        s.names[TRACKS + 5, MARK] = CONFIRMED
        n = report.sure_polygons(s.pi, s.pf, s.pbn, s.pbins, s.names, TRACKS, 0.9, out)
        assert out[:n].tolist() == sorted({*want, 5})
    assert sure > 200


def test_a_covariances_worst_axis_and_the_names_of_rivals() -> None:
    rng, s, corners = np.random.default_rng(18), shared(), 0
    for _ in range(1000):
        root = rng.normal(0, 1, (2, 2))
        cov = root @ root.T
        worst = math.sqrt(float(np.linalg.eigvalsh(cov)[1]))
        assert report.worst_sigma(cov[0, 0], cov[0, 1], cov[1, 1]) == pytest.approx(worst, rel=1e-12)
        lines = random_lines(rng, s, 4)
        for k, line in lines.items():
            seen, length = report.wall(s.lines[k]), line.high - line.low
            middle = line.origin + line.c * line.normal + 0.5 * (line.low + line.high) * line.along
            assert (seen.x, seen.y) == pytest.approx(middle, abs=1e-12)
            assert unit(seen.theta) == pytest.approx(line.along, abs=1e-12)
            lever = np.array([0.5 * (line.low + line.high), 1.0])
            across = float(line.cov[1, 1] + lever[0] ** 2 * line.cov[0, 0])
            assert seen.sigma == pytest.approx(math.sqrt(max(across, length**2 / 12)), rel=1e-9)
            assert walls.is_wall(s.lines[k]) == (line.echoes > 10 and length > 2 * FT)
        random_track(rng, s, 0)
        s.tf[0, TRHO] = rng.choice([0.0, 0.1, 0.6])
        by_wall = any(
            line.echoes > 10 and line.high - line.low > 2 * FT and abs(line.off(s.tf[0, [TX, TY]])) < FT
            and line.low - FT < line.foot(s.tf[0, [TX, TY]]) < line.high + FT
            for line in lines.values()
        )  # fmt: skip
        corner = "inside corner" if by_wall else "edge"
        assert report.rival_label(s, 0) == {0.0: corner, 0.1: "post", 0.6: "barrel"}[float(s.tf[0, TRHO])]
        corners += by_wall
    assert corners > 50
