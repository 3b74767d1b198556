"""Bodies heard by rays, against all rays of the beam one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.inference import beam
from perception.bayes.memory.state import RAYS_MAX, Memory
from tests.perception.bayes.random_tracks import SENSORS, P, examples, pair, readings_of


def rays_of(axis: float, half_angle: float, rays: int) -> np.ndarray:
    """Return the unit vectors of all rays, shape (rays, 2)."""
    angles = axis + (np.linspace(-half_angle, half_angle, rays) if rays > 1 else np.zeros(1))
    return np.column_stack([np.cos(angles), np.sin(angles)])


def first_hit(rays: np.ndarray, to: np.ndarray, radius: float) -> float:
    """Return the shortest way along a ray to a circle, inf where none meets it."""
    along, beside = rays @ to, np.abs(rays[:, 0] * to[1] - rays[:, 1] * to[0])
    hit = (beside < radius) & (along > 0.0)
    return float((along[hit] - np.sqrt(radius**2 - beside[hit] ** 2)).min(initial=math.inf))


@examples(2000, 40_000)
def test_a_circle_is_heard_by_the_ray_that_meets_it_first(examples: int) -> None:
    rng, heard = np.random.default_rng(41), 0
    for _ in range(examples):
        rays, half_angle, axis = int(rng.integers(1, RAYS_MAX + 1)), rng.uniform(0.1, 0.6), rng.uniform(-3, 3)
        radius, d, off = rng.choice([0.1, 0.3048, 0.67]), rng.uniform(0.8, 4.0), rng.uniform(-0.8, 0.8)
        to = d * np.array([math.cos(axis + off), math.sin(axis + off)])
        (q,) = readings_of(np.array([[0.0, 0.0, math.cos(axis), math.sin(axis), 1.0]]))
        r, slope_x, slope_y, ahead = beam.ray_over_circle(q, *pair(to), d, radius, half_angle, rays)
        all_rays = rays_of(axis, half_angle, rays)
        want = first_hit(all_rays, to, radius)
        past = np.abs(np.arctan2(all_rays[:, 0] * to[1] - all_rays[:, 1] * to[0], all_rays @ to)).min()
        angle = max(half_angle + past - math.asin(radius / d), 0.0)
        assert ahead == pytest.approx(d * math.cos(angle), abs=1e-12)
        assert (ahead > d * math.cos(half_angle)) == math.isfinite(want)
        if not math.isfinite(want):
            continue
        heard += 1
        assert r == pytest.approx(want, abs=1e-12)
        deep = math.sqrt(radius**2 - (d * math.sin(past)) ** 2)
        if rays > 1 and abs(past - half_angle / (rays - 1)) < 1e-3:
            continue  # between two rays the range has a kink
        if deep > 0.3 * radius:
            shifts = 1e-6 * np.eye(2)
            slopes = [
                (first_hit(all_rays, to + shift, radius) - first_hit(all_rays, to - shift, radius)) / 2e-6
                for shift in shifts
            ]
            assert (slope_x, slope_y) == pytest.approx(slopes, abs=1e-4)
    assert heard > 0.3 * examples


@examples(500, 10_000)
def test_a_line_is_heard_by_the_ray_that_meets_it_first(examples: int) -> None:
    rng = np.random.default_rng(42)
    for _ in range(examples):
        rays, half_angle, axis = int(rng.integers(1, RAYS_MAX + 1)), rng.uniform(0.1, 0.5), rng.uniform(-3, 3)
        away, off = rng.uniform(0.5, 4.0), rng.uniform(-0.7, 0.7)
        normal = np.array([math.cos(axis + off), math.sin(axis + off)])
        (q,) = readings_of(np.array([[0.0, 0.0, math.cos(axis), math.sin(axis), 1.0]]))
        r, slant = beam.ray_over_line(q, *pair(normal), away, half_angle, rays)
        ahead = rays_of(axis, half_angle, rays) @ normal
        assert r == pytest.approx(away / ahead.max(), rel=1e-12)
        assert away * math.hypot(1.0, slant) == pytest.approx(r, rel=1e-12)
        hit = r * rays_of(axis, half_angle, rays)[ahead.argmax()]
        assert -normal[1] * hit[0] + normal[0] * hit[1] == pytest.approx(-away * slant, abs=1e-9)


def test_nearest_points_and_cross_paths_are_heard_as_without_rays() -> None:
    (q,) = readings_of(np.array([[0.1, 0.2, 1.0, 0.0, 1.0]]))
    d = math.hypot(1.3, 0.1)
    assert beam.answer(q, 1.3, 0.1, d, 0.3, 0.2, 0) == (1.0 - (d - 0.3), 1.3)
    error, ahead = beam.answer(q, 1.3, 0.1, d, 0.3, 0.2, 1)
    assert error == pytest.approx(1.0 - (1.3 - math.sqrt(0.3**2 - 0.1**2)))
    assert ahead > 1.3
    q.listener_x = 0.1
    assert beam.answer(q, 1.3, 0.1, d, 0.3, 0.2, 1) == beam.answer(q, 1.3, 0.1, d, 0.3, 0.2, 0)


def test_other_rays_are_tried_in_turn() -> None:
    rays, tried = 0, []
    for _ in range(RAYS_MAX):
        rays = beam.next_rays(rays, 2)
        tried.append(rays)
    assert sorted(tried) == [k for k in range(RAYS_MAX + 1) if k != 2]


def test_the_scratch_is_heard_as_assumed() -> None:
    memory = Memory(SENSORS, 1)
    beam.assume_rays(memory.s, P, 3)
    scratch = memory.s[0].scratch
    heard = (scratch.predicted, scratch.own, scratch.line_fit, *scratch.corner_fit.faces)
    assert all(it.rays == 3 and it.half_angle == P[0].half_angle_rad for it in heard)
