"""Search: its lines leave nothing of the area out, and a corner that cannot be reached is passed over."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from behaviors.search import lines
from config.mission_step import SearchUse
from tests.behaviors.hall import World
from tests.behaviors.mission_robot import driven


def use(pattern: str, width_m: float, depth_m: float, spacing_m: float) -> SearchUse:
    return SearchUse.model_validate(
        {"name": "search", "pattern": pattern, "width_m": width_m, "depth_m": depth_m, "spacing_m": spacing_m}
    )


@pytest.mark.parametrize("pattern", ["spiral", "lawn_mower"])
@pytest.mark.parametrize("size", [(4.0, 4.0, 1.0), (3.0, 6.0, 0.7), (6.0, 2.0, 1.5), (1.0, 1.0, 3.0)])
def test_no_place_of_the_area_is_farther_from_a_line_than_the_spacing(
    pattern: str, size: tuple[float, float, float]
) -> None:
    width, depth, spacing = size
    corners = [(0.0, 0.0), *lines(use(pattern, *size))]
    samples = np.array([
        (a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]))
        for a, b in itertools.pairwise(corners)
        for s in np.linspace(0.0, 1.0, 60)
    ])  # fmt: skip
    x0, y0 = (-depth / 2, -width / 2) if pattern == "spiral" else (0.0, 0.0)
    assert samples[:, 0].min() >= x0 - 1e-9
    assert samples[:, 0].max() <= x0 + depth + 1e-9
    assert samples[:, 1].max() <= y0 + width + 1e-9
    for x, y in itertools.product(np.linspace(x0, x0 + depth, 9), np.linspace(y0, y0 + width, 9)):
        away = np.hypot(samples[:, 0] - x, samples[:, 1] - y).min()
        assert away <= spacing * math.sqrt(0.5) + 0.06


def test_it_arrives_when_the_area_is_covered_and_passes_over_what_is_occupied() -> None:
    step = {"schemas": [{"name": "search", "width_m": 2.0, "depth_m": 2.0, "spacing_m": 1.0}]}
    free = driven(step, seconds=90.0)
    assert (free.status, free.steps) == ("done", ["a"])
    blocked = driven(step, world=World(((1.0, 1.0, 0.3),)), seconds=90.0)
    assert blocked.status == "done"
    assert blocked.clearance_m > 0.05
    assert min(math.dist((pose.x, pose.y), (-1.0, -1.0)) for pose in blocked.path) < 0.3, "it went on"
