"""Contact of polygons against its oracle, and the search for a pose on readings whose pose is known."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from config.load import load_model, load_settings
from perception.bayes.kernel_settings import make_settings
from perception.bayes.likelihood import level_of, log_likelihood
from perception.bayes.object_report import polygon_covariance
from perception.bayes.polygon_likelihood import NO_ANSWER_M, begin_search, continue_search, predict, score_polygon
from perception.bayes.polygon_parameters import LATTICE_ATTEMPTS, LATTICE_CORRELATION_SHARE, LATTICE_PITCH
from perception.bayes.polygon_posterior import (
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
from perception.bayes.range_fit import FAR
from perception.bayes.scratch import Score
from perception.bayes.settings_record import PolygonSide
from perception.bayes.state import Memory, PoseSearch
from perception.kernel import Floats
from perception.records import Records, records, zeros
from tests import naive_polygon
from tests.naive_polygon import Rule
from tests.perception.tracks import numbers, readings_of

SETTINGS = load_settings("hallway", models=("semicircle", "box"))
P = make_settings(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)
S = P[0]
MAY, IN, HALF = math.acos(S.cos_may_answer), math.acos(S.cos_must_answer), S.half_angle_rad
NOISE_M = 0.03 * 0.3048
BOXES = 300
CLOSED = True
BOX = np.array(load_model("box").vertices_m)
SIDES = S.polygons[0].sides[: S.polygons[0].side_count]
LEVEL = 9
"""The noise that is assumed: σ = 0.03 ft, 0.5 %."""


def sides_between(outline: Floats, closed: bool) -> Records[PolygonSide]:
    along = np.roll(outline, -1, axis=0) - outline
    length = np.hypot(along[:, 0], along[:, 1])
    sides: Floats = np.column_stack([outline, along / length[:, None], length])
    array = zeros(PolygonSide, len(outline) - (not closed))
    numbers(array)[...] = sides[: len(array)]
    return records(PolygonSide, array)


def random_outline(rng: np.random.Generator) -> Floats:
    """A star-shaped outline, counterclockwise, 0.1 to 0.6 m about the origin."""
    n = int(rng.integers(3, 9))
    angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, n)) + np.arange(n) * 1e-3
    outline: Floats = rng.uniform(0.1, 0.6, n)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return outline


def rules(sensor: complex, axis: complex, pose: Floats, outline: Floats, closed: bool) -> tuple[Rule, Rule]:
    turn = complex(math.cos(pose[2]), math.sin(pose[2]))
    return naive_polygon.predict(
        (sensor - complex(pose[0], pose[1])) / turn, axis / turn, [complex(x, y) for x, y in outline], closed=closed,
        may=MAY, must=IN, half=HALF,
    )  # fmt: skip


def heard(rng: np.random.Generator, pose: Floats, n: int, noise_m: float, rule: int = 0) -> Floats:
    """Readings of a box from all sides as a mirror (0) or a cone (1) sends them back, rounded; else far silence."""
    rows: list[tuple[float, ...]] = []
    while len(rows) < n:
        bearing, away = rng.uniform(-math.pi, math.pi), rng.uniform(0.8, 2.0)
        sensor = complex(pose[0], pose[1]) + away * complex(math.cos(bearing), math.sin(bearing))
        axis_angle = bearing + math.pi + rng.uniform(-0.5, 0.5)
        axis = complex(math.cos(axis_angle), math.sin(axis_angle))
        actual = rules(sensor, axis, pose, BOX, closed=True)[rule]
        r = FAR * 2.0
        if actual.expected is not None and actual.price == 0.0:
            r = round((actual.expected + rng.normal(0.0, noise_m)) / 0.03048) * 0.03048
        rows.append((sensor.real, sensor.imag, axis.real, axis.imag, r))
    return np.array(rows)


def score(w: Floats, pose: Floats, every: int = 1) -> tuple[float, Score]:
    """Return the evidence of readings at a pose, and all that the score says."""
    said = records(Score, zeros(Score, 1))[0]
    x, y, heading = pose.tolist()
    return score_polygon(readings_of(w), every, x, y, heading, SIDES, CLOSED, P, LEVEL, said), said


def evidence(w: Floats, pose: Floats) -> float:
    return score(w, pose)[0]


def test_a_prediction_equals_its_oracle() -> None:
    rng = np.random.default_rng(1)
    seen = np.zeros(5)
    for _ in range(6_000):
        outline = random_outline(rng)
        closed = bool(rng.integers(2))
        sensor = complex(*rng.uniform(-2.0, 2.0, 2))
        axis_angle = math.atan2(-sensor.imag, -sensor.real) + rng.uniform(-0.6, 0.6)
        axis = complex(math.cos(axis_angle), math.sin(axis_angle))
        mirror, cone = rules(sensor, axis, np.zeros(3), outline, closed)
        at, must, price, at_cone, must_cone = predict(
            sensor.real, sensor.imag, axis.real, axis.imag, sides_between(outline, closed), closed, P
        )  # fmt: skip
        for expected, actual, actual_must in ((mirror, at, must), (cone, at_cone, must_cone)):
            assert actual == pytest.approx(NO_ANSWER_M if expected.expected is None else expected.expected, abs=1e-12)
            assert actual_must == expected.must
        assert price == pytest.approx(mirror.price, abs=1e-9)
        differ = cone.expected is not None and cone.expected != mirror.expected
        seen += (mirror.must, cone.must and not mirror.must, mirror.price > 0.0, differ, cone.expected is None)
    assert seen.min() > 300


def test_a_score_equals_its_oracle() -> None:
    """On readings of boxes, some of them late, early or lost, at poses a little off."""
    rng = np.random.default_rng(2)
    seen = np.zeros(4)
    for k in range(400):
        truth = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi)])
        w = heard(rng, truth, 30, 0.01, k % 2)
        w[rng.uniform(size=30) < 0.3, 4] *= rng.uniform(0.9, 1.8)
        pose = truth + rng.normal(0.0, 0.01, 3)
        readings = []
        for x, y, ux, uy, r in w:
            mirror, cone = rules(complex(x, y), complex(ux, uy), pose, BOX, closed=True)
            level = level_of(P, LEVEL, r)
            nats = [
                0.0 if actual.expected is None else log_likelihood(P, level, r - actual.expected)
                for actual in (mirror, cone)
            ]
            readings.append((r, (mirror, cone), (nats[0], nats[1])))
        expected, sums = naive_polygon.score(readings, S.gate_m, S.missed_echo_nat, S.short_echo_nat)
        found, said = score(w, pose)
        assert found == pytest.approx(expected, abs=1e-9)
        assert said.log_likelihood_ratio == found
        likelier = max(sums, key=lambda s: s["llr"])
        counts = (likelier["hits"], likelier["throughs"], likelier["near"], likelier["sure"])
        assert (said.hits, said.misses, said.near, said.sure_hits) == counts
        seen += counts
    assert seen.min() > 150


def test_the_truth_is_worth_more_than_a_pose_beside_it() -> None:
    rng = np.random.default_rng(3)
    for k in range(200):
        truth = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi)])
        w = heard(rng, truth, 60, 0.0, k % 2)
        if np.count_nonzero(w[:, 4] < FAR) < 5:
            continue
        direction = rng.uniform(-math.pi, math.pi)
        beside = truth + 0.1 * np.array([math.cos(direction), math.sin(direction), 0.0])
        assert evidence(w, truth) > evidence(w, beside)


@pytest.mark.compiled
def test_a_search_never_loses_and_finds_the_pose_however_often_it_is_interrupted() -> None:
    """From 3 cm and 3° beside it, to a third of the ranges' step; the rounding leaves a plateau of that width."""
    rng = np.random.default_rng(4)
    offs = []
    for _ in range(150):
        truth = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi)])
        w = heard(rng, truth, 80, 0.0)
        start = truth + np.array([*rng.normal(0.0, 0.03, 2), rng.normal(0.0, 0.05)])
        found = []
        for allowed in (1_000, int(rng.integers(1, 10))):
            search, said = records(PoseSearch, zeros(PoseSearch, 1))[0], records(Score, zeros(Score, 1))[0]
            scored = calls = 0
            begin_search(search, float(start[0]), float(start[1]), float(start[2]), 0.05, 40)
            while search.rounds_left > 0:
                once = continue_search(search, allowed, readings_of(w), 1, SIDES, CLOSED, P, LEVEL, said)
                assert 0 < once <= allowed
                scored, calls = scored + once, calls + 1
            assert scored <= 1 + 6 * 40
            assert calls == math.ceil(scored / allowed)
            found.append((search.x, search.y, search.heading, search.log_likelihood_ratio, search.step_m, scored))
        assert found[0] == found[1]
        pose, after = np.array([search.x, search.y, search.heading]), search.log_likelihood_ratio
        assert after >= evidence(w, start)
        assert after == pytest.approx(evidence(w, pose), abs=1e-9)
        offs.append((math.hypot(pose[0] - truth[0], pose[1] - truth[1]), abs(pose[2] - truth[2])))
    assert np.median([d for d, _ in offs]) < 0.01
    assert np.quantile([d for d, _ in offs], 0.9) < 0.03
    assert np.median([a for _, a in offs]) < math.radians(2.0)


def test_every_other_reading_is_every_other_reading() -> None:
    rng = np.random.default_rng(8)
    truth = np.array([0.3, -0.2, 0.4])
    w = heard(rng, truth, 41, 0.01)
    for every in (1, 2, 3, 50):
        actual, wanted = score(w, truth, every), score(np.ascontiguousarray(w[::every]), truth)
        assert actual[0] == wanted[0]
        for name in ("log_likelihood_ratio", "hits", "misses", "near", "sure_hits"):
            assert getattr(actual[1], name) == getattr(wanted[1], name)


def test_the_moments_of_a_lattice_equal_numpys() -> None:
    rng = np.random.default_rng(5)
    ball = [z for z in itertools.product(range(-3, 4), repeat=3) if z[0] ** 2 + z[1] ** 2 + z[2] ** 2 <= 6]
    assert LATTICE.tolist() == [list(z) for z in ball]
    normal = np.exp(-0.5 * LATTICE_PITCH**2 * np.sum(np.square(ball), axis=1))
    assert pytest.approx(LATTICE_PITCH**2 * np.average(LATTICE[:, 0] ** 2, weights=normal)) == CUT_OFF
    memory = Memory(24)
    job, state = memory.s[0].job, memory.state["job"]
    covariance_of, root_of = numbers(state["covariance"])[0], numbers(state["root"])[0]
    for _ in range(10):
        truth = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi)])
        w = heard(rng, truth, 40, 0.01)
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


def enter_job(memory: Memory, w: Floats, noise: int) -> None:
    """Give the job readings and a noise."""
    numbers(memory.state["job_readings"][0])[: len(w)] = w
    memory.s[0].job.reading_count, memory.s[0].job.noise_level = len(w), noise


def spread_of(memory: Memory, w: Floats, pose: Floats, left: int, noise: int = LEVEL) -> tuple[Floats, Floats]:
    """Mean and covariance, worked out `left` at a time."""
    enter_job(memory, w, noise)
    memory.polygons.view(np.uint8)[...] = 0
    track, job = memory.s[0].polygons[0], memory.s[0].job
    track.x, track.y, track.heading = pose.tolist()
    begin_lattice(memory.s, P, 0, 0)
    while job.lattices < LATTICE_ATTEMPTS:
        advance_lattice(memory.s, P, 0, left)
    copy_triangle(job.covariance, track.covariance)
    return np.array([job.middle.x, job.middle.y, job.middle.heading]), polygon_covariance(track)


@pytest.mark.compiled
@pytest.mark.parametrize("rule", [0, 1], ids=["mirror", "cone"])
def test_the_covariance_is_honest(rule: int) -> None:
    """95 % of true poses lie in the 95 % ellipse, of the place and of the whole pose, on noisy boxes.

    Or a little more: what is reported allows for neighbours, and here are none.
    """
    rng = np.random.default_rng(6)
    memory = Memory(24)
    noise = [(it.absolute_m, it.relative) for it in S.noises].index((NOISE_M, 0.0))
    place, whole = [], []
    for _ in range(BOXES):
        truth = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi)])
        w = heard(rng, truth, 120, NOISE_M, rule)
        w[rng.uniform(size=120) < 0.05, 4] = 2.0 * FAR
        stray = rng.uniform(size=120) < 0.01
        w[stray, 4] = rng.uniform(0.2, 4.5, int(stray.sum()))
        pose = truth + np.array([*rng.normal(0.0, 0.01, 2), rng.normal(0.0, 0.02)])
        search, said = records(PoseSearch, zeros(PoseSearch, 1))[0], records(Score, zeros(Score, 1))[0]
        begin_search(search, float(pose[0]), float(pose[1]), float(pose[2]), 0.03, 20)
        continue_search(search, 1_000, readings_of(w), 1, SIDES, CLOSED, P, noise, said)
        mean, c = spread_of(memory, w, np.array([search.x, search.y, search.heading]), 1_000_000, noise)
        assert np.linalg.eigvalsh(c).min() > 0.0
        e = mean - truth
        place.append(e[:2] @ np.linalg.solve(c[:2, :2], e[:2]) < 5.991)
        whole.append(e @ np.linalg.solve(c, e) < 7.815)
    assert 0.92 <= np.mean(place) <= 0.99
    assert 0.92 <= np.mean(whole) <= 0.99


def test_a_lattice_is_the_same_however_often_it_is_interrupted() -> None:
    rng = np.random.default_rng(7)
    memory = Memory(24)
    for left in (1, 3_000, 20_000):
        w = heard(rng, np.zeros(3), 60, NOISE_M)
        whole, interrupted = (spread_of(memory, w, np.zeros(3), many) for many in (10_000_000, left))
        assert np.array_equal(whole[0], interrupted[0])
        assert np.array_equal(whole[1], interrupted[1])
