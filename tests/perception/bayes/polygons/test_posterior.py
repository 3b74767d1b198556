"""Mean and covariance of a polygon's pose against numpy, and the covariance against true errors."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from perception.bayes.memory.job_records import PoseSearch
from perception.bayes.memory.polygon_parameters import LATTICE_ATTEMPTS, LATTICE_CORRELATION_SHARE, LATTICE_PITCH
from perception.bayes.memory.scratch import Score
from perception.bayes.memory.state import Memory
from perception.bayes.polygons.likelihood import begin_search, continue_search
from perception.bayes.polygons.posterior import (
    CUT_OFF,
    LATTICE,
    THINNEST,
    advance_lattice,
    begin_lattice,
    centre_moments,
    copy_triangle,
    leave_frame,
    score_lattice,
    write_pitch,
)
from perception.bayes.reports.object_report import polygon_covariance
from perception.kernel import Floats
from perception.records import records, zeros
from perception.shared_numbers import FAR
from tests.perception.bayes.box_readings import (
    CLOSED,
    LEVEL,
    NOISE_M,
    SIDES,
    P,
    S,
    enter_job,
    evidence,
    heard,
    random_pose,
)
from tests.perception.bayes.random_tracks import numbers, readings_of


def test_the_moments_of_a_lattice_equal_numpys() -> None:
    rng = np.random.default_rng(5)
    ball = [z for z in itertools.product(range(-3, 4), repeat=3) if z[0] ** 2 + z[1] ** 2 + z[2] ** 2 <= 6]
    assert LATTICE.tolist() == [list(z) for z in ball]
    normal = np.exp(-0.5 * LATTICE_PITCH**2 * np.sum(np.square(ball), axis=1))
    assert pytest.approx(LATTICE_PITCH**2 * np.average(LATTICE[:, 0] ** 2, weights=normal)) == CUT_OFF
    memory = Memory(24, 1)
    job, state = memory.s[0].job, memory.state["job"]
    covariance_of, root_of = numbers(state["covariance"])[0], numbers(state["root"])[0]
    for _ in range(2):
        truth = random_pose(rng)
        w = heard(rng, truth, 25, 0.01)
        pose = truth + rng.normal(0.0, 0.002, 3)
        lower = np.tril(rng.normal(0.0, 0.001, (3, 3)) + np.diag([0.004, 0.004, 0.01]))
        covariance = lower @ lower.T
        enter_job(memory, w, LEVEL)
        covariance_of[...] = covariance[np.tril_indices(3)]
        write_pitch(job.covariance, job.root)
        assert root_of == pytest.approx(LATTICE_PITCH * np.linalg.cholesky(covariance)[np.tril_indices(3)], abs=1e-12)
        numbers(state["middle"])[0], job.middle_nat = pose, evidence(w, pose)
        state["moments"].view(np.uint8)[...] = 0
        half = int(rng.integers(0, len(ball)))
        for begin, end in ((0, half), (half, len(ball))):
            score_lattice(memory.s, P, 0, begin, end)
        centre_moments(job.moments)
        lower = np.zeros((3, 3))
        lower[np.tril_indices(3)] = root_of
        points = np.array(ball, dtype=np.float64)
        weights = np.exp([min(40.0, evidence(w, pose + lower @ z) - job.middle_nat) for z in points])
        mean = np.average(points, axis=0, weights=weights)
        spread = np.cov(points.T, aweights=weights, ddof=0)
        moments = numbers(state["moments"])[0, 1:]
        assert moments == pytest.approx([*mean, *spread[np.tril_indices(3)]], abs=1e-9)
        leave_frame(job.middle, job.root, job.moments, job.covariance)
        assert numbers(state["middle"])[0] == pytest.approx(pose + lower @ mean, abs=1e-12)
        shrunk = LATTICE_CORRELATION_SHARE * spread + (1.0 - LATTICE_CORRELATION_SHARE) * np.diag(np.diag(spread))
        np.fill_diagonal(shrunk, np.maximum(np.diag(spread), THINNEST))
        assert covariance_of == pytest.approx((lower @ shrunk @ lower.T / CUT_OFF)[np.tril_indices(3)], abs=1e-15)


def spread_of(memory: Memory, w: Floats, pose: Floats, left: int, noise: int = LEVEL) -> tuple[Floats, Floats]:
    """Return mean and covariance, computed in steps of `left`."""
    enter_job(memory, w, noise)
    memory.polygons.view(np.uint8)[...] = 0
    track, job = memory.s[0].polygons[0], memory.s[0].job
    job.best.x, job.best.y, job.best.heading = pose.tolist()
    begin_lattice(memory.s, P, 0, 0)
    while job.lattices < LATTICE_ATTEMPTS:
        advance_lattice(memory.s, P, 0, left)
    copy_triangle(job.covariance, track.covariance)
    return np.array([job.middle.x, job.middle.y, job.middle.heading]), polygon_covariance(track)


@pytest.mark.compiled
@pytest.mark.soak
@pytest.mark.parametrize("examples", [100, 300])
@pytest.mark.parametrize("rule", [0, 1], ids=["mirror", "cone"])
def test_the_covariance_is_honest(rule: int, examples: int) -> None:
    """The 95 % ellipses of position and pose hold 95 % of the true poses of noisy boxes, or a little more.

    The reported covariance allows for neighbours, and here are none. With few boxes, three binomial standard
    deviations are added to the limits of the long form.
    """
    rng = np.random.default_rng(6)
    memory = Memory(24, 1)
    noise = [(it.absolute_m, it.relative) for it in S.noises].index((NOISE_M, 0.0))
    place, whole = [], []
    for _ in range(examples):
        truth = random_pose(rng)
        w = heard(rng, truth, 120, NOISE_M, rule)
        w[rng.uniform(size=120) < 0.05, 4] = 2.0 * FAR
        stray = rng.uniform(size=120) < 0.01
        w[stray, 4] = rng.uniform(0.2, 4.5, int(stray.sum()))
        pose = truth + np.array([*rng.normal(0.0, 0.01, 2), rng.normal(0.0, 0.02)])
        search, result = records(PoseSearch, zeros(PoseSearch, 1))[0], records(Score, zeros(Score, 1))[0]
        begin_search(search, float(pose[0]), float(pose[1]), float(pose[2]), 0.03, 20)
        continue_search(search, 1_000, readings_of(w), 1, SIDES, CLOSED, P, noise, result)
        mean, c = spread_of(memory, w, np.array([search.x, search.y, search.heading]), 1_000_000, noise)
        assert np.linalg.eigvalsh(c).min() > 0.0
        e = mean - truth
        place.append(e[:2] @ np.linalg.solve(c[:2, :2], e[:2]) < 5.991)
        whole.append(e @ np.linalg.solve(c, e) < 7.815)
    slack = 3.0 * math.sqrt(0.95 * 0.05 / examples) if examples < 300 else 0.0
    assert 0.92 - slack <= np.mean(place) <= 0.99 + slack
    assert 0.92 - slack <= np.mean(whole) <= 0.99 + slack


def test_a_lattice_is_the_same_however_often_it_is_interrupted() -> None:
    rng = np.random.default_rng(7)
    memory = Memory(24, 1)
    w = heard(rng, np.zeros(3), 8, NOISE_M, 1)
    whole = spread_of(memory, w, np.zeros(3), 10_000_000)
    for left in (1, 1_000):
        interrupted = spread_of(memory, w, np.zeros(3), left)
        assert np.array_equal(whole[0], interrupted[0])
        assert np.array_equal(whole[1], interrupted[1])
