"""The speed that the field of view allows, against a slow oracle, and the reasons that name sensors."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviors.arbiter import Drive, Unseen, arbitrate, limit_velocity
from behaviors.response import Response
from behaviors.surroundings.field_of_view import (
    REACTION_S,
    angle_to_look,
    listed,
    oldest_look_s,
    path_half_angle_rad,
    presumed_ahead_rad,
    seen_for_s,
    seen_speed_m_s,
    unseen_way,
)
from config.behaviors import ArbiterConfig
from config.robot import BodyConfig
from perception.percept import FieldOfView, Percept, Pose, Twist
from tests.behaviors.views import EVERYWHERE, ring_view

BODY = BodyConfig(radius_m=0.381, speed_max_m_s=0.5, turn_max_rad_s=1.0, acceleration_max_m_s2=0.5)
CLEARANCE_M = 0.16
HALF_ANGLE = math.asin(0.381 / 0.541)
NEW = np.full(24, 0.2)


def ages(**others: float) -> np.ndarray:
    """Return the ages of 24 looks, s: `s5=2.0` for sensor 5, .2 for the others."""
    found = NEW.copy()
    for name, age_s in others.items():
        found[int(name[1:])] = age_s
    return found


def percept(view: FieldOfView, theta: float = 0.0, *echoes: tuple[float, float]) -> Percept:
    return Percept(Pose(0.0, 0.0, theta), np.array(echoes, dtype=np.float64).reshape(-1, 2), view)


def speed(view: FieldOfView, theta: float = 0.0, turn_rad_s: float = 0.0) -> float:
    return seen_speed_m_s(percept(view, theta), BODY, CLEARANCE_M, turn_rad_s)


def naive_ages_s(view: FieldOfView, directions: np.ndarray) -> np.ndarray:
    """Return the age of each direction: that of the youngest beam that covers it."""
    found = np.full(len(directions), math.inf)
    for bearing, age_s in zip(view.bearings_rad.tolist(), view.ages_s.tolist(), strict=True):
        covered = np.cos(directions - bearing) >= math.cos(view.half_angle_rad)
        found[covered] = np.minimum(found[covered], age_s)
    return found


def test_the_oldest_direction_agrees_with_the_oracle() -> None:
    rng = np.random.default_rng(1)
    unseen = 0
    for _ in range(40):
        count = int(rng.integers(1, 30))
        bearings = rng.uniform(-9.0, 9.0, count)
        half_angle, direction = float(rng.uniform(0.1, 1.5)), float(rng.uniform(-9.0, 9.0))
        looked = rng.uniform(0.0, 1.5, count)
        view = FieldOfView(bearings, looked, bearings, looked, float(rng.uniform(0.1, 1.5)), 8.0, 1.5)
        oldest_s = oldest_look_s(view, direction, half_angle)
        offs = np.linspace(-half_angle, half_angle, 20_001)[1:-1]
        assert oldest_s == naive_ages_s(view, direction + offs).max()
        unseen += math.isinf(oldest_s)
    assert 5 < unseen < 35, "both were tried"


def test_without_a_look_nothing_is_seen() -> None:
    nothing = FieldOfView(np.empty(0), np.empty(0), np.zeros(24), np.full(24, math.inf), 0.2, 8.0, 1.5)
    assert speed(nothing) == 0.0
    assert oldest_look_s(nothing, 0.0, 0.5) == math.inf


def test_the_path_leaves_the_clearance_within_this_angle() -> None:
    assert path_half_angle_rad(BODY, CLEARANCE_M) == pytest.approx(HALF_ANGLE)
    assert path_half_angle_rad(BODY, 0.0) == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(("age_s", "expected"), [(0.2, 0.65), (0.9, 0.3), (1.4, 0.05), (1.5, 0.0), (9.0, 0.0)])
@pytest.mark.parametrize("sensor", [0, 1, 3, 21])
def test_it_can_stand_before_the_oldest_direction_ahead_is_too_old(
    sensor: int, age_s: float, expected: float
) -> None:
    assert speed(ring_view(ages(**{f"s{sensor}": age_s}))) == pytest.approx(expected)


@pytest.mark.parametrize("sensor", [4, 6, 12, 20])
def test_a_sensor_that_looks_elsewhere_does_not_matter(sensor: int) -> None:
    assert speed(ring_view(ages(**{f"s{sensor}": math.inf}))) == pytest.approx(0.65)


def test_where_two_beams_overlap_the_younger_one_counts() -> None:
    assert speed(ring_view(ages(s0=1.4), half_angle_deg=16.0)) == pytest.approx(0.65)
    assert speed(ring_view(NEW, half_angle_deg=7.5)) == pytest.approx(0.65), "beams that only just meet leave no gap"
    assert speed(ring_view(NEW, half_angle_deg=7.4)) == 0.0


def test_a_short_window_limits_the_speed() -> None:
    """It shows free space for 1 m from the centre: .459 m beyond the clearance."""
    assert speed(ring_view(NEW, reach_m=1.0)) == pytest.approx(0.65)
    assert speed(ring_view(NEW, reach_m=0.641)) == pytest.approx(math.sqrt(0.1))
    assert speed(ring_view(NEW, reach_m=0.541)) == pytest.approx(0.0, abs=1e-6)


def test_a_turn_towards_the_unseen_slows_down() -> None:
    """Sensor 6 looks at 90°: the others see up to 87° on its side, 42.2° beyond the path."""
    view = ring_view(ages(s6=math.inf))
    beyond = math.radians(87.0) - HALF_ANGLE
    assert speed(view) == pytest.approx(0.65)
    for w in (1.0, -1.0):
        assert speed(view, 0.0, w) == pytest.approx(0.5 * (beyond - REACTION_S))
    assert speed(view, beyond - 0.1, 1.0) == pytest.approx(0.0, abs=1e-9)
    assert speed(ring_view(NEW), 0.0, 1.0) == pytest.approx(0.65)
    assert speed(ring_view(ages(s6=0.9)), 0.0, 1.0) == pytest.approx(0.5 * (beyond - REACTION_S)), "too old by then"
    assert speed(ring_view(ages(s6=0.8)), 0.0, 1.0) == pytest.approx(0.35), "the turn arrives before that"


def test_the_time_until_a_turning_path_is_unseen_agrees_with_the_oracle() -> None:
    """Let time pass in small steps until the path, widened by the turn, has a direction that is too old by then."""
    rng = np.random.default_rng(3)
    found = []
    for _ in range(40):
        view = ring_view(np.where(rng.random(24) < 0.1, math.inf, rng.uniform(0.0, 1.5, 24)), half_angle_deg=16.0)
        heading, half_angle, rate = (float(rng.uniform(*ends)) for ends in ((-9.0, 9.0), (0.1, 0.8), (0.2, 1.0)))
        offs = np.linspace(-2.0, 2.0, 4001)
        ages_s, beyond = naive_ages_s(view, heading + offs), np.maximum(0.0, np.abs(offs) - half_angle)
        naive_s = 0.0
        while naive_s < 1.0:
            in_path = (beyond == 0.0) | (beyond < rate * (naive_s + REACTION_S))
            if (ages_s[in_path] + naive_s > 1.5).any():
                break
            naive_s += 0.001
        seen_s = seen_for_s(view, heading, half_angle, rate, 1.0)
        found.append(seen_s)
        assert min(max(seen_s, 0.0), 1.0) == pytest.approx(min(naive_s, 1.0), abs=0.01), "a step of either grid"
    assert sum(0.0 < seen_s < 1.0 for seen_s in found) > 5


@pytest.mark.parametrize(
    ("view", "direction", "reason"),
    [
        (ring_view(ages(s0=3.14)), 0.0, "the ring has not looked ahead for 3.1 s: no usable range from sensor 0"),
        (
            ring_view(ages(s0=3.14, s23=2.0, s12=9.0, s1=math.inf)), 0.0,
            "the ring has not looked ahead yet: no usable range from sensor 0, 1, 23",
        ),
        (
            ring_view(ages(s18=2.0)), -math.pi / 2,
            "the ring has not looked 90° to the right of the heading for 2.0 s: no usable range from sensor 18",
        ),
        (
            ring_view(NEW, half_angle_deg=5.0), 0.5,
            "the ring has not looked 29° to the left of the heading yet: "
            "the beams of sensor 0, 1, 2, 3, 4, 5, 23 leave parts of the body's way out",
        ),
        (
            ring_view(NEW[:1]), 0.0,
            "the ring has not looked ahead yet: the beams of sensor 0 leave parts of the body's way out",
        ),
        (
            ring_view(NEW[:1]), 3.0,
            "the ring has not looked 172° to the left of the heading yet: no sensor of the ring looks there",
        ),
    ],
)  # fmt: skip
def test_a_reason_names_the_sensors(view: FieldOfView, direction: float, reason: str) -> None:
    unseen = unseen_way(percept(view), direction, BODY, CLEARANCE_M)
    assert unseen is not None
    assert unseen.reason == reason
    assert unseen_way(percept(ring_view(NEW)), direction, BODY, CLEARANCE_M) is None


def test_of_many_sensors_the_first_are_named() -> None:
    assert listed(()) == ""
    assert listed(range(8)) == "0, 1, 2, 3, 4, 5, 6, 7"
    assert listed(range(9)) == "0, 1, 2, 3, 4, 5, 6, 7 …"


CONFIG = ArbiterConfig()


def decide(view: FieldOfView, course: float, theta: float = 0.0) -> Drive | Unseen:
    responses = [Response("ahead", math.cos(course), math.sin(course))]
    decision = arbitrate(responses, percept(view, theta), BODY, CONFIG, ["ahead"])
    assert isinstance(decision, Drive | Unseen)
    return decision


def test_the_arbiter_slows_down_and_then_stops_with_the_sensors() -> None:
    assert decide(ring_view(ages(s0=1.2)), 0.0) == Drive(Twist(pytest.approx(0.15), 0.0))  # type: ignore[arg-type]
    decision = decide(ring_view(ages(s0=1.6)), 0.0)
    assert isinstance(decision, Unseen)
    assert decision.age_s == 1.6
    assert decision.reason == (
        "the ring has not looked ahead for 1.6 s: no usable range from sensor 0; check the ring's cables and what "
        "covers it, then re-arm"
    )


def test_the_arbiter_turns_to_where_it_sees() -> None:
    """Ahead is unseen, to the left it sees: it turns on the spot, and drives once it looks there."""
    view = ring_view(ages(s0=9.0))
    assert decide(view, math.pi / 2) == Drive(Twist(0.0, 1.0))
    driven = decide(view, math.pi / 2, math.pi / 2)
    assert isinstance(driven, Drive)
    assert driven.twist.v == pytest.approx(0.3)
    assert decide(ring_view(ages(s6=9.0)), math.pi / 2) == Drive(Twist(0.0, 1.0)), "and sees when it gets there"
    assert isinstance(decide(ring_view(ages(s6=9.0)), math.pi / 2, math.pi / 2), Unseen)


@pytest.mark.parametrize(("ahead_s", "left_s"), [(2.0, 9.0), (9.0, 2.0)])
def test_where_neither_heading_nor_course_is_seen_the_younger_look_is_reported(ahead_s: float, left_s: float) -> None:
    decision = decide(ring_view(ages(s0=ahead_s, s6=left_s)), math.pi / 2)
    assert isinstance(decision, Unseen)
    assert decision.age_s == 2.0


def test_an_unseen_direction_that_the_sensors_will_look_in_next_is_no_reason_to_stop() -> None:
    """The ring has turned by half of a beam's distance and more since the looks."""
    view = ring_view(NEW)
    turned = FieldOfView(view.bearings_rad[::2], NEW[::2], view.axes_rad, NEW, view.half_angle_rad, 8.0, 1.5)
    assert decide(turned, 0.0) == Drive(Twist(0.0, 0.0))


def test_an_operator_may_drive_where_the_ring_looks() -> None:
    view = ring_view(ages(s0=9.0))
    for v, expected in ((0.3, 0.0), (-0.3, -0.3)):
        request = Response("t", v / CONFIG.base_velocity_m_s, 0.0)
        decision = limit_velocity(Twist(v, 0.2), [request], percept(view), BODY, CONFIG, ["t"])
        assert isinstance(decision, Drive)
        assert decision.twist.v == pytest.approx(expected)
        assert decision.twist.w == pytest.approx(0.2)


def test_no_field_of_view_lets_the_arbiter_drive_towards_an_unseen_direction() -> None:
    rng = np.random.default_rng(2)
    moved = 0
    for _ in range(200):
        view = ring_view(np.where(rng.random(24) < 0.1, math.inf, rng.uniform(0.0, 1.6, 24)))
        theta = float(rng.uniform(-9.0, 9.0))
        decision = decide(view, theta + float(rng.uniform(-1.0, 1.0)), theta)
        v = decision.twist.v if isinstance(decision, Drive) else 0.0
        oldest_s = oldest_look_s(view, theta, HALF_ANGLE)
        assert v <= 0.5 * max(0.0, 1.5 - oldest_s)
        moved += v > 0.0
    assert moved > 30


def test_the_view_of_other_tests_limits_nothing() -> None:
    assert seen_speed_m_s(percept(EVERYWHERE, 2.0), BODY, 0.0, 1.0) > BODY.speed_max_m_s


def unknown(*directions_deg: float, theta: float = 0.0) -> Percept:
    return percept(replace(EVERYWHERE, unknown_rad=np.radians(directions_deg)), theta)


def test_it_looks_at_the_nearest_unknown_direction_within_a_right_angle_of_its_course() -> None:
    assert angle_to_look(unknown(), 0.0) is None
    assert angle_to_look(unknown(80.0, -60.0, 170.0), 0.0) == pytest.approx(math.radians(-60.0))
    assert angle_to_look(unknown(80.0, -60.0, theta=math.radians(30.0)), 0.0) == pytest.approx(math.radians(50.0))
    assert angle_to_look(unknown(120.0, -95.0), 0.0) is None


def presuming(*feet: tuple[float, float]) -> Percept:
    return percept(replace(EVERYWHERE, presumed=np.array(feet)), 0.0, *feet)


def test_it_looks_at_a_presumed_wall_that_stops_it_and_at_no_other() -> None:
    """A robot with three sensors stood for ever before a box that it had passed, as if that were a wall."""
    beside, ahead = (0.38, 0.3), (0.6, 0.0)  # .484 m away, and beyond the clearance
    assert presumed_ahead_rad(presuming(beside, ahead, (-0.3, 0.3), (0.1, 0.5)), BODY, CLEARANCE_M) == pytest.approx(
        [math.atan2(0.3, 0.38)]
    )
    assert len(presumed_ahead_rad(percept(EVERYWHERE, 0.0, beside), BODY, CLEARANCE_M)) == 0
    config, request = ArbiterConfig(clearance_m=CLEARANCE_M), (Response("s", 1.0, 0.0),)
    turning = arbitrate(request, presuming(beside), BODY, config, ["s"])
    assert isinstance(turning, Drive)
    assert turning.twist.v == 0.0
    assert turning.twist.w > 0.5
    assert arbitrate(request, percept(EVERYWHERE, 0.0, beside), BODY, config, ["s"]) == Drive(Twist(0.0, 0.0))


def test_the_arbiter_turns_there_before_it_drives_and_an_operator_drives_cautiously() -> None:
    config, ahead = ArbiterConfig(clearance_m=CLEARANCE_M), (Response("s", 1.0, 0.0),)
    turning = arbitrate(ahead, unknown(-60.0), BODY, config, ["s"])
    assert isinstance(turning, Drive)
    assert turning.twist.v == 0.0
    assert turning.twist.w < -0.5
    on_synchro = arbitrate(ahead, unknown(-60.0), BODY.model_copy(update={"synchro": True}), config, ["s"])
    assert on_synchro == arbitrate(ahead, unknown(), BODY, config, ["s"])
    stick = limit_velocity(Twist(0.3, 0.0), ahead, unknown(-60.0), BODY, config, ["s"])
    assert isinstance(stick, Drive)
    assert stick.twist.v == config.cautious_velocity_m_s
