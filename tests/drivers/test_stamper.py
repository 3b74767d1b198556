"""What all stampers share: notes for the operator, a bounded rate of firings, and poses without jumps."""

from __future__ import annotations

from config.load import load_robot
from drivers.messages import Flags, Odometry, Pose, Twist
from drivers.stamper import EXCESS_FIRINGS, EXCESS_NOTE_S, FIRINGS_BURST, FIRINGS_SHARE, NOTES_MAX, Stamper

STEP_S = 0.05


def made() -> Stamper:
    return Stamper(load_robot("p3dx").body)


def test_notes_are_taken_once_and_bounded() -> None:
    stamper = made()
    for k in range(NOTES_MAX + 1):
        stamper.note(str(k))
    assert stamper.notes() == tuple(map(str, range(1, NOTES_MAX + 1)))
    assert stamper.notes() == ()


def test_firings_beyond_the_pattern_are_dropped_and_noted_now_and_then() -> None:
    stamper = made()
    assert not any(stamper._is_excess(0.0) for _ in range(1000)), "no pattern is known yet"
    stamper._limit_firings(STEP_S)
    passed = sum(not stamper._is_excess(0.001 * k) for k in range(1000))
    assert passed == FIRINGS_BURST + int(0.999 * FIRINGS_SHARE / STEP_S)
    assert stamper.excess_echoes == 1000 - passed
    assert stamper.notes() == (EXCESS_FIRINGS,)
    for _ in range(1000):
        stamper._is_excess(1.0 + EXCESS_NOTE_S)
    assert stamper.notes() == (EXCESS_FIRINGS,)


def test_a_jump_is_removed_and_noted() -> None:
    stamper = made()

    def sample(robot_s: float, x: float) -> Odometry:
        return Odometry(robot_s, Pose(x, 0.0, 0.0), 0.0, Twist(0.0, 0.0), Flags.NONE, 0)

    assert stamper._without_jump(sample(0.0, 0.0)).pose.x == 0.0
    assert stamper._without_jump(sample(0.1, 5.0)).pose.x == 0.0
    assert stamper.origin.x == 5.0 or stamper.origin.x == -5.0
    assert len(stamper.notes()) == 1
