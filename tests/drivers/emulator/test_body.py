"""The base moves as its limits allow, never through anything, and its odometry drifts apart from the truth."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.robot import BodyConfig
from config.world import DrumConfig, OdometryConfig, WallConfig, WorldConfig
from drivers.emulator.body import BRAKE_S, Body, arc
from drivers.emulator.scene import compile_scene
from drivers.messages import Pose, Twist

DT = 0.005
STILL = Twist(0.0, 0.0)


def make(
    world: WorldConfig | None = None, start: Pose | None = None, odometry: dict[str, float] | None = None, **body: Any
) -> Body:
    config = BodyConfig(**{"radius_m": 0.4, "speed_max_m_s": 1.0, "turn_max_rad_s": 2.0} | body)
    return Body(
        config,
        compile_scene(world or WorldConfig()),
        start or Pose(0, 0, 0),
        OdometryConfig(**odometry or {}),
        np.random.default_rng(5),
    )


def run(body: Body, seconds: float, target: Twist, *, within_s: float | None = None) -> int:
    """Return how many steps met a contact."""
    return sum(body.step(DT, target, within_s=within_s) for _ in range(round(seconds / DT)))


def wall_ahead(x: float) -> WorldConfig:
    return WorldConfig(wall=(WallConfig(x1_m=x, y1_m=-5.0, x2_m=x, y2_m=5.0),))


def test_speed_ramps_with_the_acceleration() -> None:
    body = make(acceleration_max_m_s2=0.5, turn_acceleration_max_rad_s2=2.0)
    run(body, 0.6, Twist(0.5, 0.0))
    assert body.twist.v == pytest.approx(0.3)
    assert body.pose.x == pytest.approx(0.5 * 0.5 * 0.6**2)
    run(body, 1.0, Twist(0.5, 0.0))
    assert body.twist.v == 0.5
    run(body, 0.25, Twist(0.5, 1.0))
    assert body.twist.w == pytest.approx(0.5)


def test_limits_hold_against_any_command() -> None:
    body = make()
    run(body, 5.0, Twist(9.0, -9.0))
    assert body.twist == Twist(1.0, -2.0)


def test_brake_stops_from_full_speed_in_its_time() -> None:
    body = make(acceleration_max_m_s2=0.1, turn_acceleration_max_rad_s2=0.1)
    run(body, 30.0, Twist(1.0, 2.0))
    assert body.twist == Twist(1.0, 2.0)
    run(body, BRAKE_S + DT, STILL, within_s=BRAKE_S)
    assert body.twist == STILL


def test_circle_closes() -> None:
    body = make(acceleration_max_m_s2=50.0, turn_acceleration_max_rad_s2=100.0)
    run(body, 1.0, Twist(0.5, 0.5))
    before = body.pose
    run(body, 2 * math.pi / 0.5 // DT * DT, Twist(0.5, 0.5))
    rest = (2 * math.pi / 0.5) % DT
    body.step(rest, Twist(0.5, 0.5))
    assert body.pose.x == pytest.approx(before.x, abs=1e-9)
    assert body.pose.y == pytest.approx(before.y, abs=1e-9)
    assert body.pose.theta == pytest.approx(before.theta + 2 * math.pi)  # unwrapped


@settings(deadline=None)
@given(
    distance=st.floats(-2, 2),
    turn=st.floats(-3, 3),
    x=st.floats(-5, 5),
    theta=st.floats(-7, 7),
)
def test_arc_is_the_limit_of_many_short_straights(distance: float, turn: float, x: float, theta: float) -> None:
    pieces = 2000
    headings = theta + turn * (np.arange(pieces) + 0.5) / pieces
    end = arc(Pose(x, 1.0, theta), distance, turn)
    assert end.x == pytest.approx(x + distance * np.cos(headings).mean(), abs=1e-5)
    assert end.y == pytest.approx(1.0 + distance * np.sin(headings).mean(), abs=1e-5)
    assert end.theta == theta + turn


def test_synchro_keeps_its_ring() -> None:
    turning, synchro = make(), make(synchro=True)
    for body in (turning, synchro):
        run(body, 2.0, Twist(0.2, 1.0))
    assert synchro.ring_yaw == synchro.odometry_ring_yaw == 0.0
    assert turning.ring_yaw == pytest.approx(turning.pose.theta)
    assert turning.pose.theta > 1.0
    assert turning.pose == synchro.pose


@pytest.mark.parametrize("speed", [0.05, 0.5, 1.0])
def test_wall_stops_the_base_dead_at_the_rim(speed: float) -> None:
    body = make(wall_ahead(1.0))
    while not body.step(DT, Twist(speed, 0.0)):
        assert body.clearance_m >= 0.0
    assert body.twist == STILL
    assert 0.0 <= body.clearance_m < 1e-9
    assert body.pose.x == pytest.approx(0.6, abs=1e-9)
    assert body.contacts == 1


def test_pushing_on_is_a_new_contact_and_moving_away_is_free() -> None:
    body = make(wall_ahead(1.0))
    assert run(body, 3.0, Twist(0.5, 0.0)) > 1
    assert body.pose.x <= 0.6
    assert run(body, 1.0, STILL) == 0
    assert run(body, 1.0, Twist(0.0, 1.0)) == 0, "turning on the spot moves no rim"
    body = make(wall_ahead(1.0))
    while not body.step(DT, Twist(0.5, 0.0)):
        pass
    assert run(body, 2.0, Twist(-0.2, 0.0)) == 0
    assert body.clearance_m > 0.2


def test_small_fast_body_does_not_slip_through_a_wall() -> None:
    body = make(wall_ahead(1.0), radius_m=0.01, speed_max_m_s=10.0, acceleration_max_m_s2=50.0)
    for _ in range(60):
        if body.step(0.05, Twist(10.0, 0.0)):
            break
    assert body.contacts == 1
    assert body.pose.x == pytest.approx(0.99, abs=1e-6)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
@pytest.mark.compiled
def test_nothing_is_ever_penetrated(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room = [(-2, -2, 2, -2), (2, -2, 2, 2), (2, 2, -2, 2), (-2, 2, -2, -2)]
    world = WorldConfig(
        wall=tuple(WallConfig(x1_m=float(a), y1_m=float(b), x2_m=float(c), y2_m=float(d)) for a, b, c, d in room),
        drum=(DrumConfig(x_m=1.2, y_m=0.3, radius_m=0.3), DrumConfig(x_m=-0.9, y_m=-1.0, radius_m=0.2)),
    )
    body = make(world, acceleration_max_m_s2=5.0, turn_acceleration_max_rad_s2=20.0)
    for _ in range(30):
        target = Twist(float(rng.uniform(-1, 1)), float(rng.uniform(-2, 2)))
        for _ in range(40):
            body.step(DT, target)
            assert body.clearance_m >= 0.0


def test_robot_that_starts_inside_a_surface_can_leave_it() -> None:
    body = make(wall_ahead(0.3))
    assert body.clearance_m < 0
    assert body.step(0.5, Twist(0.5, 0.0))
    assert body.pose.x == pytest.approx(0.0, abs=1e-9)
    assert run(body, 3.0, Twist(-0.5, 0.0)) == 0
    assert body.clearance_m > 0.5


def test_odometry_begins_at_zero_wherever_the_robot_stands() -> None:
    body = make(start=Pose(3.0, -2.0, 1.0))
    run(body, 2.0, Twist(0.5, 0.3))
    expected = Pose(3.0, -2.0, 1.0).compose(body.odometry_pose)
    assert body.pose.x == pytest.approx(expected.x)
    assert body.pose.y == pytest.approx(expected.y)
    assert body.pose.theta == pytest.approx(expected.theta)
    assert body.ring_yaw == pytest.approx(1.0 + body.odometry_ring_yaw)


def test_odometry_scale_scales_the_distance_and_not_the_turn() -> None:
    body = make(odometry={"scale": 1.1})
    run(body, 4.0, Twist(0.5, 0.0))
    assert body.odometry_pose.x == pytest.approx(1.1 * body.pose.x)
    run(body, 2.0, Twist(0.0, 0.5))
    assert body.odometry_pose.theta == pytest.approx(body.pose.theta)


def test_heading_drifts_with_the_root_of_the_way_and_the_truth_does_not() -> None:
    def drift(dt_s: float, seed: int) -> float:
        scene = compile_scene(WorldConfig())
        config = BodyConfig(radius_m=0.4, speed_max_m_s=1.0, turn_max_rad_s=2.0, acceleration_max_m_s2=50.0)
        odometry = OdometryConfig(heading_rad_per_sqrt_m=0.02)
        body = Body(config, scene, Pose(0, 0, 0), odometry, np.random.default_rng(seed))
        for _ in range(round(4.0 / dt_s)):
            body.step(dt_s, Twist(1.0, 0.0))
        assert body.pose.theta == 0.0
        assert body.odometry_ring_yaw == body.odometry_pose.theta
        return body.odometry_pose.theta

    for dt_s in (0.04, 0.2):  # the spread does not depend on the size of the steps
        spread = np.std([drift(dt_s, seed) for seed in range(200)])
        assert spread == pytest.approx(0.04, rel=0.15)  # three standard errors of the spread of 200 seeds


def test_reset_and_jump_touch_the_odometry_only() -> None:
    body = make(synchro=True)
    run(body, 2.0, Twist(0.5, 0.5))
    truth, angle = body.pose, body.ring_yaw - body.pose.theta
    body.reset_odometry()
    assert body.odometry_pose == Pose(0, 0, 0)
    assert body.odometry_ring_yaw == pytest.approx(angle), "the ring's angle to the wheels is a fact"
    body.jump_odometry(1.0, -2.0, 0.5)
    assert body.odometry_pose == Pose(1.0, -2.0, 0.5)
    assert body.pose == truth


def test_a_differential_base_miscounts_turns_and_veers_on_a_straight_way() -> None:
    body = make(odometry={"turn_scale": 1.05, "veer_rad_per_m": -0.02, "scale": 1.1}, synchro=False)
    run(body, 1.0, Twist(0.0, 1.0))
    assert body.odometry_pose.theta == pytest.approx(1.05 * body.pose.theta)
    before = body.odometry_pose.theta - 1.05 * body.pose.theta
    run(body, 3.0, Twist(0.5, 0.0))
    way_m = body.odometry_m / 1.1
    assert body.odometry_pose.theta - 1.05 * body.pose.theta == pytest.approx(before - 0.02 * way_m)
    assert body.odometry_ring_yaw == body.odometry_pose.theta


def test_the_firmware_can_set_the_ramps() -> None:
    body = make()
    for _ in range(100):
        body.step(DT, Twist(1.0, 2.0), rates=(1.2, 3.0))
    assert (body.twist.v, body.twist.w) == pytest.approx((0.6, 1.5))
