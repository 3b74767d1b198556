"""Echoes remembered near the robot: renewed where they are heard, forgotten by way, distance and under the body."""

from __future__ import annotations

import numpy as np

from behaviors.memory import near_memory
from behaviors.memory.near_memory import KEPT_M, KEPT_MAX, NEAR_M, NearEchoes, remember
from perception.percept import Floats, Pose

HERE = Pose(0.0, 0.0, 0.0)
NOTHING: Floats = np.empty((0, 2))


def places(kept: NearEchoes, echoes: Floats, pose: Pose, driven_m: float) -> list[list[float]]:
    found: list[list[float]] = near_memory.places(remember(kept, echoes, pose, driven_m, 0.381)).tolist()
    return found


def test_what_is_not_heard_again_stays_until_the_robot_has_driven_on() -> None:
    kept = remember((), np.array([[0.7, 0.0], [NEAR_M + 0.1, 0.0]]), HERE, 1.0, 0.381)
    assert places(kept, NOTHING, HERE, 1.0) == [[0.7, 0.0]]
    assert places(kept, NOTHING, HERE, 1.0 + 0.99 * KEPT_M) == [[0.7, 0.0]]
    assert places(kept, NOTHING, HERE, 1.0 + 1.01 * KEPT_M) == []


def test_an_echo_is_renewed_and_one_under_the_body_was_none() -> None:
    kept = remember((), np.array([[0.7, 0.0]]), HERE, 0.0, 0.381)
    assert places(kept, np.array([[0.75, 0.0]]), HERE, 1.0) == [[0.75, 0.0]]
    assert places(kept, NOTHING, Pose(0.5, 0.0, 0.0), 1.0) == []


def test_no_more_is_kept_than_has_room() -> None:
    many = np.column_stack([np.linspace(0.5, 1.4, 3 * KEPT_MAX), np.zeros(3 * KEPT_MAX)])
    assert len(places((), many, HERE, 0.0)) == KEPT_MAX
