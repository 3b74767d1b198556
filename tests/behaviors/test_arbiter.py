"""The arbiter: velocities from sums of responses, reasons for stops, and the limits of the base for any input."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from behaviors.arbiter import Drive, Stop, arbitrate
from behaviors.response import Response
from config.behaviors import ArbiterConfig
from config.robot import BodyConfig
from perception.percept import Percept, Pose, Twist
from tests.behaviors.views import EVERYWHERE

BODY = BodyConfig(radius_m=0.4, speed_max_m_s=0.5, turn_max_rad_s=1.0, acceleration_max_m_s2=0.5)
CONFIG = ArbiterConfig(base_velocity_m_s=0.3, cautious_velocity_m_s=0.1, turn_gain_per_s=2.0, clearance_m=0.1)


def at(theta: float = 0.0, *points: tuple[float, float]) -> Percept:
    return Percept(Pose(0.0, 0.0, theta), np.array(points, dtype=np.float64).reshape(-1, 2), EVERYWHERE)


def decide(
    *vectors: tuple[float, float], percept: Percept | None = None, config: ArbiterConfig = CONFIG
) -> Drive | Stop:
    responses = [Response(f"s{i}", x, y) for i, (x, y) in enumerate(vectors)]
    return arbitrate(responses, percept or at(), BODY, config, [r.schema for r in responses])


def twist(decision: Drive | Stop) -> Twist:
    assert isinstance(decision, Drive), decision
    return decision.twist


def reason(decision: Drive | Stop) -> str:
    assert isinstance(decision, Stop)
    assert decision.reason.isprintable()
    return decision.reason


def test_unit_vector_ahead_is_base_velocity() -> None:
    assert twist(decide((1.0, 0.0))) == Twist(0.3, 0.0)


def test_adds_and_clamps_the_magnitude_to_one() -> None:
    assert twist(decide((0.25, 0.0), (0.25, 0.0))).v == pytest.approx(0.15)
    assert twist(decide((70.0, 0.0), (80.0, 0.0))) == Twist(0.3, 0.0)
    assert twist(decide((1e6, 0.0), (1.0, 0.0))) == Twist(0.3, 0.0)


def test_speed_of_the_base_is_the_limit() -> None:
    assert twist(decide((1.0, 0.0), config=ArbiterConfig(base_velocity_m_s=9.0))).v == BODY.speed_max_m_s


@pytest.mark.parametrize(
    ("angle_deg", "v"),
    [(0.0, 0.3), (22.5, 0.2), (45.0, 0.1), (67.5, 0.05), (90.0, 0.0), (135.0, 0.0), (180.0, 0.0)],
)
@pytest.mark.parametrize("heading", [0.0, 2.0, -17.0 * math.pi])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_slows_and_turns_towards_the_sum(angle_deg: float, v: float, heading: float, side: float) -> None:
    angle = side * math.radians(angle_deg)
    got = twist(decide((math.cos(heading + angle), math.sin(heading + angle)), percept=at(heading)))
    assert got.v == pytest.approx(v, abs=1e-12)
    if angle_deg < 180.0:
        assert got.w == pytest.approx(max(-1.0, min(1.0, 2.0 * angle)), abs=1e-12)
    else:
        assert abs(got.w) == 1.0


def test_speed_never_rises_with_the_angle() -> None:
    speeds = [twist(decide((math.cos(a), math.sin(a)))).v for a in np.linspace(0.0, math.pi, 500).tolist()]
    assert all(later <= earlier for earlier, later in pairwise(speeds))


def test_cautious_velocity_above_base_velocity_does_not_hurry_turns() -> None:
    config = ArbiterConfig(base_velocity_m_s=0.1, cautious_velocity_m_s=5.0)
    assert twist(decide((1.0, 1.0), config=config)).v == pytest.approx(0.1)


@pytest.mark.parametrize("vectors", [((0.0, 0.0),), ((1.0, 0.0), (-1.0, 0.0)), ((1.0, 0.0), (-1.0, 0.0099)), ()])
def test_balanced_responses_stop(vectors: tuple[tuple[float, float], ...]) -> None:
    assert twist(decide(*vectors)) == Twist(0.0, 0.0)


def test_schemas_may_respond_in_any_order() -> None:
    responses = [Response("left", 0.0, 0.5), Response("ahead", 1.0, 0.0)]
    found = [arbitrate(responses, at(), BODY, CONFIG, names) for names in (["left", "ahead"], ["ahead", "left"])]
    assert isinstance(found[0], Drive)
    assert found[0] == found[1]


def test_missing_schema_stops_and_names_it() -> None:
    given = [Response("move_ahead", 1.0, 0.0)]
    decision = arbitrate(given, at(), BODY, CONFIG, ["move_ahead", "avoid_static_obstacle"])
    assert "avoid_static_obstacle" in reason(decision)
    assert "move_ahead" not in reason(decision)


@pytest.mark.parametrize("extra", ["move_ahead", "stranger"])
def test_an_unexpected_response_stops_and_is_named(extra: str) -> None:
    given = [Response("move_ahead", 1.0, 0.0), Response(extra, 1.0, 0.0)]
    said = reason(arbitrate(given, at(), BODY, CONFIG, ["move_ahead"]))
    assert said.startswith(f"the schema {extra} answered without being asked")


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_non_finite_vector_stops_and_is_named(bad: float) -> None:
    assert "schema s1" in reason(decide((1.0, 0.0), (0.0, bad)))
    assert "schema s0" in reason(decide((bad, 0.0), (0.0, 1.0)))


@pytest.mark.parametrize(
    ("bad", "shown"),
    [(None, "None"), ("ahead" * 9, "'" + "aheadaheadaheadahea"), (10**400, "1" + 19 * "0"), (math.nan, "nan")],
)
def test_a_value_that_is_not_a_float_stops_and_is_shown(bad: Any, shown: str) -> None:
    assert f"the schema s1 answered (0, {shown})," in reason(decide((1.0, 0.0), (0.0, bad)))


def test_vectors_too_large_to_add_stop() -> None:
    assert "too large" in reason(decide((1e308, 0.0), (1e308, 0.0)))
    assert "too large" in reason(decide((0.0, -1e308), (0.0, -1e308)))


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("part", ["x", "y", "theta"])
def test_a_non_finite_pose_stops(bad: float, part: str) -> None:
    values = {"x": 0.0, "y": 0.0, "theta": 0.0, part: bad}
    decision = decide((1.0, 0.0), percept=Percept(Pose(**values), np.empty((0, 2)), EVERYWHERE))
    assert "pose" in reason(decision)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_non_finite_echo_stops_even_if_no_schema_uses_it(bad: float) -> None:
    assert "echo" in reason(decide((1.0, 0.0), percept=at(0.0, (5.0, 0.0), (1.0, bad))))


def test_slows_and_stops_before_an_echo_ahead() -> None:
    """Rim 0.4 m and clearance 0.1 m: an echo at 0.5 m leaves no path, one at 0.625 m allows √(2·0.5·0.125) m/s."""
    assert twist(decide((1.0, 0.0), percept=at(0.0, (0.5, 0.0)))) == Twist(0.0, 0.0)
    assert twist(decide((1.0, 0.0), percept=at(0.0, (0.3, 0.1)))).v == 0.0
    fast = ArbiterConfig(base_velocity_m_s=0.5, clearance_m=0.1)
    assert twist(decide((1.0, 0.0), percept=at(0.0, (0.625, 0.0)), config=fast)).v == pytest.approx(math.sqrt(0.125))
    assert twist(decide((1.0, 0.0), percept=at(0.0, (-0.3, 0.0), (0.3, 0.51), (0.3, -0.51)))).v == 0.3


def test_cancelling_pushes_do_not_drive_it_into_an_obstacle() -> None:
    decision = decide((1.0, 0.0), (-1e6, 0.0), (1e6, 0.0), percept=at(0.0, (0.45, 0.0), (-0.45, 0.0)))
    assert twist(decision).v == 0.0


def test_may_turn_where_it_may_not_drive() -> None:
    got = twist(decide((0.8, 0.6), percept=at(0.0, (0.45, 0.0))))
    assert got.v == 0.0
    assert got.w == 1.0


def test_never_over_a_limit_never_nan() -> None:
    """Decisions on vectors of every magnitude, many non-finite: each is a Stop or within all limits."""
    rng = np.random.default_rng(20)
    n = 5000
    sizes = 10.0 ** rng.uniform(-320.0, 308.0, (n, 2, 2)) * rng.choice([-1.0, 1.0], (n, 2, 2))
    special = rng.choice([0.0, -0.0, 1.0, 1e6, math.nan, math.inf, -math.inf, 1.7e308], (n, 2, 2))
    vectors = np.where(rng.random((n, 2, 2)) < 0.3, special, sizes)
    vectors = np.where(rng.random((n, 1, 1)) < 0.6, rng.normal(0.0, 1.0, (n, 2, 2)), vectors)
    headings = np.where(rng.random(n) < 0.02, math.nan, rng.uniform(-1.0, 1.0, n) * 10.0 ** rng.uniform(0, 6, n))
    points = rng.uniform(-1.0, 1.0, (64, 3, 2))
    stops = 0
    for i, (rows, heading) in enumerate(zip(vectors.tolist(), headings.tolist(), strict=True)):
        percept = Percept(Pose(0.0, 0.0, heading), points[i % 64], EVERYWHERE)
        given = [Response("a", *rows[0]), Response("b", *rows[1])]
        decision = arbitrate(given, percept, BODY, CONFIG, ("a", "b"))
        if isinstance(decision, Stop):
            stops += 1
            broken = not (np.isfinite(vectors[i]).all() and math.isfinite(heading))
            assert broken or not all(map(math.isfinite, map(sum, zip(*rows, strict=True)))), (rows, decision)
        else:
            v, w = decision.twist.v, decision.twist.w
            assert 0.0 <= v <= BODY.speed_max_m_s
            assert -BODY.turn_max_rad_s <= w <= BODY.turn_max_rad_s
    assert 0.05 * n < stops < 0.5 * n
