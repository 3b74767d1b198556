"""Perception as a whole: the method that the settings name, the check of a firing's size, and a reset."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_model, load_settings, load_world
from drivers.messages import Firing, Pose
from perception.bayes.bayes_method import BayesPerception
from perception.paper.paper_method import PaperPerception
from perception.pipeline import Perception, make_method
from tests.perception.edited import settle
from tests.perception.halls import drive, settings


@pytest.mark.parametrize(("name", "kind"), [("paper", PaperPerception), ("bayes", BayesPerception)])
def test_the_settings_name_the_method(name: str, kind: type) -> None:
    chosen = load_settings("hallway", [f"perception.method={name}"])
    assert isinstance(make_method(chosen.ring, chosen.models, chosen.perception), kind)


@pytest.mark.parametrize("count", [0, 23, 25])
def test_a_firing_of_another_ring_is_refused(count: int) -> None:
    """Kernels do not check the bounds of an array, so a wrong size must not reach them."""
    chosen = settings()
    perception = Perception(chosen.ring, chosen.models, chosen.perception)
    with pytest.raises(ValueError, match=f"a firing of {count} ranges, but the ring has 24 sensors"):
        perception.observe(Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, np.full(count, 2.0)))


@pytest.mark.compiled
def test_a_reset_empties_the_map() -> None:
    chosen = settings()
    perception = Perception(chosen.ring, chosen.models, chosen.perception)
    for firing in drive(load_world("hallway"), (-6.0, 5.0)):
        perception.observe(firing)
        settle(perception)
    assert perception.objects()
    perception.reset()
    assert perception.objects() == ()
    assert not perception.can_refine
    assert len(perception.obstacles(1e9, math.inf)) == 0
    for firing in drive(load_world("hallway")):
        perception.observe(firing)
        settle(perception)
    assert len(perception.objects()) == 6


@pytest.mark.compiled
def test_of_two_models_the_better_fit_is_reported() -> None:
    shipped = settings()
    models = (load_model("box"), load_model("semicircle"))
    perception = Perception(shipped.ring, models, shipped.perception)
    for firing in drive(load_world("hallway")):
        perception.observe(firing)
        settle(perception)
    assert [o.model for o in perception.objects()].count("semicircle") == 6
