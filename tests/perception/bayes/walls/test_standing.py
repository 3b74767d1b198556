"""What is sure when a robot stops stays sure while it stands, unless ranges contradict it."""

from __future__ import annotations

import numpy as np
import pytest

from perception.bayes.memory.state import Memory
from perception.bayes.memory.wall_records import WallMap
from perception.bayes.walls.bins import bin_of, clear_wall, enter_pass
from perception.bayes.walls.corners import find_corners
from perception.bayes.walls.merging import drop_explained
from perception.bayes.walls.report import room_report
from perception.bayes.walls.standing import keep_while_standing
from tests.perception.bayes.random_tracks import P
from tests.perception.bayes.rooms import fill, new_room, place_wall, wall_ends

CORNER = (2.0, 2.0)


def stopped() -> tuple[Memory, WallMap]:
    """Return a robot that stopped before two walls, the second of which goes on to their corner, which was heard."""
    memory, room = new_room()
    for k, (normal, low, high) in enumerate(((0.0, -2.0, 1.95), (0.5 * np.pi, -1.2, 0.6))):
        place_wall(room.walls[k], np.zeros(2), normal, 2.0)
        fill(memory, room.walls[k], low, high)
    find_corners(memory.s)
    room.corners[0].echoes, room.corners[0].passes = 6.0, 1.0
    keep_while_standing(memory, (0.1, 0.0, 0.0))
    keep_while_standing(memory, (0.1, 0.0, 0.0))
    return memory, room


def make_doubtful(room: WallMap) -> None:
    """Move what the report judges by to the other side of its limits."""
    room.corners[0].echoes = 1.5
    for k in range(2):
        room.walls[k].chi2 = room.walls[k].spans[0].chi2 = -3.0


def test_what_is_sure_at_the_stop_stays_until_the_robot_moves_on() -> None:
    memory, room = stopped()
    before = room_report(memory)
    assert before[0]["x2"].tolist() == pytest.approx([2.0, -0.6], abs=0.05)
    assert before[0]["x1"][1] == pytest.approx(CORNER[0], abs=0.05)
    make_doubtful(room)
    for x, yaw in ((0.1, 0.0), (0.104, 0.01)):  # odometry trembles
        keep_while_standing(memory, (x, 0.0, yaw))
        segments, points = room_report(memory)
        for name in ("x1", "y1", "x2", "y2"):
            assert segments[name] == pytest.approx(before[0][name], abs=0.035)
        assert len(points) == len(before[1]) == 1
    keep_while_standing(memory, (0.12, 0.0, 0.0))
    assert [len(part) for part in room_report(memory)] == [0, 0]


@pytest.mark.parametrize(("x", "yaw"), [(0.102, 0.0), (0.1, 0.1), (0.1, 0.01)])
def test_a_robot_that_creeps_or_turns_does_not_stand(x: float, yaw: float) -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -2.0, 2.0)
    keep_while_standing(memory, (0.1, 0.0, 0.0))
    keep_while_standing(memory, (x, 0.0, yaw))
    make_doubtful(room)
    assert len(wall_ends(memory)) == 0


def test_ranges_that_pass_take_away_what_was_sure() -> None:
    memory, room = stopped()
    make_doubtful(room)
    for passes, end in ((1, 2.0), (3, 1.2)):  # beyond where the second wall was heard, up to the corner
        for b in range(bin_of(-2.0), bin_of(-1.2)):
            for _ in range(passes):
                enter_pass(room.walls[1], b, 1.0)
        assert wall_ends(memory)[1, 0] == pytest.approx(end, abs=0.05)
    for b in range(bin_of(-2.0), bin_of(2.0)):
        for _ in range(8):
            enter_pass(room.walls[0], b, 1.0)
    assert not np.any(np.abs(wall_ends(memory)[:, :3:2] - 2.0).max(axis=1) < 0.1), "no part of the first wall"
    room.corners[0].passes = 20.0
    assert len(room_report(memory)[1]) == 0


def test_another_explanation_ends_a_wall_before_the_stop_and_a_misfit_after_it_too() -> None:
    for is_standing in (False, True):
        memory, room = new_room()
        for k, (x, low, high, count, distance) in enumerate(((2.0, -2.0, 2.0, 5.0, 1.0), (3.0, -0.4, 0.4, 1.0, 2.5))):
            place_wall(room.walls[k], np.zeros(2), 0.0, x)
            fill(memory, room.walls[k], low, high, count, distance)
        for b in range(bin_of(-0.4), bin_of(0.4)):
            room.walls[1].bins[b].is_kept = int(is_standing)
        drop_explained(memory.s, memory.tracks, P, 1)
        assert (room.walls[1].weight > 0.0) == is_standing
        room.walls[1].misfit = 4.0
        drop_explained(memory.s, memory.tracks, P, 1)
        assert room.walls[1].weight == 0.0


def test_points_that_were_sure_stay_where_they_were_although_walls_end_elsewhere_or_are_gone() -> None:
    memory, room = stopped()
    place_wall(room.walls[2], np.zeros(2), np.pi, 3.0)
    fill(memory, room.walls[2], -1.0, 1.0)
    find_corners(memory.s)
    edge = next(edge for edge in room.edges if edge.is_used == 1 and edge.first == 2)
    edge.echoes, edge.covariance_xx, edge.covariance_yy = 9.0, 1e-4, 1e-4
    for x in (0.2, 0.2):  # stops a second time
        keep_while_standing(memory, (x, 0.0, 0.0))
    before = room_report(memory)[1]
    assert len(before) >= 2
    fill(memory, room.walls[2], -1.6, 1.6)  # every wall goes on beyond, …
    find_corners(memory.s)
    for wall in room.walls:  # … or ends
        clear_wall(wall)
    find_corners(memory.s)
    after = room_report(memory)[1]
    for x, y in before[["x", "y"]].tolist():
        assert np.hypot(after["x"] - x, after["y"] - y).min() < 0.05
    keep_while_standing(memory, (0.3, 0.0, 0.0))
    find_corners(memory.s)
    assert len(room_report(memory)[1]) == 0


def test_an_invalid_place_is_no_stop() -> None:
    memory, room = new_room()
    for x in (np.nan, np.inf, 1e12):
        keep_while_standing(memory, (x, 0.0, 0.0))
        keep_while_standing(memory, (0.0, 0.0, x))
    assert room.stop.is_standing in (0, 1)
    assert abs(room.stop.x) < 1.0
