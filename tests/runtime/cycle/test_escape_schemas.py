"""The schemas against dead ends: none by default, each by its gain, on legs and on the way to a goal."""

from __future__ import annotations

import numpy as np
import pytest

from config.load import load_settings
from perception.percept import Percept, Pose
from runtime.cycle.escape_schemas import escape_schemas
from tests.behaviors.views import EVERYWHERE

PERCEPT = Percept(Pose(0.0, 0.0, 0.0), np.array([[1.0, 0.2]]), EVERYWHERE)


@pytest.mark.parametrize(("sets", "expected"), [
    ((), []),
    (("behaviors.noise.noise_gain=0.3",), ["noise"]),
    (("behaviors.avoid_past.avoid_past_gain=1", "behaviors.swirl.swirl_gain=1"), ["avoid_past", "swirl"]),
])  # fmt: skip
def test_each_answers_where_its_gain_is_not_zero(sets: tuple[str, ...], expected: list[str]) -> None:
    responses, trail = escape_schemas(PERCEPT, 0.0, 1.0, (), load_settings("hallway", sets))
    assert [response.schema for response in responses] == expected
    assert trail == (((0.0, 0.0),) if "avoid_past" in expected else ())
