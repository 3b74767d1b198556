"""Cross paths: what a circle, a line and a polygon predict for them, and what they add to scores, fits, posteriors.

The oracles minimise the way over the surface by search (`tests.naive_acoustics`), or mirror the listener.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from perception.bayes.circles import posterior as circle_posterior
from perception.bayes.inference import cross_path, occlusion, placement, range_fit, reservoir
from perception.bayes.memory.elements import CROSS_EVERY, CROSS_HISTORY, CROSSES_MAX, GRID_CELLS
from perception.bayes.memory.scratch import UNEXPLAINED, CircleFit, CirclePosterior, LinearReading, LineFit, Score
from perception.bayes.memory.state import ESTABLISHED
from perception.bayes.tracks import observe
from perception.kernel import Floats
from perception.records import records, zeros
from tests import naive_acoustics, naive_bayes
from tests.perception.bayes.cross_cases import RING_M, STEP, P, crosses, stand
from tests.perception.bayes.random_tracks import MOUNTS, examples, new_memory, numbers, predictions
from tests.perception.bayes.range_cases import GATE, HALF, OPT, cases, one


def half_over_circle(t: complex, l: complex, centre: complex, radius: float) -> float:  # noqa: E741
    if radius == 0.0:
        return 0.5 * (abs(t - centre) + abs(l - centre))
    return 0.5 * naive_acoustics.least_over_circle(radius, t - centre, l - centre)[1]


def half_over_line(t: complex, l: complex, normal: complex, distance: float) -> float:  # noqa: E741
    beyond = distance - (l * normal.conjugate()).real
    return 0.5 * abs(l + 2.0 * beyond * normal - t)


@examples(60, 2000)
def test_half_the_way_over_a_circle_is_exact_to_a_tenth_of_a_micrometre(examples: int) -> None:
    rng = np.random.default_rng(1)
    for _ in range(examples):
        t, l, towards, gap = stand(rng, (0.1, 3.0))  # noqa: E741
        radius = float(rng.choice([0.0, 0.03, 0.1067, 0.3048, 0.67]))
        centre = 0.5 * (t + l) + (gap + radius) * towards
        if min(abs(t - centre), abs(l - centre)) < radius + 0.08:
            continue
        to, across = centre - t, l - t
        q = crosses(np.array([[0.0, 0.0, 1.0, 0.0, 1.0, across.real, across.imag]]))[0]
        half, gx, gy = cross_path.over_circle(q, to.real, to.imag, radius)
        assert half == pytest.approx(half_over_circle(t, l, centre, radius), abs=1e-7)
        by_number = [
            (half_over_circle(t, l, centre + d, radius) - half_over_circle(t, l, centre - d, radius)) / 2e-4
            for d in (1e-4, 1e-4j)
        ]
        assert [gx, gy] == pytest.approx(by_number, abs=1e-3)  # of first order in what a step leaves
        assert cross_path.circle_error(q, to.real, to.imag, abs(to), radius) == pytest.approx(1.0 - half, abs=1e-12)


@examples(300, 20000)
def test_no_cross_path_within_the_gate_is_taken_for_a_far_one(examples: int) -> None:
    rng, gate, within, far = np.random.default_rng(20), 0.05, 0, 0
    for _ in range(examples):
        t, l, towards, gap = stand(rng, (0.1, 3.0))  # noqa: E741
        radius = float(rng.choice([0.0, 0.1067, 0.3048, 0.67]))
        to, across = 0.5 * (l - t) + (gap + radius) * towards, l - t
        range_m = abs(to) - radius + rng.uniform(-0.3, 0.3)
        q = crosses(np.array([[0.0, 0.0, 1.0, 0.0, range_m, across.real, across.imag]]))[0]
        is_near = cross_path.is_near_circle(q, abs(to), radius, gate)
        is_within = abs(cross_path.circle_error(q, to.real, to.imag, abs(to), radius)) <= gate
        assert is_near or not is_within
        within, far = within + is_within, far + (not is_near)
    assert within > 0.08 * examples
    assert far > 0.1 * examples


@examples(60, 2000)
def test_half_the_way_over_a_line_is_that_to_the_mirrored_listener(examples: int) -> None:
    rng = np.random.default_rng(2)
    for _ in range(examples):
        t, l, normal, gap = stand(rng)  # noqa: E741
        distance = max((t * normal.conjugate()).real, (l * normal.conjugate()).real) + gap
        across, away = l - t, distance - (t * normal.conjugate()).real
        q = crosses(np.array([[0.0, 0.0, 1.0, 0.0, 1.0, across.real, across.imag]]))[0]
        half, by_own, by_listener = cross_path.over_line(q, normal.real, normal.imag, away)
        assert half == pytest.approx(half_over_line(t, l, normal, distance), abs=1e-12)
        longer = half_over_line(t, l, normal, distance + 1e-6) - half_over_line(t, l, normal, distance - 1e-6)
        assert by_own + by_listener == pytest.approx(longer / 2e-6, abs=1e-6)


def test_an_echo_is_no_cross_path_and_keeps_its_own_prediction() -> None:
    q = crosses(np.array([[0.0, 0.0, 1.0, 0.0, 0.7, 0.0, 0.0]]))[0]
    assert not cross_path.is_crossed(q)
    assert cross_path.circle_error(q, 1.0, 0.0, 1.0, 0.3) == 0.7 - (1.0 - 0.3)
    assert cross_path.over_line(q, 1.0, 0.0, 0.8) == (0.8, 1.0, 0.0)


@examples(20, 400)
def test_cross_paths_add_their_own_evidence_to_a_circles_score(examples: int) -> None:
    rng, total = np.random.default_rng(3), 0.0
    for case in cases(examples, 5):
        n = case.n
        rows = np.zeros((2 * n, 7))
        rows[:n, :5] = rows[n:, :5] = case.used
        rows[n:, 5:] = rng.uniform(-0.3, 0.3, (n, 2))
        want, hits = 0.0, 0
        for row in rows[n:]:
            t, l, centre = complex(*row[:2]), complex(*(row[:2] + row[5:])), complex(*case.centre)  # noqa: E741
            row[4] = half = half_over_circle(t, l, centre, case.rho)
            row[4] += (off := float(rng.choice([0.0, 0.004, 0.03, 0.4]) * rng.choice([-1.0, 1.0])))
            if row[4] <= 0.05 or not math.isfinite(half):
                row[4], off = 5e5, 5e5
            ahead = ((centre - t) / abs(centre - t) * complex(row[2], -row[3])).real
            if abs(off) < GATE and ahead >= OPT:
                v = float(naive_bayes.evidence(case.noise, row[4:5], np.array([off]))[0])
                want += max(v, 0.0) if ahead < HALF else v
                hits += v > 0.0
        own, both, out = one(Score), one(Score), predictions()
        range_fit.score_circle(crosses(rows[:n]), *case.place, case.rho, case.p, case.level, out, own[0][0])
        range_fit.score_circle(crosses(rows), *case.place, case.rho, case.p, case.level, out, both[0][0])
        if own[0][0].misses == 0.0:  # the price of many drop-outs falls with more hits
            assert both[0][0].log_likelihood_ratio - own[0][0].log_likelihood_ratio == pytest.approx(want, abs=1e-4)
        assert both[0][0].hits - own[0][0].hits == hits
        assert both[0][0].misses == own[0][0].misses
        total += hits
    assert total > examples


def one_stand(centre: complex, radius: float, noise_m: float, rng: np.random.Generator) -> Floats:
    """Return rows of what a ring at the origin hears of a circle ahead: two echoes, each with eight cross paths."""
    rows = []
    for j in (0, 1):
        t = RING_M * cmath.exp(1j * STEP * j)
        for i in (0, -4, -3, -2, -1, 1, 2, 3, 4):
            l = t * cmath.exp(1j * STEP * i)  # noqa: E741
            half = half_over_circle(t, l, centre, radius) if i else abs(centre - t) - radius
            axis, across = t / abs(t), l - t
            rows.append([t.real, t.imag, axis.real, axis.imag, half, across.real, across.imag])
    found = np.array(rows)
    found[:, 4] += noise_m * rng.standard_normal(len(found))
    return found


def test_one_stand_gives_the_place_of_a_circle_and_a_line() -> None:
    rng, radius, centre = np.random.default_rng(4), 0.3048, 1.5 + 0.2j
    rows = one_stand(centre, radius, 0.0, rng)
    fit, out = one(CircleFit)
    start = centre * cmath.exp(0.1j)
    args = ((start.real, start.imag, radius), P, 9.0, (1e-6, 0.0), 600)
    assert range_fit.fit_circle(crosses(rows), *args, predictions(), fit[0])
    assert complex(*out[:2]) == pytest.approx(centre, abs=3e-3)  # steps are damped, and end when they are short
    normal = cmath.exp(0.15j)
    for row in rows:
        t = complex(row[0], row[1])
        row[4] = half_over_line(t, t + complex(row[5], row[6]), normal, 1.2)
    line, fields = one(LineFit)
    range_fit.fit_reading_line(
        crosses(rows),
        (1.0, 0.0, 1.21),
        (0.0, 0.0),
        (P[0].cos_may_answer, GATE),
        9.0,
        (1e-6, 0.0),
        40,
        line[0],
    )
    assert fields[:3] == pytest.approx([normal.real, normal.imag, 1.2], abs=1e-4)


def test_the_posterior_with_cross_paths_is_that_of_a_fine_grid() -> None:
    rng, radius, centre, sigma = np.random.default_rng(5), 0.3048, 1.5 + 0.1j, 0.01
    noise = int(np.argmin([abs(n.absolute_m - sigma) + n.relative for n in P[0].noises]))
    rows = one_stand(centre, radius, sigma, rng)
    readings = crosses(rows)
    record, _ = one(CirclePosterior)
    post = record[0]
    post.x, post.y, post.root_xx, post.root_yy = centre.real, centre.imag, 0.004, 0.03
    linear = records(LinearReading, zeros(LinearReading, len(rows)))
    circle_posterior.posterior_circle(readings, radius, P, noise, predictions(), linear, np.zeros(GRID_CELLS), post)
    xs, ys = centre.real + np.linspace(-0.03, 0.03, 25), centre.imag + np.linspace(-0.15, 0.15, 41)
    nats, out = np.empty((len(xs), len(ys))), predictions()
    for a, x in enumerate(xs):
        for b, y in enumerate(ys):
            score, _ = one(Score)
            range_fit.score_circle(readings, x, y, radius, P, noise, out, score[0])
            nats[a, b] = score[0].log_likelihood_ratio
    weight = np.exp(nats - nats.max())
    weight /= weight.sum()
    mean = complex(weight.sum(1) @ xs, weight.sum(0) @ ys)
    spread = math.sqrt(float(weight.sum(0) @ (ys - mean.imag) ** 2))
    assert abs(complex(post.x, post.y) - mean) < 0.2 * spread
    assert math.sqrt(post.covariance_yy) == pytest.approx(spread, rel=0.2)
    assert abs(mean - centre) < 3.0 * spread < 0.1


def test_cross_paths_of_a_firing_are_placed_remembered_and_associated() -> None:
    memory = new_memory()
    memory.circles.view(np.uint8)[...] = 0
    track = memory.tracks[0]
    track.status, track.radius, track.x, track.y = ESTABLISHED, 0.3, 2.0, 1.0
    pose = (1.0, 1.0, 0.2)
    nothing = np.full(len(MOUNTS), np.nan)

    def hear(half_paths: Floats, pose: tuple[float, float, float] = pose) -> int:
        assert placement.place_readings(memory.s, P, MOUNTS, *pose, nothing) == 0
        observe.hear_crosses(
            memory.s, memory.tracks, P, MOUNTS, pose, 0, np.array([0, 0, 0]), np.array([1, 2, 0]), half_paths
        )
        return int(memory.s[0].scratch.crosses)

    turn = cmath.exp(0.2j)
    places = [complex(1.0, 1.0) + turn * complex(*MOUNTS[k, :2]) for k in range(3)]
    halves = np.array([half_over_circle(places[0], places[k], 2.0 + 1.0j, 0.3) for k in (1, 2, 0)])
    halves[1] += 0.4
    assert hear(halves) == 2  # a sensor that fires does not listen
    rows = numbers(memory.state["scratch"]["fired"][0])[:2]
    assert rows[:, 0] + 1j * rows[:, 1] == pytest.approx([places[0]] * 2)
    assert rows[:, 5] + 1j * rows[:, 6] == pytest.approx(np.array(places[1:]) - places[0])
    assert memory.state["scratch"]["explained_by"][0, :2].tolist() == [0, UNEXPLAINED]
    assert memory.s[0].crosses_kept == 2
    assert numbers(memory.state["crosses"][0])[:2] == pytest.approx(rows)
    observe.keep_readings(memory.s, memory.tracks, P, 0)
    assert track.unseen == 1  # one that came from elsewhere is no evidence
    assert memory.circles["bins"]["count"][0].sum() == 1  # the first of every seven is the circle's own
    memory.s[0].crosses_kept += 1
    observe.keep_readings(memory.s, memory.tracks, P, 0)
    assert memory.circles["bins"]["count"][0].sum() == 1  # all circles share the memory of the others
    assert track.unseen == 2
    track.is_named, track.probability = 1, 0.99
    observe.keep_readings(memory.s, memory.tracks, P, 0)
    assert track.unseen == 2  # which do not make a sure circle due
    memory.s[0].crosses_kept += CROSS_EVERY - 1
    observe.keep_readings(memory.s, memory.tracks, P, 0)
    assert track.unseen == 3
    assert hear(halves) == 0  # the robot has not moved
    assert hear(np.full(3, np.inf), (1.3, 1.0, 0.2)) == 0  # nothing was heard
    assert hear(halves, (1.3, 1.0, 0.2)) == 2
    assert hear(halves, (math.nan, 1.0, 0.2)) == 0


def test_a_circle_takes_of_the_remembered_cross_paths_those_that_it_may_explain_evenly() -> None:
    rng, memory = np.random.default_rng(7), new_memory()
    centre, radius = 0.3 - 0.2j, 0.25
    rows = rng.uniform(-3.0, 3.0, (CROSS_HISTORY, 7))
    axes = np.exp(1j * (np.angle(centre - rows[:, 0] - 1j * rows[:, 1]) + rng.uniform(-0.8, 0.8, len(rows))))
    rows[:, 2], rows[:, 3], rows[:, 5:] = axes.real, axes.imag, rng.uniform(-0.2, 0.2, (len(rows), 2))
    rows[:, 4] = abs(centre - rows[:, 0] - 1j * rows[:, 1]) - radius + rng.uniform(-0.6, 0.6, len(rows))
    numbers(memory.state["crosses"][0])[...] = rows
    memory.s[0].crosses_kept = 5 * CROSS_HISTORY
    out = memory.s[0].scratch.readings
    n = reservoir.add_crosses(memory.s, P, centre.real, centre.imag, radius, out, 3) - 3
    taken = numbers(memory.state["scratch"]["readings"][0])[3 : 3 + n]
    to = centre - rows[:, 0] - 1j * rows[:, 1]
    bears = (to * axes.conj()).real >= P[0].cos_may_answer * abs(to)
    bears &= abs(rows[:, 4] + radius - abs(to)) < P[0].gate_m + 0.5 * abs(rows[:, 5:]).sum(1)
    bears &= np.arange(CROSS_HISTORY) % CROSS_EVERY > 0  # the circle has those itself
    step = math.ceil(bears.sum() / CROSSES_MAX)
    assert step > 1
    assert taken == pytest.approx(rows[bears][::step])
    assert n <= CROSSES_MAX


def test_a_cross_path_that_a_named_drum_must_have_answered_sooner_is_no_other_bodys() -> None:
    memory = new_memory()
    memory.circles.view(np.uint8)[...] = 0
    near = memory.tracks[0]
    near.status, near.radius, near.x, near.y, near.is_named = ESTABLISHED, 0.3, 1.3, 0.0, 1
    to, across = 2.5 + 0.2j, 0.05 + 0.1j
    half = half_over_circle(0j, across, to, 0.3)
    q = crosses(np.array([[0.0, 0.0, 1.0, 0.0, half, across.real, across.imag]]))[0]

    def counts(own: int) -> bool:
        others = memory.s[0].scratch.others
        others = others[: occlusion.find_others(memory.tracks, own, P, to.real, to.imag, 0.3, 0, others)]
        e = cross_path.circle_error(q, to.real, to.imag, abs(to), 0.3)
        return bool(occlusion.is_relevant(others, P, q, (to.real, to.imag, 0.3), abs(to), e, 1e-6, 0.0))

    assert not counts(1)
    near.is_named = 0
    assert counts(1)
    near.is_named, near.y = 1, 1.3  # out of the beam
    assert counts(1)
