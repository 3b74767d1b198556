"""Each sensor's last echo as an obstacle: its place, its age, and what removes it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from perception.obstacle_echoes.fresh_echoes import LOOKS_REMEMBERED, FreshEchoes
from perception.pipeline import Perception
from tests.perception.halls import settings

MOUNTS = np.array([[0.4, 0.0, 0.0], [0.0, 0.4, math.pi / 2]])
BEAM = math.radians(12.0)


def at(robot_s: float, yaw: float, *ranges: float) -> Firing:
    return Firing(robot_s, Pose(0.0, 0.0, 0.0), yaw, np.array(ranges))


def test_echoes_are_obstacles_until_the_sensor_fires_again_or_they_age() -> None:
    """A reading at maximum range clears only its own sensor's obstacle."""
    chosen = settings()
    perception = Perception(chosen.ring, chosen.models, chosen.perception)
    ranges = np.full(24, np.nan)
    ranges[0], ranges[1] = 1.0, 2.0
    perception.observe(Firing(0.0, Pose(1.0, 0.0, 0.0), 0.0, ranges))
    points = perception.obstacles(0.5, 1.0)
    assert points[0] == pytest.approx((1.0 + 0.381 + 1.0, 0.0))
    assert points[1] == pytest.approx((1.0 + 2.381 * math.cos(math.pi / 12), 2.381 * math.sin(math.pi / 12)))
    assert len(perception.obstacles(1.5, 1.0)) == 0
    later = np.full(24, np.nan)
    later[0] = math.inf
    perception.observe(Firing(0.6, Pose(1.0, 0.0, 0.0), 0.0, later))
    assert perception.obstacles(0.6, 1.0) == pytest.approx(points[1:])


def test_an_echo_lies_on_the_axis_of_its_turned_sensor() -> None:
    echoes = FreshEchoes(MOUNTS, BEAM)
    echoes.update(Firing(1.0, Pose(1.0, 2.0, 0.3), math.pi / 2, np.array([1.0, 2.0])))
    np.testing.assert_allclose(echoes.points(1.0, 0.0), [[1.0, 3.4], [-1.4, 2.0]], atol=1e-12)


def test_a_sensor_that_does_not_fire_keeps_its_echo_and_the_age_limit_is_inclusive() -> None:
    echoes = FreshEchoes(MOUNTS, BEAM)
    echoes.update(Firing(1.0, Pose(0.0, 0.0, 0.0), 0.0, np.array([1.0, 2.0])))
    echoes.update(Firing(2.0, Pose(0.0, 0.0, 0.0), 0.0, np.array([3.0, math.nan])))
    assert len(echoes.points(2.0, 1.0)) == 2
    assert echoes.points(2.0, 0.5) == pytest.approx(np.array([[3.4, 0.0]]))
    echoes.clear()
    assert len(echoes.points(2.0, math.inf)) == 0


def test_only_a_usable_range_or_a_silence_is_a_look() -> None:
    echoes = FreshEchoes(MOUNTS, BEAM)
    assert np.isinf(echoes.looks(5.0, 60.0)[2]).all()
    assert [len(found) for found in echoes.looks(5.0, 60.0)] == [0, 0, 2, 0]
    echoes.update(at(5.0, 0.1, 1.0, math.nan))
    echoes.update(at(6.0, 0.1, math.nan, math.inf))
    echoes.update(at(7.0, 0.1, math.nan, math.nan))
    bearings, ages, sensor_ages, _ = echoes.looks(7.0, 2.0)
    np.testing.assert_allclose(bearings, [0.1, 0.1 + math.pi / 2])
    np.testing.assert_allclose(ages, [2.0, 1.0])
    assert sensor_ages == pytest.approx([2.0, 1.0])
    assert echoes.looks(7.0, 1.5)[0] == pytest.approx([0.1 + math.pi / 2])
    echoes.clear()
    assert np.isinf(echoes.looks(0.0, 60.0)[2]).all(), "a robot that restarted counts from zero again"


def test_a_ring_that_turns_keeps_what_it_heard_in_other_directions() -> None:
    echoes = FreshEchoes(MOUNTS[:1], BEAM)
    for k, turn in enumerate((0.0, 0.09, 0.2, 0.2 + 2.0 * math.pi, 0.4 - 2.0 * math.pi)):
        echoes.update(at(float(k), turn, 1.0))
    bearings, ages, *_ = echoes.looks(4.0, 60.0)
    kept = sorted(zip(ages.tolist(), np.remainder(bearings, 2.0 * math.pi).tolist(), strict=True))
    assert [age for age, _ in kept] == [0.0, 1.0, 3.0, 4.0], "a look replaces those in the very same direction"
    assert [bearing for _, bearing in kept] == pytest.approx([0.4, 0.2, 0.09, 0.0])
    assert len(echoes.points(4.0, math.inf)) == 3, "and the echoes within half of a beam's half width"
    echoes.update(at(5.0, 0.05, math.inf))
    assert len(echoes.points(5.0, math.inf)) == 2, "a silence removes the echo that it would have repeated"


def test_where_more_directions_are_heard_than_kept_the_oldest_goes() -> None:
    echoes = FreshEchoes(MOUNTS[:1], BEAM)
    for k in range(LOOKS_REMEMBERED + 3):
        echoes.update(at(float(k), 0.2 * k, 1.0))
    _, ages, *_ = echoes.looks(LOOKS_REMEMBERED + 2.0, 60.0)
    assert sorted(ages.tolist()) == list(range(LOOKS_REMEMBERED))


@pytest.mark.covered
@pytest.mark.parametrize("turn_rad", [1e-5, 1e-3, 0.02, 0.08])
def test_looks_before_close_the_gaps_between_beams_that_just_touch(turn_rad: float) -> None:
    """Neighbours fire in turn while the ring turns; one reading in ten fails."""
    rng = np.random.default_rng(5)
    half_angle = math.pi / 4
    echoes = FreshEchoes(np.array([[0.1, 0.0, math.pi / 2 * k] for k in range(4)]), half_angle)
    for k in range(200):
        fired = [math.nan] * 4
        fired[k % 4] = math.nan if rng.random() < 0.1 else math.inf
        echoes.update(at(0.03 * k, turn_rad * k, *fired))
        if k < 16:
            continue
        bearings, *_ = echoes.looks(0.03 * k, 1.5)
        off = np.abs(np.remainder(np.linspace(0.0, math.tau, 3000)[:, None] - bearings + math.pi, math.tau) - math.pi)
        assert (off <= half_angle + 1e-9).any(axis=1).all(), k


def test_an_echo_is_steady_where_another_look_agrees() -> None:
    """A random range is an obstacle, but never a steady one."""
    echoes = FreshEchoes(MOUNTS, BEAM)
    echoes.update(at(0.0, 0.0, 1.0, 2.0))
    assert len(echoes.steady_points(0.0, 1.5)) == 0
    echoes.update(at(0.1, 0.0, 1.1, 3.5))
    assert len(echoes.points(0.1, 1.5)) == 2
    assert echoes.steady_points(0.1, 1.5) == pytest.approx(np.array([[1.5, 0.0]]))
    echoes.update(at(0.2, 0.0, 4.0, 3.5))
    assert echoes.steady_points(0.2, 1.5) == pytest.approx(np.array([[0.0, 3.9]]))


def approach(silent_from: float, echo_of: int | None = None) -> FreshEchoes:
    """Drive towards a wall at 3 m that one sensor hears; somewhere nothing is heard, or an echo elsewhere."""
    echoes = FreshEchoes(MOUNTS, BEAM, (), 5.0)
    for k in range(30):
        x = 0.05 * k
        ranges = np.full(len(MOUNTS), math.inf)
        if x < silent_from:
            ranges[0] = 3.0 - x - MOUNTS[0, 0]
        elif echo_of is not None:
            ranges[echo_of] = 2.0
        echoes.update(Firing(0.1 * k, Pose(x, 0.0, 0.0), 0.0, ranges))
    return echoes


def test_in_a_ring_that_falls_silent_what_stood_ahead_stays_and_is_reported_once() -> None:
    echoes = approach(0.9)
    assert echoes.points(20.0, 1.5)[:, 0] == pytest.approx([3.0])
    assert echoes.unheard.take_ahead(Pose(1.5, 0.0, 0.0), 1.0, 0.5) is None, "it is farther ahead"
    assert echoes.unheard.take_ahead(Pose(2.5, 0.0, math.pi), 1.0, 0.5) is None, "it is behind"
    assert echoes.unheard.take_ahead(Pose(2.5, 1.0, 0.0), 1.0, 0.5) is None, "it is beside the way"
    assert echoes.unheard.take_ahead(Pose(2.5, 0.0, 0.0), 1.0, 0.5) == pytest.approx(0.5)
    assert echoes.unheard.take_ahead(Pose(2.5, 0.0, 0.0), 1.0, 0.5) is None
    assert len(echoes.points(20.0, 1.5)) == 0
    assert approach(1.35).unheard.take_ahead(Pose(2.5, 0.0, 0.0), 1.0, 0.5) is None, "it may hear something next"


def test_what_is_gone_is_forgotten_as_soon_as_the_ring_hears_anything() -> None:
    echoes = approach(0.9, echo_of=1)
    assert echoes.unheard.take_ahead(Pose(2.5, 0.0, 0.0), 1.0, 0.5) is None


def test_what_leaves_a_robot_that_stands_is_gone() -> None:
    echoes = FreshEchoes(MOUNTS, BEAM, (), 5.0)
    for k in range(10):
        echoes.update(at(0.1 * k, 0.0, 1.0 if k < 6 else math.inf, math.inf))
    assert len(echoes.points(1.0, 1.5)) == 0
