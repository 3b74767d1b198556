"""Boot numbers of one robot that restarts, and of two robots on one line."""

from __future__ import annotations

from itertools import pairwise

import pytest

from drivers.denning.boot_numbers import TWO_RESTARTS_S, BootNumbers


@pytest.mark.parametrize(
    ("numbers", "step_s", "are_two"),
    [
        ((1, 2, 1), 1.0, True),
        ((1, 2, 1), TWO_RESTARTS_S, False),
        ((1, 1, 1), 0.1, False),
        ((1, 2, 3, 1), 0.1, False),
        ((1, 1, 2, 2, 1), 1.0, True),
    ],
    ids=["in turn", "restarts of few numbers", "one", "restarts", "each twice"],
)
def test_a_number_that_comes_back_soon_is_another_robots(
    numbers: tuple[int, ...], step_s: float, *, are_two: bool
) -> None:
    boots = BootNumbers()
    said = [boots.are_of_two(*pair, step_s * k) for k, pair in enumerate(pairwise(numbers))]
    assert any(said) == are_two
