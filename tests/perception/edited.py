"""A drive past four drums, and perceptions that have observed it; shared by the tests of edits."""

from __future__ import annotations

import math
from collections.abc import Iterator

from config.load import load_settings
from config.settings import Settings
from drivers.messages import Firing
from perception.detected_object import DetectedObject
from perception.pipeline import Perception
from tests.perception.halls import FT

EARLY = 61
"""Firings until the first drums are detected."""
SEEN_TO_FT = 6.0
"""The first drive ends at this x, ft, with four drums detected."""
DRUM = (1.0 * FT, 4.0 * FT)
METHODS = ("paper", "bayes")


def settings_of(method: str) -> Settings:
    return load_settings("hallway", [f"perception.method={method}"], models=("semicircle", "box"))


SETTINGS = {method: settings_of(method) for method in METHODS}


def passed(firings: list[Firing]) -> Iterator[Firing]:
    return (f for f in firings if f.pose.y == 0.0)


def again(firings: list[Firing]) -> Iterator[Firing]:
    return (f for f in firings if f.pose.y != 0.0)


def fresh(method: str) -> Perception:
    chosen = SETTINGS[method]
    return Perception(chosen.ring, chosen.models, chosen.perception)


def hear(perception: Perception, firing: Firing) -> None:
    perception.observe(firing)
    settle(perception)


def settle(perception: Perception) -> None:
    while perception.can_refine and perception.refine():
        pass


def at(perception: Perception, place: tuple[float, float], within_m: float = 0.15) -> DetectedObject | None:
    """Return the object nearest to a place (m), None if there is none within `within_m`."""
    near = [o for o in perception.objects() if math.dist((o.x, o.y), place) < within_m]
    return min(near, key=lambda o: math.dist((o.x, o.y), place)) if near else None


def there(perception: Perception, place: tuple[float, float] = DRUM) -> DetectedObject:
    found = at(perception, place)
    assert found is not None, perception.objects()
    return found


def number_of(seen: DetectedObject) -> int:
    assert seen.number is not None
    return seen.number


def is_bayes(perception: Perception) -> bool:
    return type(perception.method).__name__ == "BayesPerception"
