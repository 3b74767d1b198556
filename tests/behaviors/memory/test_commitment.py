"""Commands that do not chatter: starts wait, turns keep their side, and nothing else ever waits."""

from __future__ import annotations

import itertools
import math
import random

import pytest

from behaviors.memory.commitment import FAINT_RAD_S, OPPOSITE_RAD, START_S, TURN_S, Commitment
from perception.percept import Twist

CYCLE_S = 0.05


def test_a_robot_that_has_just_started_and_stopped_waits_before_it_starts_again() -> None:
    commitment = Commitment()
    speeds = []
    for k in range(100):
        twist, commitment = commitment.commit(Twist(0.2 if k % 3 == 0 else 0.0, 0.1), k * CYCLE_S)
        speeds.append(twist.v)
        assert twist.w == 0.1, "it turns meanwhile"
    starts = [k * CYCLE_S for k in range(100) if speeds[k] and not (k and speeds[k - 1])]
    assert starts == pytest.approx([0.0, 2.1, 4.2])


@pytest.mark.parametrize("seed", range(50))
def test_whatever_is_decided_changes_sign_or_standstill_once_a_second_at_most(seed: int) -> None:
    """And a command is never faster than decided, and never anything else than that or no speed."""
    rng, commitment = random.Random(seed), Commitment()
    before, changes, run_s = 0, 0, 0.0
    while run_s < 60.0:
        run_s += rng.uniform(0.01, 0.3)
        decided = Twist(rng.choice([0.0, rng.uniform(0.0, 1.0), 0.3]), rng.uniform(-1.0, 1.0))
        twist, commitment = commitment.commit(decided, run_s)
        assert twist in (decided, Twist(0.0, decided.w))
        assert twist.v == decided.v or commitment.started_run_s is not None
        changes += (twist.v > 0.0) != before
        before = twist.v > 0.0
    assert changes <= 2 + 60.0 / START_S * 2


def test_a_robot_that_moved_for_longer_starts_again_at_once() -> None:
    _, commitment = Commitment().commit(Twist(0.2, 0.0), 0.0)
    _, commitment = commitment.commit(Twist(0.0, 0.0), START_S)
    twist, _ = commitment.commit(Twist(0.2, 0.0), START_S + CYCLE_S)
    assert twist.v == 0.2


@pytest.mark.parametrize("free_s", [0.1, 0.3, 0.9, 1.5])
def test_stops_that_come_again_and_again_do_not_keep_it_standing(free_s: float) -> None:
    """As a wall at the edge of a beam does to a robot that turns: it waited for a quiet second, and came nowhere."""
    commitment, starts, before = Commitment(), 0, False
    period = round(free_s / CYCLE_S) + 1
    for k in range(1200):
        twist, commitment = commitment.commit(Twist(0.2 if k % period else 0.0, 0.1), k * CYCLE_S)
        starts, before = starts + (twist.v > 0.0 and not before), twist.v > 0.0
    assert starts >= 60.0 / (START_S + free_s + 2.0 * CYCLE_S) - 1.0


def test_another_direction_of_the_stick_never_waits() -> None:
    commitment = Commitment()
    for k, v in enumerate((0.2, -0.2, 0.0, 0.2, 0.0, -0.2)):
        twist, commitment = commitment.commit(Twist(v, 0.0), k * CYCLE_S, (v > 0.0) - (v < 0.0))
        assert twist.v == v


def test_a_turn_to_an_opposite_course_keeps_its_side() -> None:
    """The course trembles about straight behind; the robot comes round."""
    rng, heading, commitment = random.Random(1), 0.0, Commitment(turn_rad_s=0.5)
    for _ in range(200):
        angle = math.remainder(math.pi + rng.uniform(-0.3, 0.3) - heading, math.tau)
        w = max(-0.5, min(0.5, 2.0 * commitment.kept_angle(angle)))
        _, commitment = commitment.commit(Twist(0.0, w), 0.0)
        heading += CYCLE_S * w
    assert heading == pytest.approx(math.pi, abs=0.3)


@pytest.mark.parametrize("angle_rad", [-0.5, 0.9 * OPPOSITE_RAD, -0.9 * OPPOSITE_RAD])
def test_a_course_that_is_nearer_by_one_side_is_turned_to_by_that_side(angle_rad: float) -> None:
    for turn_rad_s in (-0.5, 0.5):
        assert Commitment(turn_rad_s=turn_rad_s).kept_angle(angle_rad) == angle_rad


@pytest.mark.parametrize("speed_m_s", [0.0, 0.2])
def test_a_turn_to_the_other_side_waits_and_no_other_turn_does(speed_m_s: float) -> None:
    """The course trembles about straight ahead, or from left to right; then it stays on one side."""
    rng, commitment, sides, last = random.Random(2), Commitment(), list[float](), 0
    for k in range(400):
        run_s = k * CYCLE_S
        angle = rng.uniform(-2.0, 2.0) if run_s < 15.0 else 1.0
        w = 2.0 * commitment.kept_angle(angle, run_s)
        assert speed_m_s == 0.0 or w in (0.0, 2.0 * angle)
        twist, commitment = commitment.commit(Twist(speed_m_s, w), run_s)
        side = (twist.w > FAINT_RAD_S) - (twist.w < -FAINT_RAD_S)
        if side not in {0, last}:
            last = side
            sides.append(run_s)
    assert all(b - a >= TURN_S for a, b in itertools.pairwise(sides))
    assert len(sides) > 10
    assert commitment.kept_angle(1.0, 20.0) == 1.0
    assert commitment.turn_rad_s == 2.0


def test_a_turn_waits_for_none_but_that_of_its_own_request() -> None:
    _, commitment = Commitment().commit(Twist(0.2, 0.5), 10.0)
    assert commitment.kept_angle(-0.5, 10.5) == 0.0
    assert commitment.kept_angle(-0.5) == commitment.kept_angle(-0.5, 11.0) == -0.5
    assert commitment.kept_angle(-0.5, 9.0) == -0.5, "a clock that went back"
