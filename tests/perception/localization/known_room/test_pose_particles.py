"""Particles of headings with Gaussian places: moves against Monte Carlo; which hypotheses and headings are kept."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from perception.localization.known_room.pose_particles import (
    HEADINGS,
    HYPOTHESES_MAX,
    SHARE_TEMPER,
    Hypotheses,
    HypothesesRecord,
    ParticleScratch,
    add_hypothesis,
    conclude,
    move,
    prune,
    resample,
    summarise,
)
from perception.records import array_of, records, zeros

SCRATCH = records(ParticleScratch, zeros(ParticleScratch, 1))
FIELDS = ("x", "y", "scale")


def hypotheses_at(*poses: tuple[float, float, float], half: float = math.radians(4.0)) -> HypothesesRecord:
    """Hypotheses at these poses."""
    found = records(Hypotheses, zeros(Hypotheses, 1))
    for pose in poses:
        add_hypothesis(found, *pose, 0.1, half)
    return found


def particles(of: HypothesesRecord, h: int = 0) -> Any:
    """The particles of a hypothesis as an array."""
    return array_of(of)["hypotheses"][0, h]["particles"]


def xs(of: HypothesesRecord) -> list[float]:
    """The first particle's x of each hypothesis."""
    return [float(particles(of, h)["x"][0]) for h in range(of[0].count)]


def covariance_of(particle: Any) -> np.ndarray:
    """The covariance of place and scale."""
    xx, xy, x_s, yy, y_s, ss = (particle[name] for name in ("xx", "xy", "xs", "yy", "ys", "ss"))
    return np.array([[xx, xy, x_s], [xy, yy, y_s], [x_s, y_s, ss]])


@pytest.mark.covered
def test_a_move_carries_place_and_scale_as_monte_carlo_does() -> None:
    found = hypotheses_at((1.0, 2.0, 0.5), half=0.0)
    rng = np.random.default_rng(0)
    one = particles(found)[0]
    draws = rng.multivariate_normal([one[name] for name in FIELDS], covariance_of(one), 200_000)
    for forward, left in ((1.0, 0.2), (0.4, -0.3)):
        heading = float(one["heading"])
        move(found, forward, left, 0.0, rng.standard_normal(HEADINGS))
        along = heading + 0.5 * (one["heading"] - heading)
        c, s = math.cos(along), math.sin(along)
        draws[:, :2] += draws[:, 2:] * (c * forward - s * left, s * forward + c * left)
    assert [one[name] for name in FIELDS] == pytest.approx(draws.mean(axis=0), abs=1e-3)
    assert covariance_of(one) == pytest.approx(np.cov(draws.T), abs=2e-3)


def test_a_turn_turns_the_headings_within_its_error() -> None:
    found = hypotheses_at((0.0, 0.0, 0.0), (4.0, 1.0, 1.0), half=0.0)
    move(found, 0.0, 0.0, 1.0, np.random.default_rng(0).standard_normal(HEADINGS))
    heading = particles(found)["heading"]
    assert heading.mean() == pytest.approx(1.0, abs=0.03)
    assert 0.01 < heading.std() < 0.06
    assert particles(found, 1)["heading"] == pytest.approx(heading + 1.0)
    assert xs(found) == [0.0, 4.0]


def test_resampling_keeps_the_weight_and_the_likely_headings() -> None:
    found = hypotheses_at((0.0, 0.0, 0.0), (5.0, 0.0, 0.0))
    particles(found)["log_weight"] -= 50.0
    particles(found)["log_weight"][3] += 50.0
    heading = float(particles(found)["heading"][3])
    summarise(found, SCRATCH)
    before = [found[0].hypotheses[h].log_evidence for h in range(2)]
    resample(found, SCRATCH)
    summarise(found, SCRATCH)
    assert [found[0].hypotheses[h].log_evidence for h in range(2)] == pytest.approx(before)
    assert particles(found)["heading"] == pytest.approx(np.full(HEADINGS, heading))
    assert np.ptp(particles(found, 1)["heading"]) > 0.0  # its weight lies on all


def test_pruning_keeps_the_better_of_two_that_are_one() -> None:
    found = hypotheses_at((0.0, 0.0, 0.0), (0.1, 0.0, 0.05), (3.0, 0.0, 0.0), (9.0, 0.0, 0.0))
    for h, log_weight in enumerate((0.0, 1.0, 0.5, -30.0)):
        particles(found, h)["log_weight"] += log_weight
    assert summarise(found, SCRATCH) == 1
    prune(found, 12.0, 5, SCRATCH)
    assert xs(found) == pytest.approx([0.1, 3.0])
    assert not particles(found, 2).view(np.uint8).any()
    prune(found, 12.0, 1, SCRATCH)
    assert xs(found) == pytest.approx([0.1])


def test_the_conclusion_is_the_mixture_of_the_best_hypothesis() -> None:
    found = hypotheses_at((1.0, 2.0, 0.5), (7.0, 0.0, 0.0))
    rng = np.random.default_rng(1)
    one = particles(found)
    for name in ("x", "y", "log_ratio", "specular"):
        one[name] += rng.normal(0.0, 0.01, HEADINGS)
    one["log_weight"] += math.log(3.0) + rng.normal(0.0, 0.1, HEADINGS)
    evidence = [np.logaddexp.reduce(particles(found, h)["log_weight"]) for h in range(2)]
    weight = np.exp(one["log_weight"] - evidence[0])
    rows = np.column_stack([one["x"], one["y"], one["heading"]])
    log_ratio = float(weight @ one["log_ratio"])
    conclude(found, 12.0, 40, SCRATCH)
    best = found[0].best
    assert best.share == pytest.approx(1.0 / (1.0 + math.exp(SHARE_TEMPER * (evidence[1] - evidence[0]))))
    assert (best.x, best.y, best.heading) == pytest.approx(weight @ rows)
    expected = np.cov(rows.T, aweights=weight, ddof=0) + np.diag([0.01, 0.01, 0.0])
    found_covariance = [[best.xx, best.xy, best.xh], [best.xy, best.yy, best.yh], [best.xh, best.yh, best.hh]]
    assert np.array(found_covariance) == pytest.approx(expected)
    assert best.log_ratio == pytest.approx(log_ratio)


def test_there_is_room_for_so_many_hypotheses() -> None:
    found = hypotheses_at(*((float(k), 0.0, 0.0) for k in range(HYPOTHESES_MAX + 3)))
    assert found[0].count == HYPOTHESES_MAX
