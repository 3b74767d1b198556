"""Where the sensors of a new robot look, from options: the defaults drive."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from runtime.cli.commands.init_ring import Described, ask_mounting
from runtime.cli.commands.questions import Questions


@pytest.mark.parametrize("body_m", [0.08, 0.1, 0.25, 0.5])
@pytest.mark.parametrize("beam_deg", [7.5, 12.0, 15.0, 30.0, 60.0])
def test_as_many_in_front_as_the_defaults_say_cover_the_path(body_m: float, beam_deg: float) -> None:
    robot = Described(body_m, beam_deg, 24, 24)
    mounting = ask_mounting(Questions({"layout": "in-front"}, asks=False), robot)
    assert mounting.sensors is not None
    angles = [angle for _, _, angle in mounting.sensors]
    assert angles[0] + beam_deg >= robot.path_deg
    assert angles == [-angle for angle in reversed(angles)]
    assert all(before - after <= 2.0 * beam_deg for before, after in pairwise(angles))
    assert math.hypot(*mounting.sensors[0][:2]) == pytest.approx(body_m, abs=1e-3)


def test_one_by_one_takes_each_place_and_direction() -> None:
    given = {"layout": "one-by-one", "sensors": 2, "direction_1": 90.0, "x_1": 0.05, "y_1": 0.1}
    mounting = ask_mounting(Questions(given, asks=False), Described(0.1, 15.0, 24, 24))
    assert mounting.sensors == ((0.1, 0.0, 0.0), (0.05, 0.1, 90.0))
