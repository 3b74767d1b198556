"""Perceptions on which a person does something, each made once a file: see `tests.perception.edited`."""

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
    """A way past the first four drums, and 3 ft of it once more."""
    once = list(drive(load_world("hallway"), (-4.0, SEEN_TO_FT)))
    return [*once, *drive(load_world("hallway"), (-1.0, 3.0), begin_s=once[-1].robot_s + 1.0, y_ft=0.5)]


@pytest.fixture(scope="module", params=["paper", pytest.param("bayes", marks=pytest.mark.compiled)])
def remembered(request: pytest.FixtureRequest, firings: list[Firing]) -> tuple[str, Snapshot]:
    """Return a method, and what it remembers after that way."""
    perception = fresh(request.param)
    for firing in passed(firings):
        hear(perception, firing)
    return request.param, perception.snapshot()


@pytest.fixture(scope="module")
def early(firings: list[Firing]) -> Snapshot:
    """Return what the Bayesian method remembers when it has come to the first drums."""
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
def begun(early: Snapshot) -> Perception:
    perception = fresh("bayes")
    perception.restore(early)
    return perception
