"""Odometry that comes too rarely differs from a restart, a loose cable, and a program that is late itself."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from drivers.odometry_gaps import RARE, OdometryGaps


def looks(gaps: OdometryGaps, samples: Iterable[float], until_s: float, step_s: float = 0.05) -> list[str | None]:
    """Look at each step whether a sample has come; return what is wrong after each look."""
    due, problems = sorted(samples), list[str | None]()
    for k in range(round(until_s / step_s)):
        came = [s for s in due if s <= k * step_s]
        due = due[len(came) :]
        gaps.look(k * step_s, came=bool(came))
        problems.append(gaps.problem(k * step_s))
    return problems


def test_odometry_that_comes_too_rarely_is_one_steady_problem() -> None:
    problems = looks(OdometryGaps(0.4), range(20), 20.0)
    first = next(k for k, problem in enumerate(problems) if problem is not None)
    assert first <= 61, "after the second gap: the sample before the first look does not count"
    assert set(problems[first:]) == {RARE.format(0.4, 0.2)}


@pytest.mark.parametrize("gap_s", [0.39, 2.0, 30.0])
def test_one_gap_is_a_restart_or_a_loose_cable(gap_s: float) -> None:
    samples = [t + n * gap_s for n in range(5) for t in (n + 0.0, n + 0.1, n + 0.2)]
    assert set(looks(OdometryGaps(0.4), samples, 5.0 * gap_s)) == {None}


def test_a_robot_that_is_switched_off_or_well_again_has_no_rare_odometry() -> None:
    well = looks(OdometryGaps(0.4), [0.0, 1.0, 2.0, 3.0, *(3.1 + 0.1 * k for k in range(20))], 5.0)
    assert (well[-1], well[60] is not None) == (None, True)
    assert looks(OdometryGaps(0.4), [0.0, 1.0, 2.0], 6.0)[-1] is None


def test_samples_that_follow_each_other_between_gaps_do_not_make_the_line_flap() -> None:
    problems = looks(OdometryGaps(0.4), [0.9 * k + s for k in range(20) for s in (0.0, 0.3)], 17.0)
    first = next(k for k, problem in enumerate(problems) if problem is not None)
    assert first <= 61
    assert None not in problems[first:]


def test_gaps_are_found_where_the_line_may_be_silent_for_two_cycles_only() -> None:
    gaps = OdometryGaps(0.1)
    assert looks(gaps, [0.2 * k for k in range(20)], 4.0)[-1] is not None
    gaps.begin()
    assert gaps.problem(4.0) is None
    assert set(looks(OdometryGaps(0.1), [0.06 * k for k in range(100)], 6.0)) == {None}


def test_a_program_that_is_late_itself_accuses_no_robot() -> None:
    assert set(looks(OdometryGaps(0.4), [0.1 * k for k in range(200)], 20.0, step_s=0.6)) == {None}
