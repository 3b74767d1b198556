"""When a drive to a goal is given up, and the reasons for it."""

from __future__ import annotations

from dataclasses import replace

from behaviors.memory.goal_progress import NOTHING_BESIDE, Beside, Progress, observe_progress
from config.behaviors import MoveToGoalConfig
from perception.percept import Pose

CONFIG = MoveToGoalConfig(stuck_after_s=10.0, stuck_m=0.3, unreachable_after_s=60.0)


def driven(
    places: list[tuple[float, float]],
    *,
    is_blocked: bool = False,
    beside: Beside = NOTHING_BESIDE,
    held: str | None = None,
) -> str | None:
    """Return why a drive is given up that is at these places, a second each, with the goal at (10, 0)."""
    progress = Progress.starting_at(Pose(*places[0], 0.0), 10.0 - places[0][0], 0.0)
    for second, (x, y) in enumerate(places):
        progress = observe_progress(
            progress, Pose(x, y, 0.0), 10.0 - x, float(second), held, CONFIG, is_blocked=is_blocked,
            beside=beside,
        )  # fmt: skip
    return progress.given_up


def test_a_drive_that_comes_nearer_goes_on() -> None:
    assert driven([(0.05 * k, 0.0) for k in range(150)]) is None


def test_a_robot_that_stands_is_stuck_after_a_while() -> None:
    assert driven([(0.0, 0.0)] * 10) is None
    assert driven([(0.0, 0.0)] * 11) == "stuck 10.0 m short of the goal: less than 0.3 m in 10 s"
    assert "in 10 s (no direction is free)" in (driven([(0.0, 0.0)] * 11, held="no direction is free") or "")


def test_a_robot_that_stands_as_near_as_the_map_allows_says_so() -> None:
    assert (driven([(0.0, 0.0)] * 11, is_blocked=True) or "").startswith(
        "the goal is unreachable: the map shows no way"
    )


def test_a_robot_that_circles_is_given_up_later() -> None:
    circling = [(5.0 * (k % 2), 0.0) for k in range(62)]
    assert driven(circling[:61]) is None
    assert (driven(circling) or "").startswith("the goal is unreachable: no nearer than 5.0 m for 60 s")


def test_a_goal_on_which_something_stands_is_given_up_soon() -> None:
    beside = Beside(0.12, 0.25, 0.33)
    assert driven([(5.0 * (k % 2), 0.0) for k in range(11)], beside=beside) is None
    assert driven([(5.0 * (k % 2), 0.0) for k in range(12)], beside=beside) == (
        "the goal is unreachable: something stands there, no nearer than 5.0 m: what stands there is 0.12 m from the "
        "goal, and the robot needs 0.33 m (set the goal 0.25 m farther from it)"
    )


def test_a_goal_too_near_to_a_wall_is_named_whatever_ends_the_drive() -> None:
    beside = Beside(0.28, 0.25, 0.33)
    for is_blocked in (False, True):
        why = driven([(9.5, 0.0)] * 12, is_blocked=is_blocked, beside=beside) or ""
        assert why.endswith(
            "is 0.28 m from the goal, and the robot needs 0.33 m (set the goal 0.05 m farther from it)"
        )
    why = driven([(9.5 - 0.4 * (k % 2), 0.0) for k in range(62)], beside=beside) or ""
    assert "no nearer than 0.5 m for 60 s: what stands there is 0.28 m" in why
    assert "what stands there" not in (
        driven([(9.5, 0.0)] * 12, beside=Beside(0.4, 0.25, 0.33)) or "what stands there"
    )


def test_what_is_given_up_stays_so() -> None:
    assert driven([(0.0, 0.0)] * 11 + [(0.1 * k, 0.0) for k in range(50)]) is not None


def test_a_detour_is_no_fault_while_it_lasts() -> None:
    begin, far = Progress.starting_at(Pose(0.0, 0.0, 0.0), 10.0, 0.0), Pose(5.0, 0.0, 0.0)
    after = observe_progress(replace(begin, excused_run_s=59.0), far, 12.0, 100.0, None, CONFIG)
    assert after.given_up is None
    assert after.nearer_run_s == 0.0, "it made no progress all the same"
    assert observe_progress(after, Pose(8.0, 0.0, 0.0), 12.0, 119.0, None, CONFIG).given_up is not None
