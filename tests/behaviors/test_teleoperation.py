"""Teleoperation: the operator's vector, its time limit, and how the arbiter limits a requested velocity."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviors.arbiter import Drive, Stop, limit_velocity
from behaviors.response import Response
from behaviors.teleoperation import TELEOPERATION_ENDED, Teleoperate, blocked_by, is_expired, teleoperation
from config.behaviors import ArbiterConfig, TeleoperationConfig
from config.robot import BodyConfig
from perception.percept import Percept, Pose, Twist
from tests.behaviors.views import EVERYWHERE

BODY = BodyConfig(radius_m=0.4, speed_max_m_s=0.5, turn_max_rad_s=1.0, acceleration_max_m_s2=0.5)
CONFIG = ArbiterConfig(base_velocity_m_s=0.4, turn_gain_per_s=2.0, clearance_m=0.1)
EXPECTED = ("teleoperation", "avoid")
HEADINGS = pytest.mark.parametrize("heading", [0.0, 2.0, -17.0 * math.pi])


def at(theta: float, *points: tuple[float, float]) -> Percept:
    """Return the percept of a robot at the origin; points count ahead and to the left."""
    c, s = math.cos(theta), math.sin(theta)
    turned = [(c * x - s * y, s * x + c * y) for x, y in points]
    return Percept(Pose(0.0, 0.0, theta), np.array(turned, dtype=np.float64).reshape(-1, 2), EVERYWHERE)


def decide(v: float, w: float, percept: Percept, push: tuple[float, float] = (0.0, 0.0)) -> Drive | Stop:
    """Decide on a velocity and a push of another schema; the push counts ahead and to the left."""
    c, s = math.cos(percept.pose.theta), math.sin(percept.pose.theta)
    requested = teleoperation(percept, Teleoperate(v, w), CONFIG.base_velocity_m_s)
    away = Response("avoid", c * push[0] - s * push[1], s * push[0] + c * push[1])
    return limit_velocity(Twist(v, w), (requested, away), percept, BODY, CONFIG, EXPECTED)


def twist(v: float, w: float, percept: Percept, push: tuple[float, float] = (0.0, 0.0)) -> tuple[float, float]:
    decision = decide(v, w, percept, push)
    assert isinstance(decision, Drive), decision
    return decision.twist.v, decision.twist.w


@HEADINGS
def test_the_vector_lies_along_the_heading(heading: float) -> None:
    response = teleoperation(at(heading), Teleoperate(-0.2, 9.0), 0.4)
    assert response.schema == "teleoperation"
    assert (response.x, response.y) == pytest.approx((-0.5 * math.cos(heading), -0.5 * math.sin(heading)))


@HEADINGS
@pytest.mark.parametrize("v", [0.3, 0.1, 0.0, -0.1, -0.3])
@pytest.mark.parametrize("w", [0.0, 0.5, -0.5])
def test_without_obstacles_the_request_is_carried_out(heading: float, v: float, w: float) -> None:
    assert twist(v, w, at(heading)) == pytest.approx((v, w))


def test_a_request_is_clamped_to_the_limits_of_the_body() -> None:
    assert twist(9.0, 9.0, at(0.0)) == (0.5, 1.0)
    assert twist(-9.0, -9.0, at(0.0)) == (-0.5, -1.0)


@HEADINGS
def test_it_stops_before_an_obstacle_and_may_turn_there(heading: float) -> None:
    """Rim 0.4 m and clearance 0.1 m: an echo at 0.5 m leaves no path, one at 0.54 m allows √(2·0.5·0.04) m/s."""
    assert twist(0.3, 0.7, at(heading, (0.45, 0.0))) == pytest.approx((0.0, 0.7))
    assert twist(0.3, 0.0, at(heading, (0.54, 0.0)))[0] == pytest.approx(0.2)
    assert twist(-0.3, 0.7, at(heading, (-0.45, 0.0))) == pytest.approx((0.0, 0.7))
    assert twist(-0.3, 0.0, at(heading, (-0.54, 0.0)))[0] == pytest.approx(-0.2)


@HEADINGS
def test_obstacles_behind_do_not_matter(heading: float) -> None:
    assert twist(0.3, 0.0, at(heading, (-0.45, 0.0)))[0] == pytest.approx(0.3)
    assert twist(-0.3, 0.0, at(heading, (0.45, 0.0)))[0] == pytest.approx(-0.3)


@HEADINGS
@pytest.mark.parametrize(
    ("v", "push", "left"),
    [
        (0.3, -0.25, 0.2),  # a push of magnitude 1 is worth the base velocity
        (0.3, -0.75, 0.0),
        (0.3, -1e6, 0.0),
        (0.3, 5.0, 0.3),  # a push never accelerates
        (-0.3, 0.25, -0.2),
        (-0.3, 1e6, 0.0),
        (-0.3, -5.0, -0.3),
        (0.0, -1e6, 0.0),
        (0.0, 1e6, 0.0),
    ],
)
def test_pushes_slow_down_and_never_accelerate(heading: float, v: float, push: float, left: float) -> None:
    assert twist(v, 0.0, at(heading), (push, 0.0)) == pytest.approx((left, 0.0), abs=1e-9)


@HEADINGS
def test_lateral_pushes_steer_in_proportion_to_the_forward_speed(heading: float) -> None:
    assert twist(0.2, 0.1, at(heading), (0.0, 0.25)) == pytest.approx((0.2, 0.1 + 2.0 * 0.25 * 0.5))
    assert twist(0.2, 0.0, at(heading), (0.0, -0.25)) == pytest.approx((0.2, -0.25))
    assert twist(0.2, 0.0, at(heading), (0.0, 7.0)) == pytest.approx((0.2, 1.0))
    assert twist(0.02, 0.0, at(heading), (0.0, 1e6)) == pytest.approx((0.02, 0.1)), "a push counts as one at most"
    assert twist(0.02, 0.0, at(heading), (0.0, -1e6)) == pytest.approx((0.02, -0.1))
    for v in (0.0, -0.2):
        assert twist(v, 0.1, at(heading), (0.0, 7.0)) == pytest.approx((v, 0.1)), "not in reverse or on the spot"


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_non_finite_velocity_stops(bad: float) -> None:
    for v, w in ((bad, 0.0), (0.0, bad)):
        decision = limit_velocity(Twist(v, w), (Response("a", 0.0, 0.0),), at(0.0), BODY, CONFIG, ("a",))
        assert isinstance(decision, Stop)
        assert decision.reason.startswith("invalid velocity request (")
    assert isinstance(decide(bad, 0.0, at(0.0)), Stop), "its vector is not finite either"


def test_a_missing_response_stops() -> None:
    requested = Response("teleoperation", 0.0, 0.0)
    decision = limit_velocity(Twist(0.1, 0.0), (requested,), at(0.0), BODY, CONFIG, EXPECTED)
    assert isinstance(decision, Stop)
    assert "avoid" in decision.reason


@pytest.mark.promise("P3")
def test_no_velocity_and_no_vector_makes_a_bad_command() -> None:
    """Decisions on numbers of every magnitude: each is a Stop or within the limits, and no push accelerates."""
    rng = np.random.default_rng(21)
    n = 5000
    sizes = 10.0 ** rng.uniform(-320.0, 308.0, (n, 6)) * rng.choice([-1.0, 1.0], (n, 6))
    special = rng.choice([0.0, -0.0, 1.0, 1e6, math.nan, math.inf, -math.inf, 1.7e308], (n, 6))
    rows = np.where(
        rng.random((n, 6)) < 0.2, special, np.where(rng.random((n, 1)) < 0.3, sizes, rng.normal(size=(n, 6)))
    )
    points = rng.uniform(-1.0, 1.0, (64, 3, 2))
    stops = 0
    for i, (v, w, x1, y1, x2, y2) in enumerate(rows.tolist()):
        percept = Percept(Pose(0.0, 0.0, float(rng.uniform(-4.0, 4.0))), points[i % 64], EVERYWHERE)
        decision = limit_velocity(
            Twist(v, w), (Response("a", x1, y1), Response("b", x2, y2)), percept, BODY, CONFIG, ("a", "b")
        )
        if isinstance(decision, Stop):
            stops += 1
            total = [x1 + x2, y1 + y2]
            assert not all(map(math.isfinite, [v, w, x1, y1, x2, y2, *total])), rows[i]
        else:
            assert abs(decision.twist.v) <= BODY.speed_max_m_s
            assert abs(decision.twist.w) <= BODY.turn_max_rad_s
            assert decision.twist.v == 0.0 or (0.0 < decision.twist.v <= v) or (v <= decision.twist.v < 0.0)
    assert 0.05 * n < stops < 0.9 * n


def test_a_request_expires() -> None:
    config = TeleoperationConfig(message_age_max_s=0.25)
    assert not is_expired(Teleoperate(0.1, 0.0), 0.0, config)
    assert not is_expired(Teleoperate(0.1, 0.0), 0.249, config)
    assert is_expired(Teleoperate(0.1, 0.0), 0.25, config)
    assert is_expired(Teleoperate(0.1, 0.0, valid_s=0.1), 0.1, config), "the request may set a shorter time"
    assert is_expired(Teleoperate(0.1, 0.0, valid_s=9.0), 0.25, config), "but not a longer one than the settings"
    assert is_expired(Teleoperate(0.1, 0.0), -0.001, config), "a clock that went backwards"
    assert is_expired(Teleoperate(0.1, 0.0), math.nan, config)
    assert (TELEOPERATION_ENDED.v, TELEOPERATION_ENDED.w) == (0.0, 0.0)


@HEADINGS
def test_what_blocks_an_operator_is_named_with_its_place(heading: float) -> None:
    """Of three points within reach only those on the side to which the robot is driven count."""
    seen = at(heading, (0.7, 0.0), (0.3, 0.3), (-0.4, -0.4))
    assert blocked_by(seen, 0.2, 0.4) == (
        "blocked by an obstacle 0.02 m from the robot's edge, 45° left of its front: turn away, or drive back"
    )
    assert blocked_by(seen, -0.2, 0.4) == (
        "blocked by an obstacle 0.17 m from the robot's edge, 135° right of its front: turn away, or drive forward"
    )
    assert (blocked_by(replace(seen, no_go=1), -0.2, 0.4) or "").startswith("blocked by a no-go line 0.17 m")
    assert blocked_by(at(heading, (-0.4, 0.1)), 0.2, 0.4) is None
