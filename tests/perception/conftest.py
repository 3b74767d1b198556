"""Fixtures of perceptions to edit, computed once for each test file: see `tests.perception.edited`."""

from __future__ import annotations

import pytest

from config.load import load_world
from drivers.messages import Firing
from perception.pipeline import Perception
from perception.snapshot import Snapshot
from tests.perception.edited import EARLY, SEEN_TO_FT, fresh, hear, passed
from tests.perception.halls import drive


@pytest.fixture(scope="module")
def firings() -> list[Firing]:
    """Return a drive past the first four drums, and another one past 3 ft of them."""
    once = list(drive(load_world("hallway"), (-4.0, SEEN_TO_FT)))
    return [*once, *drive(load_world("hallway"), (-1.0, 3.0), begin_s=once[-1].robot_s + 1.0, y_ft=0.5)]


@pytest.fixture(scope="module", params=["paper", pytest.param("bayes", marks=pytest.mark.compiled)])
def remembered(request: pytest.FixtureRequest, firings: list[Firing]) -> tuple[str, Snapshot]:
    """Return a method's name and its state after the first drive."""
    perception = fresh(request.param)
    for firing in passed(firings):
        hear(perception, firing)
    return request.param, perception.snapshot()


@pytest.fixture(scope="module")
def early(firings: list[Firing]) -> Snapshot:
    """Return the state of the Bayesian method when it reaches the first drums."""
    perception = fresh("bayes")
    for firing in firings[:EARLY]:
        hear(perception, firing)
    return perception.snapshot()


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
