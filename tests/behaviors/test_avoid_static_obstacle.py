"""Avoid-static-obstacle: Arkin's equation by hand and against a slow oracle, and the sum of several pushes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviors.avoid_static_obstacle import SCHEMA, UNBOUNDED, Zone, avoid_static_obstacle, repulsion
from config.behaviors import AvoidStaticObstacleConfig
from perception.percept import Percept, Pose
from tests.behaviors.views import EVERYWHERE

RADIUS = 0.5
SUM = AvoidStaticObstacleConfig(
    avoid_obstacle_gain=2.0, avoid_obstacle_sphere_m=1.0, avoid_obstacle_safety_margin_m=0.2, summing="sum"
)
LARGEST = SUM.model_copy(update={"summing": "largest"})
BOTH = pytest.mark.parametrize("config", [SUM, LARGEST], ids=["sum", "largest"])


def seen(*points: tuple[float, float], pose: Pose | None = None) -> Percept:
    return Percept(pose or Pose(0.0, 0.0, 0.0), np.array(points, dtype=np.float64).reshape(-1, 2), EVERYWHERE)


def vector(percept: Percept, config: AvoidStaticObstacleConfig) -> tuple[float, float]:
    response = avoid_static_obstacle(percept, RADIUS, config)
    assert response.schema == SCHEMA
    return response.x, response.y


def naive(percept: Percept, config: AvoidStaticObstacleConfig) -> tuple[float, float]:
    """Return the vector by the equation, echo by echo."""
    pushes = []
    for ox, oy in percept.obstacles.tolist():
        away_x, away_y = percept.pose.x - ox, percept.pose.y - oy
        length = math.hypot(away_x, away_y)
        d = length - RADIUS
        s, r = config.avoid_obstacle_sphere_m, config.avoid_obstacle_safety_margin_m
        magnitude = 0.0 if d > s else UNBOUNDED if d <= r else (s - d) / (s - r)
        magnitude *= config.avoid_obstacle_gain
        pushes.append((magnitude * away_x / length, magnitude * away_y / length))
    x, y = sum(p[0] for p in pushes), sum(p[1] for p in pushes)
    total = math.hypot(x, y)
    if config.summing == "sum" or total == 0.0:
        return x, y
    ux, uy = x / total, y / total
    kept = min(total, max(px * ux + py * uy for px, py in pushes))
    return kept * ux, kept * uy


@pytest.mark.parametrize(
    ("gap", "magnitude"),
    [(50.0, 0.0), (1.001, 0.0), (1.0, 0.0), (0.9, 0.25), (0.6, 1.0), (0.4, 1.5), (0.2001, 1.99975)],
)
@BOTH
def test_magnitude_by_hand(gap: float, magnitude: float, config: AvoidStaticObstacleConfig) -> None:
    """(S − d)/(S − R)·G with S = 1, R = 0.2 and G = 2; d counts from the rim."""
    assert vector(seen((RADIUS + gap, 0.0)), config) == pytest.approx((-magnitude, 0.0), abs=1e-12)


@pytest.mark.parametrize("gap", [0.1999, 0.0, -0.3])
@BOTH
def test_inside_the_margin_it_outweighs_every_other_schema(gap: float, config: AvoidStaticObstacleConfig) -> None:
    x, y = vector(seen((0.0, RADIUS + gap)), config)
    assert x == pytest.approx(0.0)
    assert -math.inf < y <= -UNBOUNDED


def test_at_the_margin_itself() -> None:
    assert repulsion(0.2, Zone(1.0, 0.2), 2.0) == 2.0 * UNBOUNDED


def test_a_gain_of_zero_turns_it_off() -> None:
    off = SUM.model_copy(update={"avoid_obstacle_gain": 0.0})
    assert vector(seen((0.6, 0.0), (1.0, 0.3)), off) == (0.0, 0.0)


@BOTH
def test_far_echoes_do_not_push(config: AvoidStaticObstacleConfig) -> None:
    assert vector(seen(), config) == (0.0, 0.0)
    assert vector(seen((30.0, 0.0), (0.0, -30.0)), config) == (0.0, 0.0)


@BOTH
def test_the_push_points_away_from_the_echo_in_the_odometry_frame(config: AvoidStaticObstacleConfig) -> None:
    x, y = vector(seen((10.0 + 0.6, -4.0 + 0.8), pose=Pose(10.0, -4.0, 2.2)), config)
    assert (x, y) == pytest.approx((-1.25 * 0.6, -1.25 * 0.8))


def test_ten_echoes_of_one_wall_push_ten_times_or_once() -> None:
    wall = seen(*[(1.0, 0.01 * i) for i in range(-5, 5)])
    assert vector(wall, SUM)[0] == pytest.approx(-12.5, rel=5e-3)
    assert vector(wall, LARGEST)[0] == pytest.approx(-1.25, rel=1e-3)


@BOTH
@pytest.mark.parametrize("gap", [0.5, 0.1, 0.0])
def test_opposite_walls_cancel(gap: float, config: AvoidStaticObstacleConfig) -> None:
    y = RADIUS + gap
    assert vector(seen((0.0, y), (0.0, -y)), config) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_nearly_balanced_walls_push_nearly_nothing() -> None:
    """The largest push alone would jump from zero to full strength beside the middle of a corridor."""
    x, y = vector(seen((0.0, 1.0), (0.0, -1.01)), LARGEST)
    assert abs(x) < 1e-12
    assert y == pytest.approx(vector(seen((0.0, 1.0), (0.0, -1.01)), SUM)[1])
    assert abs(y) < 0.03


@BOTH
def test_an_echo_at_the_centre_pushes_backwards(config: AvoidStaticObstacleConfig) -> None:
    x, y = vector(seen((3.0, 3.0), pose=Pose(3.0, 3.0, math.pi / 2.0)), config)
    assert abs(x) < 1e-6 * abs(y)
    assert y <= -UNBOUNDED


@BOTH
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_non_finite_echo_gives_a_non_finite_vector(bad: float, config: AvoidStaticObstacleConfig) -> None:
    with np.errstate(invalid="ignore"):
        x, y = vector(seen((1.0, 0.0), (bad, 0.0)), config)
    assert not (math.isfinite(x) and math.isfinite(y))


@BOTH
def test_agrees_with_the_oracle(config: AvoidStaticObstacleConfig) -> None:
    rng = np.random.default_rng(89)
    for _ in range(300):
        pose = Pose(float(rng.uniform(-5.0, 5.0)), float(rng.uniform(-5.0, 5.0)), 0.0)
        angle, far = rng.uniform(-math.pi, math.pi, (2, rng.integers(1, 40)))
        far = np.abs(far)
        points = np.column_stack((pose.x + far * np.cos(angle), pose.y + far * np.sin(angle)))
        percept = Percept(pose, points, EVERYWHERE)
        expected = naive(percept, config)
        assert vector(percept, config) == pytest.approx(expected, rel=1e-9, abs=1e-6)


def test_largest_never_exceeds_the_sum_and_has_its_direction() -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        percept = seen(*rng.uniform(-1.5, 1.5, (8, 2)).tolist())
        (sx, sy), (lx, ly) = vector(percept, SUM), vector(percept, LARGEST)
        assert math.hypot(lx, ly) <= math.hypot(sx, sy) * (1.0 + 1e-12)
        assert abs(sx * ly - sy * lx) <= 1e-9 * (1.0 + math.hypot(sx, sy) ** 2)


@BOTH
def test_is_pure(config: AvoidStaticObstacleConfig) -> None:
    percept = seen((1.0, 0.2), (0.0, 0.0))
    before = percept.obstacles.copy()
    assert avoid_static_obstacle(percept, RADIUS, config) == avoid_static_obstacle(percept, RADIUS, config)
    np.testing.assert_array_equal(percept.obstacles, before)
