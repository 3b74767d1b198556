"""Every number that perception remembers has a bound beside it, and every bound is of a number."""

from __future__ import annotations

import itertools
from typing import Annotated, get_args

import numpy as np
import pytest

from config.load import load_settings, with_known_room
from config.settings import GridConfig, PerceptionConfig, Settings
from perception.bounds import FLAG, PLACE, UNHEARD, Bound, Count, Finite, bounds, index_of, up_to
from perception.kernel import Floats
from perception.pipeline import Perception
from perception.records import Record, Records, zeros
from perception.snapshot import bounds_of, is_scratch, numbers_of

METHODS = get_args(PerceptionConfig.model_fields["method"].annotation)
GRIDS = get_args(GridConfig.model_fields["method"].annotation)
PLACES = ("odometry", "drift", "room")


def settings_of(method: str, grid: str, place: str) -> Settings:
    sets = [f"perception.method={method}", f"perception.grid.method={grid}"]
    if place == "drift":
        sets.append("perception.localization.correct_drift=true")
    settings = load_settings("hallway", sets, models=("drum", "box"))
    return with_known_room(settings, "hallway") if place == "room" else settings


@pytest.mark.compiled
@pytest.mark.parametrize(("method", "grid", "place"), [*itertools.product(METHODS, GRIDS, PLACES)])
def test_each_number_has_a_bound_and_each_bound_a_number(method: str, grid: str, place: str) -> None:
    """A field without a bound ends every replay from a keyframe: declare one as `perception.bounds` says."""
    settings = settings_of(method, grid, place)
    perception = Perception(settings.ring, settings.models, settings.perception)
    numbers = {name for name, _ in numbers_of(perception.snapshot()) if not is_scratch(name)}
    assert sorted(numbers - bounds_of(perception).keys()) == [], "without a bound"
    assert sorted(bounds_of(perception).keys() - numbers) == [], "bounds of nothing"


class Inner(Record):
    x: Annotated[float, PLACE]
    count: Count
    free: float


class Outer(Record):
    sum: Finite
    at: Annotated[Floats, 3, PLACE]
    one: Inner
    unheard: Annotated[Inner, UNHEARD]
    many: Annotated[Records[Inner], 2]


def test_a_record_has_the_bounds_of_its_annotations_and_the_same_layout() -> None:
    inner = {"x": PLACE, "count": Bound(0, 2**53)}
    assert inner == Inner.BOUNDS, "what is overwritten before each use needs none"
    assert Outer.BOUNDS["one"] == Outer.BOUNDS["many"] == inner
    assert Outer.BOUNDS["unheard"] == {name: bound._replace(nan=True) for name, bound in inner.items()}
    assert Outer.BOUNDS["at"] == PLACE
    assert zeros(Outer, 1)["at"].shape == (1, 3)
    assert zeros(Outer, 1)["many"]["x"].shape == (1, 2)
    assert Inner.DTYPE.names == ("x", "count", "free")


class Part:
    BOUNDS = bounds(model=up_to(1000), rows=Inner.BOUNDS)

    def __init__(self) -> None:
        self.model = 3
        self.rows = zeros(Inner, 4)
        self.is_done = False


Part.__module__ = "perception.of_a_test"


class Owner:
    BOUNDS = bounds({"part.model": lambda self: index_of(self.models)}, size=lambda self: up_to(len(self.array)))

    def __init__(self) -> None:
        self.models, self.size = 5, 2
        self.array, self.part = np.zeros(7, np.bool_), Part()


def test_an_object_declares_its_own_numbers_and_may_know_those_of_a_part_better() -> None:
    assert bounds_of(Owner()) == {
        "array": FLAG,
        "size": Bound(0, 7),
        "part.model": Bound(0, 4),
        "part.rows.x": PLACE,
        "part.rows.count": Bound(0, 2**53),
        "part.is_done": FLAG,
    }
    assert index_of(0) == Bound(0, 0)
