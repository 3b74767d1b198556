"""Fixtures of perceptions to edit, computed once in each process: see `tests.perception.edited`."""

from __future__ import annotations

from functools import cache

import pytest

from config.load import load_world
from drivers.messages import Firing
from perception.pipeline import Perception
from perception.snapshot import Snapshot
from tests.perception.edited import EARLY, SEEN_TO_FT, fresh, hear, passed
from tests.perception.halls import drive


@cache
def two_drives() -> list[Firing]:
    """Return a drive past the first four drums, and another one past 3 ft of them."""
    once = list(drive(load_world("hallway"), (-4.0, SEEN_TO_FT)))
    return [*once, *drive(load_world("hallway"), (-1.0, 3.0), begin_s=once[-1].robot_s + 1.0, y_ft=0.5)]


@cache
def state_after(method: str, count: int | None) -> Snapshot:
    """Return a method's state after so many firings of the first drive, None for all; what restores it copies it."""
    perception = fresh(method)
    for firing in [*passed(two_drives())][:count]:
        hear(perception, firing)
    return perception.snapshot()


@pytest.fixture(scope="module")
def firings() -> list[Firing]:
    return two_drives()


@pytest.fixture(scope="module", params=["paper", pytest.param("bayes", marks=pytest.mark.compiled)])
def remembered(request: pytest.FixtureRequest) -> tuple[str, Snapshot]:
    """Return a method's name and its state after the first drive."""
    return request.param, state_after(request.param, None)


@pytest.fixture(scope="module")
def early() -> Snapshot:
    """Return the state of the Bayesian method when it reaches the first drums."""
    return state_after("bayes", EARLY)


@pytest.fixture
def seen(remembered: tuple[str, Snapshot]) -> Perception:
    method, memory = remembered
    perception = fresh(method)
    perception.restore(memory)
    return perception


@pytest.fixture
def reached_drums(early: Snapshot) -> Perception:
    perception = fresh("bayes")
    perception.restore(early)
    return perception
