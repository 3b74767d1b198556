"""How rough a ring is, against its oracle on random cases."""

from __future__ import annotations

import numpy as np
import pytest

from perception.bayes import noise_estimation as noise_choice
from perception.bayes.range_fit import FAR
from perception.bayes.state import (
    ESTABLISHED,
    HITS,
    KIND,
    NOISE,
    PROB,
    REFS,
    ST,
    TRHO,
    TX,
    TY,
)  # fmt: skip
from tests import naive_tracks
from tests.perception.tracks import (
    TRACKS,
    P,
    around,
    noises,
    random_track,
    shared,
)


def test_roughness_is_heard_as_its_oracle_says() -> None:
    rng, heard_some = np.random.default_rng(7), 0
    for _ in range(3000):
        q = np.zeros((3, 6))
        q[:, :2] = np.cumsum(rng.uniform(-0.15, 0.15, (3, 2)), axis=0) * (rng.random() > 0.02)
        q[:, 4] = np.where(rng.random(3) < 0.05, 2 * FAR, rng.uniform(0.2, 3) + rng.normal(0, 0.05, 3))
        q[:, 5] = rng.uniform(0, 40, 3)
        heard = rng.normal(0, 10, len(P.noises))
        q[0, 4] = min(q[0, 4], 5.0)  # whoever calls has heard the newest
        want = naive_tracks.roughness(q[0], q[1], q[2], 40.0, P.gap, P.half_box, P.noises, heard)
        heard_some += want is not heard
        noise_choice.roughness(q[0], q[1], q[2], 40.0, P.gap, P.half_box, P.noises, heard)
        assert heard == pytest.approx(want, rel=1e-12, abs=1e-12)
    assert heard_some > 1000


def test_residuals_are_heard_and_the_noise_is_chosen_within_the_gate() -> None:
    rng, s, chosen = np.random.default_rng(8), shared(), set()
    for turn in range(1500):
        s.ddl[...] = rng.normal(0, 15, len(s.ddl))
        s.ntot[...] = rng.normal(0, 40, len(s.ddl))
        noise_choice.choose_noise(s, P)
        assert s.g[NOISE] == naive_tracks.likeliest_noise(s.ddl, s.ntot, P.rough_gate)
        chosen.add(int(s.g[NOISE]))
        if turn % 10:
            continue
        s.nll[...] = rng.normal(0, 9, s.nll.shape)
        for t in range(TRACKS):
            random_track(rng, s, t)
        t, n = int(rng.integers(TRACKS)), 30
        s.ti[t, [ST, KIND, REFS]] = ESTABLISHED, 0, rng.integers(6)
        s.tf[t, PROB], s.tf[t, HITS] = rng.choice([0.9, 0.99]), rng.choice([20.0, 26.0])
        s.w[:n] = around(rng, n, s.tf[t, [TX, TY]], float(s.tf[t, TRHO]))
        want, total = s.nll.copy(), s.ntot.copy()
        if s.ti[t, REFS] % 3 == 0:
            sure = s.tf[t, PROB] >= 0.95 and s.tf[t, HITS] >= 25
            want[t] = 0.0
            if sure:
                want[t] = naive_tracks.residual_evidence(
                    s.w[:n], s.tf[t, [TX, TY]], float(s.tf[t, TRHO]), P.cos_half, P.gate, noises()
                )  # fmt: skip
                total = want[s.ti[:, ST] == ESTABLISHED].sum(0)
        noise_choice.hear_residuals(s, P, t, n)
        assert s.nll == pytest.approx(want, rel=1e-12, abs=1e-11)
        assert s.ntot == pytest.approx(total, rel=1e-12, abs=1e-11)
    assert len(chosen) == len(P.noises)
